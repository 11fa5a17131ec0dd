"""Flux maps as published: holes, ragged circles, axes the other way round, scattered points, a
frame that is turned."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.io import savemat

from model.drive_files import load_drive
from model.errors import BadInput
from model.map_checks import (
    torque_line,
    torque_notes,
    wild_flux_notes,
    wild_notes,
    wild_torques,
)
from model.map_fit import FOLDS, folds, held_out, left_out, on_edge
from model.map_points import MapPoints, read_points
from model.map_quality import asymmetry, best_angle, quality
from model.mapped import map_quality
from model.ratings import cautions
from tests.data import real_data
from tests.model.planted_map import machine

TOML = """
[motor]
pole_pairs = 4
resistance = 0.5
inertia = 1e-3
rated_current = 8.0
rated_torque = 2.0
rated_speed_rpm = 3000.0
[flux_map]
file = "FILE"
cells = [8, 6]
smooth = 1e-3
"""


def planted(shape=(19, 21), radius=np.inf, angle=0.0):
    """Grids i_d (n, m), i_q (n, m) and fluxes in a frame whose d axis stands `angle` ahead of the
    magnet's."""
    d, q = np.meshgrid(np.linspace(-12, 3, shape[0]), np.linspace(-12, 12, shape[1]), indexing="ij")
    true = (d + 1j * q) * np.exp(1j * angle)
    psi = (lambda a, b: (a + 1j * b) * np.exp(-1j * angle))(*machine(true.real, true.imag))
    hole = np.hypot(d, q) > radius
    return d, q, np.where(hole, np.nan, psi.real), np.where(hole, np.nan, psi.imag)


def test_holes_are_left_out_and_said(tmp_path):
    d, q, psi_d, psi_q = planted(radius=12.0)
    np.savez(tmp_path / "m.npz", i_d=d, i_q=q, psi_d=psi_d, psi_q=psi_q)
    p = read_points(tmp_path / "m.npz")
    assert len(p.i_d) == np.count_nonzero(np.isfinite(psi_d))
    assert p.grid() is None
    assert "have no value and are left out" in p.notes[0]
    np.savez(tmp_path / "m.npz", i_d=d, i_q=q, psi_d=np.full_like(psi_d, np.nan), psi_q=psi_q)
    with pytest.raises(BadInput, match="0 of 399 points have a value; a map needs at least 24"):
        read_points(tmp_path / "m.npz")


def test_axes_the_other_way_round_are_seen(tmp_path):
    d, q, psi_d, psi_q = planted()
    body = {"i_d_vec": d[:, 0], "i_q_vec": q[0], "Psi_d": psi_d.T, "Psi_q": psi_q.T}
    savemat(tmp_path / "m.mat", body)
    p = read_points(tmp_path / "m.mat")
    np.testing.assert_allclose(p.psi_d, machine(p.i_d, p.i_q)[0], atol=1e-12)
    assert "taken the other way round" in p.notes[0]
    d, q, psi_d, psi_q = planted((21, 21))  # square: psi_d tells, which rises along i_d
    for flip in (False, True):
        body = {
            "i_d": d[:, 0],
            "i_q": q[0],
            "psi_d": psi_d.T if flip else psi_d,
            "psi_q": psi_q.T if flip else psi_q,
        }
        np.savez(tmp_path / "m.npz", **body)
        p = read_points(tmp_path / "m.npz")
        np.testing.assert_allclose(p.psi_d, machine(p.i_d, p.i_q)[0], atol=1e-12)
        assert bool(p.notes) is flip
    np.savez(tmp_path / "m.npz", i_d=d[:5, 0], i_q=q[0], psi_d=psi_d, psi_q=psi_q)
    with pytest.raises(BadInput, match=r"axes of 5 \(i_d\) and 21 \(i_q\) currents fit neither"):
        read_points(tmp_path / "m.npz")


def test_a_turned_frame_is_found_and_undone(tmp_path):
    """Planted: 3 degrees.  The polynomials take a symmetric machine as symmetric to their own
    truncation, some 1e-5."""
    angle = math.radians(3.0)
    d, q, psi_d, psi_q = planted(radius=12.5, angle=angle)
    np.savez(tmp_path / "m.npz", i_d=d, i_q=q, psi_d=psi_d, psi_q=psi_q)
    p = read_points(tmp_path / "m.npz")
    assert best_angle(p) == pytest.approx(angle, abs=2e-3)
    found = quality(p)
    assert found.angle == pytest.approx(angle, abs=2e-3)
    assert found.asymmetry > 10.0 * found.asymmetry_turned
    assert any("angle offset of 3.0" in s for s in found.sentences())
    undone = read_points(tmp_path / "m.npz", angle=angle)
    assert quality(undone).angle is None
    assert held_out(undone).inside < 0.3 * held_out(p).inside


