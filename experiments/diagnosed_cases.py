"""Real drives handed to `sensorless diagnose` as they are on file: one function a case of
`real_cases`."""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from experiments import synrm_as_integrated as synrm_flux
from experiments import synrm_standstill
from experiments.drawing import RESULTS, shared
from experiments.real_drives import thor
from experiments.real_drives.campaigns import real_drives
from experiments.standstill import fit_axes
from experiments.thor_bench import bench
from model.map_points import read_points
from model.map_quality import quality
from sandbox.cli import main as command
from sandbox.public.campaigns.diagnosed import diagnose
from sandbox.recordings.campaign import Campaign
from sandbox.recordings.writing import write_campaign

OWN = Path(__file__).parent
# A, V: as `model/inverter_table.py` shows it
TABLE = [[0.0, 0.0], [0.2, 2.4], [0.5, 4.4], [1.0, 5.3], [4.5, 6.2]]
HEADS = ("Where?", "Which?", "How far?", "Left?", "Not told?")
LAAS = """[columns]
t = {column = "Time"}
theta = {column = "Position", mechanical = true}
i_q = {column = "Iq"}
[motor]
torque_constant = 0.02804
inertia = 1e-5
[uncertainty]
inertia = 0.5
[drive]
encoder_counts = 20000
"""


def answer_of(campaign: Path, *arguments: str) -> dict[str, Any]:
    """Return what `sensorless diagnose` says: its lines and figures, or the sentence with which it
    refuses."""
    said, refused = io.StringIO(), io.StringIO()
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(refused):
            code = command(
                ["diagnose", str(campaign), *arguments, "--jobs", "1", "--out", str(out)]
            )
        if code:
            text = refused.getvalue().strip().splitlines()[-1]
            return {"verdict": "refused", "lines": [text.replace(str(campaign), "FOLDER")]}
        found = json.loads((out / "diagnosis.json").read_text())
    lines = [line for line in said.getvalue().splitlines() if line.startswith(HEADS)]
    return figures(found) | {"lines": lines}


def figures(found: dict[str, Any]) -> dict[str, Any]:
    """Return verdict, effects, J on recordings held out and cost of a diagnosis."""
    gap, best = found["gap"], found["hypotheses"][0]
    return {
        "verdict": found["verdict"],
        "effects": best["effects"],
        "raw": gap["raw"],
        "before": gap["before"],
        "after": gap["after"],
        "simulations": found["cost"]["simulations"],
        "seconds": found["cost"]["seconds"],
        "parameters": {k: p["value"] for k, p in best["parameters"].items()},
        "orders": {int(w["order"]): w["share"] for w in found["where"] if w["order"]},
    }


def synrm_quartic(folder: Path) -> dict[str, Any]:
    """Return the SynRM's standstill test against the quartic energy that was fitted to it."""
    return answer_of(
        shared("SENSORLESS_DATA", "realdata") / "synrm_standstill",
        "--columns",
        str(OWN / "synrm_standstill.toml"),
    )


def laas_rolling(folder: Path) -> dict[str, Any]:
    """Return LAAS' rolling runs with u_q, on an even grid, effects that the log cannot show left
    out."""
    os.environ.setdefault("SENSORLESS_DATA", str(shared("SENSORLESS_DATA", "realdata")))
    drive = real_drives("laas_bldc")[0]
    assert drive.campaign is not None
    return answer_of(
        write_campaign(folder / "laas", drive.campaign), "--exclude", ",".join(drive.hidden)
    )


def thor_quartic(folder: Path) -> dict[str, Any]:
    """Return THOR's finite elements behind voltages against the quartic energy fitted to their
    mean."""
    table = thor.read(shared("SENSORLESS_DATA", "realdata") / "thor_fea" / "thor_fea.npz")
    return answer_of(write_campaign(folder / "thor", bench(table)))


def write_map(path: Path, points: Any) -> None:
    """Write points i_d, i_q (A), psi_d, psi_q (Wb) of a flux map, (n, 4)."""
    np.savetxt(path, points, delimiter=",", header="i_d,i_q,psi_d,psi_q", comments="")


