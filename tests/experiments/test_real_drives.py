"""Each script on real drives runs, and writes a figure and a complete record."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from experiments import real_cases
from model.datasets import locate
from model.effects.library import checked

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = {
    "real_dead_time": "moteus_ld",
    "real_cogging": "laas_bldc",
    "real_friction": "laas_bldc",
    "real_iron_loss": "thor_fea",
    "real_skin_effect": "thor_fea",
    "real_harmonics": "thor_fea",
}


def test_every_script_is_here():
    # what they share; diagnoses of minutes, whose record is checked below
    others = {"real_results", "real_cases"}
    assert {p.stem for p in (ROOT / "experiments").glob("real_*.py")} - others == set(SCRIPTS)


@pytest.mark.parametrize("name", SCRIPTS)
def test_kept_record_is_complete(name):
    record = json.loads(
        (ROOT / "experiments" / "results" / f"{name}.json").read_text(encoding="utf-8")
    )
    assert record["data"]["name"] == SCRIPTS[name]
    assert record["date"]
    assert record["limits"]
    assert (ROOT / "experiments" / "results" / f"{name}.png").stat().st_size > 10_000
    for value in record["values"].values():
        assert value["low"] <= value["value"] <= value["high"]
        assert value["unit"]
        assert value["basis"]


def test_every_real_case_is_kept_with_its_date():
    """One row a case, each judged; the page is made of the record alone."""
    kept = json.loads(
        (ROOT / "experiments" / "results" / "real_cases.json").read_text(encoding="utf-8")
    )["cases"]
    assert set(kept) <= set(real_cases.CASES)
    assert len(kept) >= 9
    for name, case in kept.items():
        assert case["date"] >= "2026-11-21", name
        assert case["verdict"] in (
            "explained",
            "ambiguous",
            "unknown",
            "no_gap",
            "refused",
            "angle offset",
        ), name
    page = (ROOT / "experiments" / "results" / "real_cases.md").read_text(encoding="utf-8")
    assert page == real_cases.page(kept)
    assert page.count("**Believe it?**") == len(kept)


def test_what_laas_motion_tells_is_what_the_slow_scan_and_the_accelerations_say():
    """A check of kept results.  Cogging of order 72 and dry friction by the equation of the shaft,
    beside holding currents up against down and beside averages over accelerations: two fits that
    share no code with it.  Inside the intervals of these."""
    results = ROOT / "experiments" / "results"
    said = json.loads((results / "real_cases.json").read_text(encoding="utf-8"))["cases"][
        "laas_motion"
    ]["parameters"]
    scan, runs = (
        json.loads((results / f"real_{name}.json").read_text(encoding="utf-8"))["values"]
        for name in ("cogging", "friction")
    )
    assert said["cogging_torque.order_mech"] == 72
    assert scan["order_72"]["low"] < said["cogging_torque.amplitude"] < scan["order_72"]["high"]
    assert runs["coulomb"]["low"] < said["coulomb_friction.torque"] < runs["coulomb"]["high"]


def test_the_effect_library_takes_the_fitted_skin_effect():
    """4 to 5.6 us lie within its bounds; R_1 tau^2, all that the table's frequencies tell, stands
    beside them."""
    record = json.loads(
        (ROOT / "experiments" / "results" / "real_skin_effect.json").read_text(encoding="utf-8")
    )
    for state in ("20_degC", "70_degC", "120_degC"):
        r_1, tau = (
            record["values"][f"{state}.{p}"]["value"] for p in ("resistance", "time_constant")
        )
        assert checked("skin_effect.resistance", r_1) == r_1
        assert checked("skin_effect.time_constant", tau) == tau
        assert record["checks"][f"{state}.R1_tau2_ohm_s2"] == pytest.approx(r_1 * tau**2, rel=1e-3)


@pytest.fixture(scope="module")
def fresh(tmp_path_factory):
    """Run every script whose data are here, one after the other in a process of its own; return
    where they wrote."""
    folder, here = tmp_path_factory.mktemp("results"), ROOT / "experiments"
    path = os.pathsep.join(map(str, (ROOT, here)))
    each = "import runpy, sys\nfor path in sys.argv[1:]: runpy.run_path(path, run_name='__main__')"
    scripts = [
        str(here / f"{name}.py") for name, data in SCRIPTS.items() if locate(data) is not None
    ]
    around = {**os.environ, "SENSORLESS_RESULTS": str(folder), "PYTHONPATH": path}
    done = subprocess.run(
        [sys.executable, "-c", each, *scripts], env=around, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.parametrize("name", SCRIPTS)
def test_script_repeats_the_kept_values(name, fresh):
    if locate(SCRIPTS[name]) is None:
        pytest.skip(f"data set {SCRIPTS[name]} is not here; set SENSORLESS_DATA")
    found = json.loads((fresh / f"{name}.json").read_text(encoding="utf-8"))["values"]
    kept = json.loads(
        (ROOT / "experiments" / "results" / f"{name}.json").read_text(encoding="utf-8")
    )["values"]
    for key, value in found.items():
        assert value["value"] == pytest.approx(kept[key]["value"], rel=1e-3)
