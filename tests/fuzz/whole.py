"""Whole files for every door, made from generated data: what is damaged must have been let in
before."""

from __future__ import annotations

import hashlib
import io
import json
from pathlib import Path

import numpy as np

from model.drive_files import MOTORS, load_drive
from model.effect_files import effects_of
from model.energy import flux_from_current
from model.fluxmap import FluxMap, write_map
from sandbox.drive.design import design
from sandbox.drive.scenario import SCENARIOS, load_scenario
from sandbox.evaluation.sweep import store
from sandbox.evaluation.sweep.blocks import crashed, tasks_of
from sandbox.evaluation.sweep.plan import read_sweep
from sandbox.evaluation.sweep.sweep import check_size
from sandbox.output.files import plain, write_json
from sandbox.output.provenance import made_by
from sandbox.public.campaigns.diagnosed import earlier_answer
from sandbox.public.motor import audit
from sandbox.public.verifying import verify
from sandbox.recordings.campaign import read_folder
from sandbox.recordings.importing import read_recordings
from sandbox.recordings.writing import write_campaign
from sandbox.replay.identification.locked_test import LockedBench, paper_campaign
from sandbox.withheld.scoring.blind import score, standard
from sandbox.withheld.scoring.running import Check
from sandbox.withheld.scoring.tables_of_rows import Scores, table
from tests.fuzz.arrays import damaged_arrays
from tests.fuzz.doors import Door
from tests.fuzz.kept import KEPT_DOORS
from tests.fuzz.logs import LOG_DOORS
from tests.fuzz.mutations import damaged_bytes, damaged_json, damaged_lines, damaged_toml
from tests.fuzz.sizes import claimed_npz, grown_json, grown_toml, long_csv, long_mat, long_parquet

COLUMNS = """
[columns]
t = {column = "Time", unit = "ms"}
u_alpha = "Ua"
u_beta = {column = "Ub", scale = 1.0, offset = 0.0}
i_a = {column = "Ia", unit = "mA"}
i_b = {column = "Ib", unit = "mA"}
i_c = {column = "Ic", unit = "mA"}
theta = {column = "Pos", unit = "deg", mechanical = true}
u_dc = {column = "Link", unit = "kV"}
"""
MAPPED = """
[motor]
pole_pairs = 6
resistance = 12.15
inertia = 0.0011
rated_current = 1.2
rated_torque = 1.06
rated_speed_rpm = 1800.0
[flux_map]
file = "mine.{}"
magnet = "d"
cells = [4, 4]
smooth = 1e-3
"""
REPORT = {
    "campaign": "w000",
    "verdict": "ambiguous",
    "gap": {"before": 3.0, "after": 1.0, "closed": 0.9},
    "where": [{"subsystem": "inverter", "share": 1.0}],
    "hypotheses": [
        {
            "effects": ["dead_time"],
            "probability": 0.6,
            "parameters": {
                "dead_time.time": {"value": 2e-6, "ci95": [1.9e-6, 2.1e-6], "unit": "s"}
            },
        },
        {"effects": ["device_drop"], "probability": 0.4, "parameters": {}},
    ],
    "ambiguity_set": [["dead_time"], ["device_drop"]],
    "cost": {"simulations": 100, "seconds": 2.0},
    "code": "abc",
    "next_recording": {"entry": "locked_low_current", "seconds": 0.5, "power": 0.9},
}
TRUTH = {
    "schema": 1,
    "seed": 1,
    "kind": "mixed",
    "style": "scored",
    "outside": [],
    "campaigns": {
        "w000": {
            "effects": ["dead_time"],
            "kind": "one",
            "family": "ipm",
            "sizes": [1.0],
            "parameters": {"dead_time.time": 2e-6},
            "outside_subsystem": None,
        }
    },
}
REPORTS = ("diagnoses/w000.json", "diagnoses/resolved/w000.json")


def small_campaign():
    """Return a campaign of three staircases at locked rotor."""
    return paper_campaign(
        load_drive("ipm_exchanged"),
        np.linspace(-1.92, 1.92, 3),
        40,
        LockedBench(theta=0.7, noise=0.002, resolution=0.0024),
    )


def make_campaign(folder):
    """Write it in the format."""
    for path in write_campaign(folder / "aside", small_campaign()).iterdir():
        path.rename(folder / path.name)
    (folder / "aside").rmdir()