def test_every_point_is_left_out_once(tmp_path):
    """One point in FOLDS at a time, inside the map as on its edge; those of the first part are what
    `held_out` tells."""
    d, q, psi_d, psi_q = planted()
    np.savez(tmp_path / "m.npz", i_d=d, i_q=q, psi_d=psi_d, psi_q=psi_q)
    p = read_points(tmp_path / "m.npz")
    edge, part = on_edge(p), folds(p)
    for own in (edge, ~edge):
        counts = np.bincount(part[own], minlength=FOLDS)
        assert counts.max() - counts.min() <= 1
    square, told = left_out(p, (10, 8), 1e-3), held_out(p)
    assert np.isfinite(square).all()
    for own, rms in ((~edge, told.inside), (edge, told.edge)):
        assert math.sqrt(np.mean(square[own & (part == 0)])) == pytest.approx(rms)


def test_a_symmetric_map_is_left_alone(tmp_path):
    d, q, psi_d, psi_q = planted()
    np.savez(tmp_path / "m.npz", i_d=d, i_q=q, psi_d=psi_d, psi_q=psi_q)
    p = read_points(tmp_path / "m.npz")
    assert asymmetry(p) < 1e-6  # Wb, of 0.1: a symmetric grid makes odd and even parts orthogonal
    assert quality(p).angle is None
    half = dataclasses.replace(
        p, **{n: getattr(p, n)[p.i_q >= 0.0] for n in ("i_d", "i_q", "psi_d", "psi_q")}
    )
    assert quality(half).asymmetry is None  # one sign of i_q tells none


def test_a_map_that_ends_at_no_d_current_says_how_to_start(tmp_path):
    d, q, psi_d, psi_q = planted()
    keep = d[:, 0] <= 0.0
    np.savez(tmp_path / "m.npz", i_d=d[keep], i_q=q[keep], psi_d=psi_d[keep], psi_q=psi_q[keep])
    assert any(
        "start_up = false" in s for s in quality(read_points(tmp_path / "m.npz")).sentences()
    )


@pytest.mark.parametrize("kind", ["scattered", "circle", "turned"])
def test_a_motor_with_such_a_map_has_its_fluxes(tmp_path, kind):
    from model.spline_energy import flux_from_current

    rng = np.random.default_rng(0)
    angle = math.radians(5.0) if kind == "turned" else 0.0
    d, q, psi_d, psi_q = (x.ravel() for x in planted(radius=12.5, angle=angle))
    if kind == "scattered":
        d, q = rng.uniform(-12, 3, 400), rng.uniform(-12, 12, 400)
        psi_d, psi_q = machine(d, q)
    rows = np.stack([d, q, psi_d, psi_q], axis=1)
    np.savetxt(tmp_path / "m.csv", rows, delimiter=",", header="i_d,i_q,psi_d,psi_q", comments="")
    text = TOML.replace("FILE", "m.csv") + (f"angle = {angle}\n" if angle else "")
    (tmp_path / "mine.toml").write_text(text)
    motor = load_drive(tmp_path / "mine.toml").motor
    x, y = np.array([-5.0, -2.0, 0.0]), np.array([3.0, -4.0, 2.0])
    found = flux_from_current(motor.spline, x, y)
    wanted = machine(x, y)
    # cells of 1.9 A and a light penalty: a part in a thousand of the magnet's flux of 0.1 Wb
    np.testing.assert_allclose(found[0] + motor.magnet_flux, wanted[0], atol=1e-4)
    np.testing.assert_allclose(found[1], wanted[1], atol=2e-4)


def test_a_wrong_angle_is_refused(tmp_path):
    np.savez(
        tmp_path / "m.npz", **dict(zip(("i_d", "i_q", "psi_d", "psi_q"), planted(), strict=True))
    )
    (tmp_path / "mine.toml").write_text(TOML.replace("FILE", "m.npz") + "angle = 30.0\n")
    with pytest.raises(
        BadInput, match=r"\[flux_map\] angle = 30.0 is no angle; give electrical rad"
    ):
        load_drive(tmp_path / "mine.toml")


