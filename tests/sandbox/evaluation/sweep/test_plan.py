"""Plans of sweeps: which run has which values, what is refused at the door, what a folder's key
hangs on."""

import math
from collections import Counter

import numpy as np
import pytest

from model.drive_files import MOTORS
from model.errors import BadInput
from sandbox.drive.scenario import load_scenario
from sandbox.evaluation.sweep.keys import keys
from sandbox.evaluation.sweep.plan import (
    Draw,
    digest_of,
    label,
    read_sweep,
    scene_of,
    shares_of,
    sweep_of,
    tables_of,
)
from sandbox.evaluation.sweep.sweep import check_size


def test_the_last_key_of_the_grid_runs_fastest():
    plan = sweep_of(
        {
            "run": {"estimator": "ekf"},
            "grid": {
                "belief": ["linear", "saturated"],
                "scenario_factor": {"load": [0.5, 1.0, 1.5]},
            },
            "random": {"points": 4, "draw": {"seed": {"integers": [0, 9]}}},
        }
    )
    assert (plan.cells, plan.points, plan.runs) == (6, 4, 24)  # 2 x 3; 4 times that
    order = [(c["belief"], c["scenario_factor.load"]) for c in map(plan.case, range(6))]
    assert order == [(b, x) for b in ("linear", "saturated") for x in (0.5, 1.0, 1.5)]
    # runs of one point share what is drawn
    assert len({plan.case(n)["seed"] for n in range(6)}) == 1
    assert plan.case(23)["estimator"] == "ekf"
    assert plan.case(0)["motor"] == "ipm_exchanged"


def test_draws_by_their_definitions():
    assert Draw("uniform", 0.9, 1.1).at(0.25) == pytest.approx(0.95)
    assert Draw("log_uniform", 1.0, 100.0).at(0.5) == pytest.approx(10.0)  # the geometric mean
    assert [Draw("integers", 3, 5).at(u) for u in (0.0, 0.5, 0.999)] == [3, 4, 5]
    normal = Draw("normal", 1.0, 0.1)
    assert normal.at(0.5) == pytest.approx(1.0)
    # one sigma; what is cut off moves it by 3e-5
    assert normal.at(0.8413447) == pytest.approx(1.1, abs=1e-4)
    assert normal.at(0.0) == pytest.approx(0.6)  # four sigma


@pytest.mark.parametrize("design", ["sobol", "latin_hypercube"])
def test_designs_fill_every_slice_once(design):
    """16 points of either design have one in each sixteenth of every axis; 16 independent ones
    hardly ever do."""
    shares = shares_of(design, 16, 5, 3)
    assert all(sorted(np.floor(16 * x)) == list(range(16)) for x in shares.T)
    assert np.array_equal(shares, shares_of(design, 16, 5, 3))
    assert not np.array_equal(shares, shares_of(design, 16, 5, 4))
    independent = shares_of("independent", 16, 5, 3)
    assert max(Counter(np.floor(16 * independent[:, 0])).values()) > 1


def test_points_that_are_no_power_of_two_are_the_first_of_one():
    assert np.array_equal(shares_of("sobol", 11, 3, 0), shares_of("sobol", 16, 3, 0)[:11])