def synrm_own_map(folder: Path) -> dict[str, Any]:
    """Return the same against the spline through its own flux points (both axes' tests, half of the
    cross test)."""
    data = synrm_standstill.tests()
    fit = fit_axes([(data["d"], 0), (data["q"], 1)])
    psi_d, psi_q, i_d, i_q = synrm_standstill.points(data, fit, half=True)
    place = folder / "synrm"
    place.mkdir()
    for file in synrm_standstill.FILES.values():
        (place / file).write_bytes(
            (shared("SENSORLESS_DATA", "realdata") / "synrm_standstill" / file).read_bytes()
        )
    return answer_of(
        *_with_map(place, np.c_[i_d, i_q, psi_d, psi_q], "cells = [12, 8]\nsmooth = 0.003")
    )


def synrm_as_integrated(folder: Path) -> dict[str, Any]:
    """Return the same after what `experiments.synrm_as_integrated` corrects, R of the authors
    included."""
    resistance, tests = list(synrm_flux.steps().values())[-1]
    place = folder / "synrm"
    place.mkdir()
    for name, c in tests.items():
        rows = np.column_stack([c.t, *c.u, *c.i])
        np.savetxt(
            place / synrm_standstill.FILES[name],
            rows,
            delimiter=",",
            header="t,Ud,Uq,Id,Iq",
            comments="",
        )
    arguments = _with_map(place, synrm_flux.map_points(tests), "cells = [12, 14]\nsmooth = 0.001")
    text = (place / "columns.toml").read_text()
    (place / "columns.toml").write_text(
        text.replace("resistance = 11.02", f"resistance = {resistance:.6g}")
    )
    return answer_of(*arguments)


def _with_map(place: Path, points: Any, fitted: str) -> tuple[Any, ...]:
    """Write the SynRM's flux map and the column map that has it for a nominal model; return what
    `told` is given."""
    write_map(place / "map.csv", points)
    text = (OWN / "synrm_standstill.toml").read_text()
    of_map = ("inductance_", "alpha_", "magnet_flux")
    kept = "\n".join(line for line in text.splitlines() if not line.startswith(of_map))
    (place / "columns.toml").write_text(f'{kept}\n[flux_map]\nfile = "map.csv"\n{fitted}\n')
    return place, "--columns", str(place / "columns.toml")


def thor_own_map(folder: Path) -> dict[str, Any]:
    """Return THOR's finite elements behind voltages, their mean over the angle as nominal flux
    map."""
    return answer_of(thor_with_map(folder))


def thor_with_map(folder: Path) -> Path:
    """Write THOR's campaign with the tables' mean over the angle as nominal flux map; return its
    folder."""
    table = thor.read(shared("SENSORLESS_DATA", "realdata") / "thor_fea" / "thor_fea.npz")
    place = write_campaign(folder / "thor", bench(table))
    i_d, i_q = np.meshgrid(table.i_d, table.i_q, indexing="ij")
    psi_d, psi_q = table.psi_d.mean(2), table.psi_q.mean(2)
    rows = [
        np.c_[i_d.ravel(), s * i_q.ravel(), psi_d.ravel(), s * psi_q.ravel()] for s in (1.0, -1.0)
    ]
    rows[1] = rows[1][i_q.ravel() > 0.0]  # the machine's mirror image: the tables hold i_q >= 0
    write_map(place / "map.csv", np.vstack(rows))
    text = (place / "campaign.toml").read_text()
    kept = "\n".join(
        x for x in text.splitlines() if not x.startswith(("inductance_", "alpha_", "magnet_flux ="))
    )
    (place / "campaign.toml").write_text(
        kept + '\n[flux_map]\nfile = "map.csv"\ncells = [14, 12]\nsmooth = 0.001\n'
    )
    return place


