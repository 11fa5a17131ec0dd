"""The switched bench leaves its valid domain where the exact plant does: convexity, status, exit
code."""

import math

import numpy as np
import pytest

from estimators.registry import load_estimator
from model.drive_files import load_drive
from model.effects import library
from model.energy import hessian, min_eigenvalue
from model.errors import PhysicsError
from sandbox.cli import main
from sandbox.drive.closed import closed_bench
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate
from sandbox.plant.additions import stiffen_further
from sandbox.plant.electrical import stiffen
from sandbox.plant.sets import complete
from sandbox.switched import bench_numbers, harmonics
from sandbox.switched.bench_numbers import bench
from sandbox.switched.phase_machine import current_and_torque, least_stiffness

EFFECTS = {"saturation.alpha_12": 0.0, "saturation.alpha_22": 0.0, "saturation.alpha_04": -5.0}
STEP = Scenario("step", (Segment(0.02), Segment(0.3, 0.35, 0.3)), rotor="free", reference="speed")


@pytest.mark.parametrize("gamma_6", [0.0, 0.7])
@pytest.mark.parametrize("theta", [0.0, 0.8, -2.3])
def test_least_stiffness_is_the_smaller_eigenvalue(theta, gamma_6):
    """Of the Jacobian of the current, by central differences (rounding, curvature 1e-7); the
    paper's Hessian."""
    drive = load_drive("ipm_exchanged")
    b = bench(drive.motor, drive.converter, {"inductance_harmonics.gamma_6": gamma_6})
    d, q, h = -0.06, 0.045, 1e-6
    psi = complex(d + drive.motor.magnet_flux, q) * complex(math.cos(theta), math.sin(theta))
    slope = [
        (current_and_torque(b, psi + s, theta)[0] - current_and_torque(b, psi - s, theta)[0])
        / (2 * h)
        for s in (h, 1j * h)
    ]
    jacobian = np.array([[z.real for z in slope], [z.imag for z in slope]])
    found = least_stiffness(b, psi, theta)
    assert found == pytest.approx(np.linalg.eigvalsh(0.5 * (jacobian + jacobian.T))[0], rel=1e-7)
    if gamma_6 == 0.0:
        assert found == pytest.approx(min_eigenvalue(*hessian(drive.motor.energy, d, q)), rel=1e-12)


@pytest.mark.parametrize("plant", ["exact", "switched"])
def test_flux_that_leaves_the_domain_ends_the_run(plant):
    """alpha_04 < 0: Gamma_qq = 1/L_q + 12 alpha_04 phi_q^2 vanishes at phi_q = (60 L_q)^-1/2, in a
    step of speed.

    The exact plant looks at the start of a period and says the flux within it: up to U/sqrt(3) T_s
    more.
    """
    drive = load_drive("spm_exchanged")
    edge = 1.0 / math.sqrt(60.0 * drive.motor.inductance_q)
    with pytest.raises(
        PhysicsError, match=r"after 0\.16\d* s the fluxes .* left the domain"
    ) as found:
        simulate(drive, STEP, load_estimator("qnull"), effects=EFFECTS, plant=plant)
    phi_q = float(str(found.value).partition("(")[2].partition(")")[0].split(",")[1])
    more = 400.0 / math.sqrt(3.0) * drive.converter.sampling_period if plant == "exact" else 0.0
    assert edge < phi_q < 1.05 * edge + more


HARMONICS = {
    "inductance_harmonics.gamma_6": 0.7,
    "inductance_harmonics.2.alpha_30": 9.0,
    "inductance_harmonics.2.alpha_21": -4.0,
    "inductance_harmonics.3.pulse": 0.5,
    "inductance_harmonics.3.alpha_12": 3.0,
    "inductance_harmonics.3.order": -18.0,
}


@pytest.mark.parametrize("theta", [0.0, 0.8, -2.3])
def test_a_closed_loop_sees_what_harmonics_take(theta):
    """The eigenvalue that the loop judges is the switched bench's (no code shared); differences of
    currents of second degree are exact but for rounding, 1e-16 of a current over 1e-4 of its
    flux."""
    drive = load_drive("ipm_exchanged")
    b = bench(drive.motor, drive.converter, HARMONICS)
    values = complete(drive.motor, drive.converter, HARMONICS)
    own = closed_bench(drive.motor, drive.converter, values, "locked", theta, 1e-5)
    c, s = math.cos(theta), math.sin(theta)
    psi = complex(-0.06 + drive.motor.magnet_flux, 0.045) * complex(c, s)
    own.w["psi_alpha"][0], own.w["psi_beta"][0] = psi.real, psi.imag
    stiffen(own.w, None, c, s)
    stiffen_further(own.w, c, s)
    aa, ab, bb = (own.w[f"stiff_{x}"][0] + own.w[f"stiffer_{x}"][0] for x in ("aa", "ab", "bb"))
    assert min_eigenvalue(aa, ab, bb) == pytest.approx(least_stiffness(b, psi, theta), rel=1e-10)
    assert abs(own.w["stiffer_aa"][0]) > 0.1


@pytest.mark.parametrize("plant", ["exact", "switched"])
def test_harmonics_that_take_convexity_away_end_the_run(plant, monkeypatch):
    """Twice what a simulated drive may have of alpha_30, the check before the run left out: 6
    alpha_30 phi_d of 45 A/Wb^2 is 1/L_d at phi_d = -0.08 Wb, which 1.4 of rated current make; what
    saturation takes and adds comes on top.
    """
    monkeypatch.setattr(library, "check_inside", lambda *_: None)
    monkeypatch.setattr(bench_numbers, "check_inside", lambda *_: None)
    monkeypatch.setattr(harmonics, "check_below", lambda *_: None)
    drive, effects = load_drive("ipm_exchanged"), {"inductance_harmonics.2.alpha_30": 45.0}
    steps = [Segment(0.02), Segment(0.2, 0.0, 0.05, current_d=-2.0, ramp=0.1)]
    scene = Scenario("deep", tuple(steps), rotor="driven", start_up=False)
    with pytest.raises(
        PhysicsError, match=r"the fluxes .* left the domain .* with what effects add"
    ) as found:
        simulate(
            drive, scene, load_estimator("ekf"), closed_loop=False, effects=effects, plant=plant
        )
    phi_d = float(str(found.value).partition("(")[2].partition(",")[0])
    assert -0.13 < phi_d < -0.06


def test_command_line_says_so_with_exit_code_3(tmp_path, capsys):
    scenario = tmp_path / "step.toml"
    scenario.write_text(
        '[scenario]\nrotor = "free"\nreference = "speed"\n[[segment]]\nduration = 0.02\n'
        "[[segment]]\nduration = 0.3\nload = 0.35\nspeed = 0.3\n"
    )
    effects = ",".join(f"{k}={v}" for k, v in EFFECTS.items())
    call = [
        "simulate",
        "--motor",
        "spm_exchanged",
        "--scenario",
        str(scenario),
        "--effects",
        effects,
    ]
    assert (
        main(
            [*call, "--plant", "switched", "--no-trace", "--quiet", "--out", str(tmp_path / "out")]
        )
        == 3
    )
    assert "left the domain" in capsys.readouterr().err