BAD = {
    "unknown table 'grids'; did you mean 'grid'": {"grids": {}},
    "unknown key in \\[run\\] 'true_factor.magnet_fluks'; did you mean 'true_factor.magnet_flux'": {
        "run": {"true_factor": {"magnet_fluks": 1.0}}
    },
    "unknown motor 'ipm_exchange'": {"run": {"motor": "ipm_exchange"}},
    "unknown scenario": {"run": {"scenario": "stair"}},
    "unknown estimator 'qnul'": {"grid": {"estimator": ["qnul", "ekf"]}},
    "unknown belief 'lineal'; did you mean 'linear'": {"run": {"belief": "lineal"}},
    "no list of values": {"grid": {"seed": 3}},
    "names a value twice": {"grid": {"seed": [3, 3]}},
    "is not whole": {"run": {"seed": 0.5}},
    "out of range; give a number in \\[0, ": {"run": {"seed": -1}},
    "neither true nor false": {"run": {"closed_loop": 1}},
    "is not a finite number": {"run": {"duration": math.nan}},
    "points = -3 is out of range": {
        "random": {"points": -3, "draw": {"seed": {"integers": [0, 9]}}}
    },
    "draws nothing": {"random": {"points": 3}},
    "unknown random design 'sobel'; did you mean 'sobol'": {"random": {"design": "sobel"}},
    "unknown distribution of seed 'uniforms'": {"random": {"draw": {"seed": {"uniforms": [0, 1]}}}},
    "is no distribution": {"random": {"draw": {"true_factor": {"resistance": 1.1}}}},
    "put in \\[grid\\]": {"random": {"draw": {"belief": {"uniform": [0, 1]}}}},
    "must not be below the first": {
        "random": {"draw": {"true_factor": {"resistance": {"uniform": [1.1, 0.9]}}}}
    },
    "above 0": {"random": {"draw": {"true_factor": {"resistance": {"log_uniform": [0.0, 1.0]}}}}},
    "stands in \\[run\\] and \\[grid\\]": {"run": {"seed": 1}, "grid": {"seed": [1, 2]}},
    "does not exist beside the sweep's file": {"run": {"motor": "mine.toml"}},
    "unknown channel 'eror'; did you mean 'error'": {"traces": {"channels": ["eror"]}},
    "means the \\[\\[segment\\]\\] tables": {"run": {"scenario": "own"}},
    "lacks 'duration'": {"segment": [{"load": 1.0}]},
    "cannot name a file": {"sweep": {"name": "../up"}},
    "more than 50000000 numbers": {
        "random": {
            "points": 10_000_000,
            "draw": {
                "true_factor": {
                    n: {"uniform": [0.9, 1.1]}
                    for n in (
                        "resistance",
                        "magnet_flux",
                        "inductance_d",
                        "inductance_q",
                        "alpha_30",
                        "alpha_12",
                    )
                }
            },
        }
    },
}


@pytest.mark.parametrize("said", BAD)
def test_what_cannot_be_swept_is_one_sentence(said):
    with pytest.raises(BadInput, match=said):
        sweep_of(BAD[said])


def test_a_huge_sweep_says_how_large_it_is():
    plan = sweep_of(
        {"grid": {"seed": list(range(1000)), "duration": [0.001 * k for k in range(1, 1001)]}}
    )
    with pytest.raises(BadInput, match=r"1000000 runs, about 150 MB.*200000; add --yes"):
        check_size(plan, yes=False)
    check_size(plan, yes=True)


def test_a_scenarios_file_is_no_sweep(tmp_path):
    """One run is what it would be; with a table of a sweep it is one."""
    path = tmp_path / "s.toml"
    path.write_text("[scenario]\nstart_up = false\n[[segment]]\nduration = 0.1\n")
    with pytest.raises(
        BadInput, match=r"s.toml is a scenario, which is one run; add a table \[run\], \[grid\]"
    ):
        read_sweep(path)
    path.write_text("[run]\nseed = 1\n" + path.read_text())
    assert read_sweep(path).runs == 1


def test_a_folder_hangs_on_the_content_of_files_not_on_their_place(tmp_path):
    text = "[run]\nscenario = 'mine.toml'\n[grid]\nbelief = ['linear', 'saturated']\n"
    found = []
    for place, load in (("one", 1.0), ("two", 1.0), ("three", 0.5)):
        folder = tmp_path / place
        folder.mkdir()
        (folder / "mine.toml").write_text(f"[[segment]]\nduration = 0.1\nload = {load}\n")
        (folder / "sweep.toml").write_text(text)
        plan = read_sweep(folder / "sweep.toml")
        found.append(digest_of(plan))
        assert label("scenario", plan.fixed["scenario"]) == "mine.toml"
    assert found[0] == found[1] != found[2]


def test_a_folder_hangs_on_files_that_a_named_file_names(tmp_path):
    """A long path is one, too; beside them stands a text that no file can be called."""
    motor, place = MOTORS / "ipm_exchanged.toml", "/".join(["a" * 100] * 3) + "/map.csv"
    (tmp_path / "mine.toml").write_text(
        f'{motor.read_text()}note = "{place}"\nwhy = "{"漢" * 340}"\n'
    )
    (tmp_path / place).parent.mkdir(parents=True)
    found = []
    for content in ("1", "2"):
        (tmp_path / place).write_text(content)
        found.append(digest_of(sweep_of({"run": {"motor": "mine.toml"}}, folder=tmp_path)))
    assert found[0] != found[1]


def test_a_scenario_goes_through_tables_unchanged():
    own = load_scenario("speed_steps")
    plan = sweep_of(tables_of(own))
    assert scene_of(plan) == own


def test_every_key_says_what_it_is():
    for name, key in keys().items():
        assert key.what, name
        assert key.kind in (str, bool, int, float), name