def make_foreign(suffix):
    """Return what writes it as tables of another program, with a column map."""

    def make(folder):
        """Write tables and map."""
        make_campaign(folder)
        text = (folder / "campaign.toml").read_text()
        pairs = load_drive("ipm_exchanged").motor.pole_pairs
        for r in read_folder(folder).recordings:
            columns = {
                "Time": 1e3 * r.t,
                "Ua": r.u_alpha,
                "Ub": r.u_beta,
                "Ia": 1e3 * r.i_a,
                "Ib": 1e3 * r.i_b,
                "Ic": 1e3 * r.i_c,
                "Pos": np.degrees(r.theta / pairs),
                "Link": 1e-3 * r.u_dc,
            }
            path = folder / r.file.replace(".parquet", suffix)
            if suffix == ".csv":
                rows = zip(*columns.values(), strict=True)
                lines = [",".join(columns), *(",".join(f"{x:.17g}" for x in row) for row in rows)]
                path.write_text("\n".join(lines))
            elif suffix == ".npz":
                np.savez(path, **columns)
            else:
                from scipy.io import savemat

                savemat(path, columns)
            (folder / r.file).unlink()
        (folder / "campaign.toml").unlink()
        (folder / "columns.toml").write_text(COLUMNS + text.replace(".parquet", suffix))

    return make


def make_map(suffix):
    """Return what writes a motor with a flux map."""

    def make(folder):
        """Write map and motor."""
        motor, i = load_drive("ipm_exchanged").motor, np.linspace(-2.4, 2.4, 7)
        d, q = flux_from_current(motor.energy, *np.meshgrid(i, i, indexing="ij"))
        write_map(folder / f"mine.{suffix}", FluxMap("mine", i, i, d + motor.magnet_flux, q))
        (folder / "mine.toml").write_text(MAPPED.format(suffix))

    return make


def make_motor(folder):
    """Write a motor."""
    (folder / "m.toml").write_text((MOTORS / "ipm_exchanged.toml").read_text())


def make_inverter(folder):
    """Write a motor with a table of its inverter beside it."""
    text = (MOTORS / "ipm_exchanged.toml").read_text()
    (folder / "m.toml").write_text(
        text.replace("[drive]\n", '[drive]\ninverter_table = "legs.csv"\n')
    )
    (folder / "legs.csv").write_text(
        "current,error\n-2.0,-5.5\n-0.5,-4\n0,0.1\n0.5,4\n1.0,5\n2.5,6\n"
    )


def make_effects(folder):
    """Write a file of effects."""
    text = (
        "[effects]\ndead_time.time = 2e-6\ncogging_torque.2.order_mech = "
        "12\n[bench]\nsoft_current = 0.02\n"
    )
    (folder / "e.toml").write_text(
        text + '[angles]\n"a.parquet" = 1e-4\n[residual]\n"a.parquet" = 0.98\n'
    )


def make_scenario(folder):
    """Write a scenario."""
    (folder / "s.toml").write_text((SCENARIOS / "staircase.toml").read_text())


def make_sweep(folder):
    """Write a sweep's file."""
    (folder / "s.toml").write_text(
        (Path(__file__).parents[2] / "experiments" / "yield_curve.toml").read_text()
    )


def make_swept(folder):
    """Write the folder of a sweep with two finished blocks (whose runs crashed: nothing is
    simulated here)."""
    make_sweep(folder)
    sweep = read_sweep(folder / "s.toml")
    kept = store.open_folder(sweep, folder)
    store.begin(kept)
    for task in tasks_of(sweep)[:2]:
        store.add(kept, crashed(task._replace(stop=task.start + 3)))


def read_swept(folder):
    """Open the folder as a sweep that goes on does."""
    store.open_folder(read_sweep(folder / "s.toml"), folder)
    return store.read_table(folder)


def make_result(folder):
    """Write the result of an audit, without its figure."""
    found = audit("ipm")
    folder.mkdir(exist_ok=True)
    write_json(folder, "audit", found.as_json(), made=made_by(found.call))


def read_and_size(folder):
    """Read a sweep's file as the command does before anything runs."""
    check_size(read_sweep(folder / "s.toml"), False)