def laas_motion(folder: Path) -> dict[str, Any]:
    """Return all of LAAS' files as they are, by their motion."""
    files = (
        "quasi_static_scan",
        "acceleration",
        "speed_test1",
        "rolling_data",
        "rolling_data1",
        "rolling_data2",
    )
    text = LAAS + "".join(f'[[recording]]\nfile = "{file}.txt"\nrotor = "free"\n' for file in files)
    (folder / "laas.toml").write_text(text)
    return answer_of(
        shared("SENSORLESS_DATA", "realdata") / "laas_bldc", "--columns", str(folder / "laas.toml")
    )


EMPS = """[columns]
t = {column = "t"}
theta = {column = "qm", mechanical = true}
torque = {column = "vir", scale = 35.15065188}
[[recording]]
file = "DATA_EMPS.mat"
rotor = "free"
"""


def emps(folder: Path) -> dict[str, Any]:
    """Return what the motion of a linear axis tells: metres stand for radians, newtons for newton
    metres."""
    (folder / "emps.toml").write_text(EMPS)
    return answer_of(
        shared("SENSORLESS_DATA", "realdata") / "emps", "--columns", str(folder / "emps.toml")
    )


def moteus(folder: Path) -> dict[str, Any]:
    """Return what steady points say, and how `diagnose` refuses them."""
    os.environ.setdefault("SENSORLESS_DATA", str(shared("SENSORLESS_DATA", "realdata")))
    found = answer_of(shared("SENSORLESS_DATA", "realdata") / "moteus_ld")
    return found | {
        "lines": found["lines"] + [f"{d.name}: {d.can[0]}" for d in real_drives("moteus_ld")]
    }


def sew_map(folder: Path) -> dict[str, Any]:
    """Return what the audit says of the SEW machine's measured map."""
    os.environ.setdefault("SENSORLESS_DATA", str(shared("SENSORLESS_DATA", "realdata")))
    found = quality(
        read_points(shared("SENSORLESS_DATA", "realdata") / "sew_map" / "LUT_SEW_jax_grad.mat")
    )
    turned = quality(
        read_points(
            shared("SENSORLESS_DATA", "realdata") / "sew_map" / "LUT_SEW_jax_grad.mat",
            angle=found.angle or 0.0,
        )
    )
    lines = [*found.sentences(), *(f"turned: {text}" for text in turned.sentences())]
    mwb = {"before": found.held_out, "after": turned.held_out}
    return {
        "verdict": "angle offset",
        "effects": [],
        "lines": lines,
        "angle_deg": math.degrees(found.angle or 0.0),
        **{f"held_out_{k}_Wb": v for k, v in mwb.items()},
    }


def _with_table() -> tuple[Campaign, Campaign]:
    """Return a campaign of the switched bench whose legs lose what the measured table says: nominal
    with the table, and without it."""
    from dataclasses import replace

    from experiments.example_campaign import CASES, drive, recording
    from sandbox.drive.record import UNCERTAINTY, background_of

    own = drive()
    legs = replace(own, converter=replace(own.converter, inverter_table=tuple(map(tuple, TABLE))))
    rng = np.random.default_rng(7)
    parts = tuple(recording(legs, case, {}, rng) for case in CASES)
    both = (
        Campaign("inverter_table", d, parts, UNCERTAINTY, background_of(own), False)
        for d in (legs, own)
    )
    return tuple(both)  # type: ignore[return-value]


def inverter_table_nominal(folder: Path) -> dict[str, Any]:
    """Return what is said where the inverter's measured table is part of the nominal model."""
    return figures(diagnose(_with_table()[0], jobs=1).as_json()) | {"lines": []}


def inverter_table_missing(folder: Path) -> dict[str, Any]:
    """Return what is said where it is not."""
    return figures(diagnose(_with_table()[1], jobs=1).as_json()) | {"lines": []}


def odrive(folder: Path) -> dict[str, Any]:
    """Return what `experiments.odrive_cogging` has kept, of the slow turns without compensation."""
    kept = json.loads((RESULTS / "odrive_cogging.json").read_text())
    case = kept["cases"]["slow, without compensation"]
    return {
        "verdict": case["verdict"],
        "effects": case["hypothesis"]["effects"],
        "before": case["before"],
        "after": case["after"],
        "lines": [],
        "date": kept["date"],
        **case["cost"],
    }