def test_the_sew_map_holds_an_angle():
    """The file: 142 of 594 points without a value, rows i_q; psi_q from -34 to +22 mWb hints at
    about 3 degrees."""
    p = read_points(real_data() / "sew_map" / "LUT_SEW_jax_grad.mat")
    found = quality(p)
    assert found.points == 452
    assert math.degrees(found.angle) == pytest.approx(2.5, abs=0.5)
    assert held_out(p.turned(found.angle)).inside < 0.5 * found.held_out


def test_a_motor_s_map_is_asked_by_its_table(tmp_path):
    np.savez(
        tmp_path / "m.npz", **dict(zip(("i_d", "i_q", "psi_d", "psi_q"), planted(), strict=True))
    )
    found = map_quality({"file": "m.npz"}, tmp_path)
    assert found.points == 399
    said = " ".join(found.sentences())
    assert "rms on points held out" in said
    # largest: of the planted points; symmetric as planted but for the polynomials' truncation
    assert f"100 % is the largest flux, {1e3 * np.max(np.hypot(*planted()[2:])):.3g} mWb" in said
    assert "+i_q and -i_q are the same" in said
    assert map_quality({"file": "m.npz", "angle": 0.1}, tmp_path).angle == pytest.approx(
        -0.1, abs=2e-3
    )


def half_of_the_measured_map():
    """Return the measured Baldor map (motulator) cut to i_d <= 0, i_q >= 0, as finite elements
    usually give one."""
    p = read_points(real_data() / "baldor_pmsyrm" / "baldor_meas.npz")
    kept = (p.i_d <= 0.0) & (p.i_q >= 0.0)
    return dataclasses.replace(
        p, **{n: getattr(p, n)[kept] for n in ("i_d", "i_q", "psi_d", "psi_q")}
    )


def table_of(p):
    rows = np.stack([p.i_d, p.i_q, p.psi_d, p.psi_q], axis=1)
    return "i_d,i_q,psi_d,psi_q\n" + "".join(
        ",".join(f"{x:.9g}" for x in row) + "\n" for row in rows
    )


BALDOR = TOML.replace("cells = [8, 6]\nsmooth = 1e-3\n", "").replace(
    "pole_pairs = 4", "pole_pairs = 2"
)


def test_too_many_cells_are_told_by_the_errors_of_that_fit(tmp_path):
    """20 x 16 cells on 154 points: L_dd at i_d = 0 is some times the 20.3 mH between the map's own
    points there."""
    (tmp_path / "half.csv").write_text(table_of(half_of_the_measured_map()))
    (tmp_path / "auto.toml").write_text(BALDOR.replace("FILE", "half.csv"))
    (tmp_path / "cells.toml").write_text(
        BALDOR.replace("FILE", "half.csv") + "cells = [20, 16]\nsmooth = 3e-4\n"
    )
    found = map_quality({"file": "half.csv", "cells": [20, 16], "smooth": 3e-4}, tmp_path)
    auto = map_quality({"file": "half.csv"}, tmp_path)
    assert found.held_out > 2.0 * auto.held_out
    assert found.held_out_edge > 2.0 * auto.held_out_edge
    notes = load_drive(tmp_path / "cells.toml").motor.origin.notes
    assert "20 x 16 = 320 cells for 154 points" in notes[0]
    assert any("the fit's L_dd is" in note and "i_d = 0 A" in note for note in notes[1:])
    assert cautions(load_drive(tmp_path / "cells.toml"))[-len(notes) :] == notes
    again = load_drive(tmp_path / "cells.toml").motor.origin.notes  # from the disk
    assert again == notes
    assert load_drive(tmp_path / "auto.toml").motor.origin.notes == ()