def make_check(folder):
    """Write a withheld check of one diagnosed campaign; its recordings are not read any more."""
    (folder / "campaigns" / "w000").mkdir(parents=True)
    (folder / "diagnoses" / "resolved").mkdir(parents=True)
    for place in ("diagnoses", "diagnoses/resolved"):
        (folder / place / "w000.json").write_text(json.dumps(REPORT))
    (folder / "truth.sealed").write_text(json.dumps(TRUTH))


def read_check(folder):
    """Score the check; the seal's hash is that of whatever the seal holds: damage is to be met
    behind it."""
    (folder / "SHA256").write_text(
        hashlib.sha256((folder / "truth.sealed").read_bytes()).hexdigest()
    )
    try:
        scored: Scores = score(Check(folder, standard), finished=True)
    finally:
        (folder / "SHA256").unlink()
    json.dumps(plain(scored.as_json()), allow_nan=False)
    return table([scored])


def damaged_csv(content, chance):
    """Return a table with cells replaced or bytes damaged."""
    if chance.random() < 0.5:
        return damaged_bytes(content, chance)
    rows = [line.split(b",") for line in content.splitlines()]
    for _ in range(chance.choice((1, 1, 3))):
        row = chance.choice((rows[0], chance.choice(rows)))
        k = chance.randrange(len(row) or 1)
        cell = chance.choice(
            (
                b"",
                b"nan",
                b"inf",
                b"1e400",
                b"x",
                b'"',
                b"0",
                b"-5",
                b"1;2",
                b"\xff",
                b"1e300",
                b"\x1b[2J",
            )
        )
        row[k : k + chance.randrange(2)] = [cell] * chance.randrange(3)
    return b"\n".join(b",".join(row) for row in rows)


@np.errstate(all="ignore")
def damaged_table(content, chance):
    """Return a Parquet table with columns of other kinds, or its bytes damaged."""
    if chance.random() < 0.5:
        return damaged_bytes(content, chance)
    import pyarrow
    from pyarrow import parquet

    columns = {
        k: v.to_numpy().copy()
        for k, v in zip(*_columns(parquet.read_table(io.BytesIO(content))), strict=True)
    }
    for _ in range(chance.choice((1, 1, 2))):
        name = chance.choice(list(columns))
        n = len(columns[name])
        odd = not isinstance(columns[name], np.ndarray) or columns[name].dtype.kind != "f"
        x = np.linspace(0.0, 1.0, n) if odd else columns[name]
        changed = x.copy()
        changed[chance.randrange(n)] = chance.choice((np.nan, np.inf, 1e308, -1e308, 0.0, 1e5))
        columns[name] = chance.choice(
            (
                changed,
                changed,
                1e3 * x,
                -x,
                np.zeros(n),
                x.astype(str),
                [None] * n,
                [[1.0]] * n,
                [{"a": 1}] * n,
                x > 0,
                x.astype("datetime64[s]"),
                [10**18] * n,
                np.full(n, 1e300),
                x[::-1].copy(),
                ["\x1b[2J"] * n,
                x.astype(np.float32),
            )
        )
        if chance.random() < 0.2:
            columns[chance.choice(("x", "\x1b[2J", "i_d", "", "torque"))] = columns.pop(name)
    keep = 0 if chance.random() < 0.05 else chance.choice((1, 2, 10**9))
    body = io.BytesIO()
    parquet.write_table(pyarrow.table({k: list(v)[:keep] for k, v in columns.items()}), body)
    return body.getvalue()


def _columns(found):
    return found.column_names, [found[n] for n in found.column_names]


def of_text(change):
    """Return damage of a text as damage of bytes."""
    return lambda content, chance: change(content.decode(), chance)


def read_both(folder):
    """Read a campaign by either door."""
    read_folder(folder)
    read_recordings(folder)


def read_foreign(folder):
    """Read tables of another program."""
    read_recordings(folder, folder / "columns.toml")


def read_mapped(folder):
    """Read a motor with a flux map, fitting it."""
    return load_drive(folder / "mine.toml")