@pytest.mark.parametrize(
    ("currents", "fluxes", "torque", "pairs", "said"),
    [
        (
            2**-0.5,
            1.0,
            1.0,
            4,
            (
                "1.414 times 3/2 pole_pairs (psi_d i_q - psi_q i_d): the currents or the "
                "fluxes are rms"
            ),
        ),
        (1.0, 2**-0.5, 1.0, 4, "the currents or the fluxes are rms"),
        (
            2**-0.5,
            2**-0.5,
            1.0,
            4,
            "2 times 3/2 pole_pairs (psi_d i_q - psi_q i_d): currents and fluxes are rms values",
        ),
        (1.0, 1.0, 1.0, 8, "[motor] pole_pairs holds poles"),
        (1.0, 1.0, 1.0, 3, "[motor] pole_pairs is 4"),
        (1.5**0.5, 1.5**0.5, 1.0, 4, "power-invariant transformation; both"),
        (1.0, 3**0.5, 1.0, 4, "the fluxes are between two terminals"),
        (1.0, 1.0, 1e3, 4, "the torque is in mN m"),
        (1.0, 1.0, -1.0, 4, "with the other sign"),
        (1.0, 1.0, 1.03, 4, ""),  # a torque that was measured
    ],
)
def test_a_torque_that_contradicts_the_fluxes_is_told(
    tmp_path, currents, fluxes, torque, pairs, said
):
    """Planted: T = 3/2 p (psi_d i_q - psi_q i_d) with p = 4, then columns and [motor] in another
    convention."""
    d, q, psi_d, psi_q = (x.ravel() for x in planted((9, 11)))
    friction = 0.2  # N m: of a bench that measured it, an offset
    t = torque * (1.5 * 4 * (psi_d * q - psi_q * d) - friction)
    body = {
        "i_d": currents * d,
        "i_q": currents * q,
        "psi_d": fluxes * psi_d,
        "psi_q": fluxes * psi_q,
        "torque": t,
    }
    np.savez(tmp_path / "m.npz", **body)
    line = torque_line(read_points(tmp_path / "m.npz"))
    assert line.left < 1e-9
    notes = torque_notes(line, pairs, "m.npz")
    assert (said in " ".join(notes)) if said else notes == []
    np.savez(tmp_path / "m.npz", **{**body, "torque": t * np.sign(d + 5.0)})
    assert "does not follow its fluxes" in " ".join(
        torque_notes(torque_line(read_points(tmp_path / "m.npz")), 4, "m")
    )


@pytest.mark.parametrize("off", [0.0, 0.06, -0.1, 3.0])
def test_a_wild_flux_is_named_by_its_currents(off):
    """Of the flux's span; noise of a thousandth of it names no other point."""
    d, q, psi_d, psi_q = (x.ravel() for x in planted((9, 11)))
    span = np.ptp(psi_d)
    noisy = psi_d + 1e-3 * span * np.random.default_rng(2).standard_normal(len(d))
    noisy[40] += off * span
    notes = wild_flux_notes(MapPoints("m", d, q, noisy, psi_q, ()), "m.csv")
    assert len(notes) == (off != 0.0)
    assert all(f"i_d = {d[40]:.4g} A, i_q = {q[40]:.4g} A" in n and "; i" not in n for n in notes)


@pytest.mark.parametrize("wild", [0, 3])
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_single_wild_torques_are_named_and_hide_nothing(wild, noise):
    """The line stays the planted one, pole pairs 4, and each wild point is named by its
    currents."""
    d, q, psi_d, psi_q = (x.ravel() for x in planted((9, 11)))
    t = 6.0 * (psi_d * q - psi_q * d) + noise * np.random.default_rng(1).standard_normal(len(d))
    rows = np.array([12, 50, 77])[:wild]
    t[rows] += np.array([50.0, -30.0, 900.0])[:wild] * np.std(t)
    p = MapPoints("m", d, q, psi_d, psi_q, (), t)
    assert list(np.flatnonzero(wild_torques(p))) == list(rows)
    assert torque_notes(torque_line(p), 4, "m.csv") == []
    notes = wild_notes(p, "m.csv")
    assert len(notes) == (wild > 0)
    assert all(f"i_d = {d[k]:.4g} A, i_q = {q[k]:.4g} A" in notes[0] for k in rows)


@pytest.mark.parametrize("name", ["brusa_hsm1", "thor_fea", "baldor_pmsyrm"])
def test_published_maps_do_not_contradict_themselves(name):
    real_data()
    assert load_drive(name).motor.origin.notes == ()


@pytest.mark.parametrize(
    "head",
    [
        "i_d,i_q,psi_d,psi_q,torque",
        "idVec,iqVec,fluxD,fluxQ,torque",  # MathWorks
        "Id_Peak,Iq_Peak,Flux_Linkage_D,Flux_Linkage_Q,Electromagnetic_Torque",  # Motor-CAD
        # JMAG
        (
            "d-axis current [A],q-axis current [A],d-axis flux linkage [Wb],q-axis flux "
            "linkage [Wb],Torque [N m]"
        ),
        "Id,Iq,Phi_d,Phi_q,Tem_av",  # pyleecan
        "Id,Iq,Fd,Fq,T",  # SyR-e
        "Id (A),Iq (A),lambda_d (Wb),lambda_q (Wb),Te (Nm)",
        "i_d_A,i_q_A,psi_d_mWb*,psi_q_mWb*,tau",  # *: in mWb
        "Id [Arms]~,Iq [Arms]~,psi_d [mWb]*,psi_q [mWb]*,torque",  # ~: rms
        "Id_rms~,Iq_rms~,flux_d,flux_q,torque",
        "Id (RMS)~,Iq (RMS)~,flux_d,flux_q,torque",
        "Id (Peak),Iq (Peak),Flux Linkage D,Flux Linkage Q,Torque",
        "Current_D (A),Current_Q (A),Linkage Flux D (Wb),Linkage Flux Q (Wb),Torque",
        "Id,Iq,Flux Linkage (d-axis),Flux Linkage (q-axis),Torque",
        "i_d/A,i_q/A,ψ_d/mWb*,ψ_q/mWb*,T/Nm",  # a quantity over its unit, ISO 80000-1
    ],
)
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_names_and_units_of_other_programs(tmp_path, head, separator):
    """One planted map under every name; what stands in mWb or A rms is converted."""
    d, q, psi_d, psi_q = (x.ravel() for x in planted((7, 9)))
    marks = head.split(",")
    rows = [np.array(x) for x in (d, q, psi_d, psi_q, 6.0 * (psi_d * q - psi_q * d))]
    scaled = [
        x * (1e3 if m.endswith("*") else 2**-0.5 if m.endswith("~") else 1.0)
        for x, m in zip(rows, marks, strict=True)
    ]
    text = separator.join(m.rstrip("*~") for m in marks) + "\n"
    for row in zip(*scaled, strict=True):
        line = separator.join(f"{x:.10g}" for x in row)
        text += (line.replace(".", ",") if separator == ";" else line) + "\n"
    (tmp_path / "m.csv").write_text("# from a program\n" + text)
    p = read_points(tmp_path / "m.csv")
    for found, wanted in zip((p.i_d, p.i_q, p.psi_d, p.psi_q), (d, q, psi_d, psi_q), strict=True):
        np.testing.assert_allclose(found, wanted, atol=1e-8)
    assert torque_notes(torque_line(p), 4, "m.csv") == []


def test_a_structure_s_fields_are_its_quantities(tmp_path):
    """As SyR-e keeps a motor's map: motorModel.FluxMap_dq.Id and so on."""
    d, q, psi_d, psi_q = planted((7, 9))
    savemat(
        tmp_path / "m.mat",
        {"motorModel": {"FluxMap_dq": {"Id": d, "Iq": q, "Fd": psi_d, "Fq": psi_q}}},
    )
    p = read_points(tmp_path / "m.mat")
    np.testing.assert_allclose(p.psi_d, psi_d.ravel(), atol=1e-12)


def test_a_map_of_another_unit_is_told_in_the_map_s_own_words(tmp_path):
    """Fluxes in mWb without a word: 100 Wb of magnet; nothing of [motor] is quoted that does not
    stand there."""
    rows = np.stack([x.ravel() for x in planted((9, 11))], axis=1) * [1.0, 1.0, 5e3, 5e3]
    np.savetxt(tmp_path / "m.csv", rows, delimiter=",", header="i_d,i_q,psi_d,psi_q", comments="")
    (tmp_path / "mine.toml").write_text(TOML.replace("FILE", "m.csv"))
    with pytest.raises(
        BadInput, match=r"m.csv: its points make a magnet flux of 500 Wb.*e.g. psi_d \[mWb\]"
    ):
        load_drive(tmp_path / "mine.toml")
    (tmp_path / "m.csv").write_text("i_d,i_q,psi_d,psi_q\n1,2,3,4\n")
    with pytest.raises(BadInput, match=r"'i_d' has 1 values; a map needs at least 24"):
        read_points(tmp_path / "m.csv")


def test_currents_by_amplitude_and_phase_advance(tmp_path):
    """Motor-CAD and JMAG: the current's angle ahead of q, towards -d, in degrees."""
    size, ahead = np.meshgrid(np.linspace(0.5, 12.0, 8), np.linspace(-80.0, 80.0, 9), indexing="ij")
    d, q = -size * np.sin(np.radians(ahead)), size * np.cos(np.radians(ahead))
    psi_d, psi_q = machine(d, q)
    rows = np.stack([size, ahead, psi_d, psi_q], axis=-1).reshape(-1, 4)
    head = "Stator_Current_Phase_Peak,Phase_Advance,Flux_Linkage_D,Flux_Linkage_Q"
    np.savetxt(tmp_path / "m.csv", rows, delimiter=",", header=head, comments="")
    p = read_points(tmp_path / "m.csv")
    np.testing.assert_allclose(p.psi_d, machine(p.i_d, p.i_q)[0], atol=1e-9)
    assert float(p.i_d.min()) == pytest.approx(-12.0 * math.sin(math.radians(80.0)))
    assert "phase advance" in p.notes[0]