DOORS = (
    Door("campaign", make_campaign, ("campaign.toml",), of_text(damaged_toml), read_both),
    Door("parquet", make_campaign, ("locked_d.parquet",), damaged_table, read_both),
    Door("csv", make_foreign(".csv"), ("locked_d.csv",), damaged_csv, read_foreign),
    Door("mat", make_foreign(".mat"), ("locked_d.mat",), damaged_bytes, read_foreign),
    Door("columns", make_foreign(".csv"), ("columns.toml",), of_text(damaged_toml), read_foreign),
    Door("map_npz", make_map("npz"), ("mine.npz",), damaged_arrays("npz"), read_mapped),
    Door("map_mat", make_map("mat"), ("mine.mat",), damaged_arrays("mat"), read_mapped),
    Door("map_csv", make_map("csv"), ("mine.csv",), damaged_csv, read_mapped),
    Door("map_motor", make_map("csv"), ("mine.toml",), of_text(damaged_toml), read_mapped),
    Door(
        "motor",
        make_motor,
        ("m.toml",),
        of_text(damaged_toml),
        lambda folder: load_drive(folder / "m.toml"),
    ),
    Door(
        "design",
        make_motor,
        ("m.toml",),
        of_text(damaged_toml),
        lambda f: design(load_drive(f / "m.toml")),
    ),
    Door(
        "inverter",
        make_inverter,
        ("legs.csv",),
        damaged_csv,
        lambda folder: load_drive(folder / "m.toml"),
    ),
    Door(
        "effects",
        make_effects,
        ("e.toml",),
        of_text(damaged_toml),
        lambda folder: effects_of(folder / "e.toml"),
    ),
    Door(
        "earlier",
        make_check,
        REPORTS[:1],
        of_text(damaged_json),
        lambda f: earlier_answer(f / REPORTS[0]),
    ),
    *LOG_DOORS,
    Door(
        "scenario",
        make_scenario,
        ("s.toml",),
        of_text(damaged_toml),
        lambda f: load_scenario(f / "s.toml"),
    ),
    Door("sweep", make_sweep, ("s.toml",), of_text(damaged_toml), read_and_size),
    Door("swept", make_swept, ("journal.jsonl",), of_text(damaged_lines), read_swept),
    Door("result", make_result, ("audit.json",), of_text(damaged_json), verify),
    *KEPT_DOORS,
    Door("report", make_check, REPORTS, of_text(damaged_json), read_check),
    Door("seal", make_check, ("truth.sealed",), of_text(damaged_json), read_check),
    Door("large_campaign", make_campaign, ("campaign.toml",), grown_toml, read_both),
    Door("large_parquet", make_campaign, ("locked_d.parquet",), long_parquet, read_both),
    Door("large_csv", make_foreign(".csv"), ("locked_d.csv",), long_csv, read_foreign),
    Door("large_mat", make_foreign(".mat"), ("locked_d.mat",), long_mat, read_foreign),
    Door("large_npz", make_foreign(".npz"), ("locked_d.npz",), claimed_npz, read_foreign),
    Door("large_columns", make_foreign(".csv"), ("columns.toml",), grown_toml, read_foreign),
    Door("large_map_npz", make_map("npz"), ("mine.npz",), claimed_npz, read_mapped),
    Door("large_map_mat", make_map("mat"), ("mine.mat",), long_mat, read_mapped),
    Door("large_map_csv", make_map("csv"), ("mine.csv",), long_csv, read_mapped),
    Door(
        "large_motor",
        make_motor,
        ("m.toml",),
        grown_toml,
        lambda folder: load_drive(folder / "m.toml"),
    ),
    Door(
        "large_effects",
        make_effects,
        ("e.toml",),
        grown_toml,
        lambda folder: effects_of(folder / "e.toml"),
    ),
    Door(
        "large_scenario",
        make_scenario,
        ("s.toml",),
        grown_toml,
        lambda f: load_scenario(f / "s.toml"),
    ),
    Door("large_sweep", make_sweep, ("s.toml",), grown_toml, read_and_size),
    Door("large_result", make_result, ("audit.json",), grown_json, verify),
    Door("large_report", make_check, REPORTS, grown_json, read_check),
)
COSTLY = {
    "mcap": 0.5,
    "design": 0.02,
    "result": 0.1,
    "map_npz": 0.5,
    "map_mat": 0.5,
    **dict.fromkeys((door.name for door in KEPT_DOORS if door.name != "call"), 0.1),
    "exchanged": 0.05,
    "forged_design": 0.05,
    **dict.fromkeys((door.name for door in DOORS if door.name.startswith("large_")), 0.1),
}  # share of the inputs of a usual door