def test_an_axis_of_the_rotor_s_angle_is_averaged(tmp_path):
    """Planted: a sixth harmonic over a whole period of six angles, whose mean is the map."""
    d, q, psi_d, psi_q = planted((7, 9))
    ripple = 1e-3 * np.cos(np.arange(6) * math.tau / 6)
    deep = psi_d[..., None] + ripple, psi_q[..., None] - ripple
    np.savez(tmp_path / "m.npz", i_d=d[:, 0], i_q=q[0], psi_d=deep[0], psi_q=deep[1])
    rows = np.stack(
        [
            np.repeat(d.ravel(), 6),
            np.repeat(q.ravel(), 6),
            np.tile(np.arange(6.0), d.size),
            *(x.ravel() for x in deep),
        ],
        axis=1,
    )
    np.savetxt(
        tmp_path / "m.csv", rows, delimiter=",", header="id,iq,theta,psi_d,psi_q", comments=""
    )
    for file in ("m.npz", "m.csv"):
        p = read_points(tmp_path / file)
        assert len(p.i_d) == d.size
        np.testing.assert_allclose(p.psi_d, machine(p.i_d, p.i_q)[0], atol=1e-9)
        assert "mean is taken" in p.notes[0]


def test_the_motor_s_file_may_name_the_columns(tmp_path):
    d, q, psi_d, psi_q = (x.ravel() for x in planted((9, 11)))
    rows = np.stack([d, q, psi_d, psi_q], axis=1)
    np.savetxt(tmp_path / "m.csv", rows, delimiter=",", header="a,b,c,e", comments="")
    table = {"i_d": "a", "i_q": "b", "psi_d": "c", "psi_q": "e"}
    np.testing.assert_allclose(
        read_points(tmp_path / "m.csv", stated=table).psi_q, psi_q, atol=1e-12
    )
    with pytest.raises(
        BadInput, match=r"no .i_d. of numbers .* it holds a, b, c, e: name it in \[flux_map\]"
    ):
        read_points(tmp_path / "m.csv")
    with pytest.raises(BadInput, match=r"\[flux_map\] i_d: unknown array of m.csv 'aa'"):
        read_points(tmp_path / "m.csv", stated={**table, "i_d": "aa"})
    named = "".join(f'{k} = "{v}"\n' for k, v in table.items())
    (tmp_path / "mine.toml").write_text(TOML.replace("FILE", "m.csv") + named)
    assert load_drive(tmp_path / "mine.toml").motor.magnet_flux == pytest.approx(0.1, abs=1e-3)
    (tmp_path / "mine.toml").write_text(TOML.replace("FILE", "m.csv") + "i_d = 5\n")
    with pytest.raises(BadInput, match=r"\[flux_map\] i_d = 5 is no name"):
        load_drive(tmp_path / "mine.toml")


def test_a_workbook_is_read_as_a_text(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["Id [A]", "Iq [A]", "fluxD [mWb]", "fluxQ [mWb]"])
    d, q, psi_d, psi_q = (x.ravel() for x in planted((7, 9)))
    for row in zip(d, q, 1e3 * psi_d, 1e3 * psi_q, strict=True):
        book.active.append([float(x) for x in row])
    book.save(tmp_path / "m.xlsx")
    np.testing.assert_allclose(read_points(tmp_path / "m.xlsx").psi_d, psi_d, atol=1e-9)


def test_a_map_without_zero_current_on_d_is_told(tmp_path):
    d, q, psi_d, psi_q = planted()
    keep = d[:, 0] < -1.0
    body = dict(zip(("i_d", "i_q", "psi_d", "psi_q"), (d, q, psi_d, psi_q), strict=True))
    np.savez(tmp_path / "m.npz", **{name: x[keep] for name, x in body.items()})
    (tmp_path / "mine.toml").write_text(TOML.replace("FILE", "m.npz"))
    with pytest.raises(
        BadInput, match=r"m\.npz: the map ends at i_d = -\S+ A; it must hold i_d = 0"
    ):
        load_drive(tmp_path / "mine.toml")
