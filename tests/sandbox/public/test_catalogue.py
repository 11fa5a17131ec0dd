"""What there is, listed: nothing is compiled for it."""

from __future__ import annotations

import pytest

import sandbox
from sandbox.cli import main
from tests.sandbox.public.naming import of, python


@of(
    "list_motors",
    "list_scenarios",
    "list_estimators",
    "list_effects",
    "list_datasets",
    "list_tests",
)
@pytest.mark.parametrize(
    "kind", ["estimators", "effects", "motors", "scenarios", "datasets", "tests"]
)
def test_lists_compile_nothing(kind, tmp_path):
    """With an empty cache, too; estimators and tests do not even bring in numba."""
    code = f"import sys\nfrom sandbox.cli import main\nassert main(['list', '{kind}']) == 0\n"
    code += "assert 'numba' not in sys.modules\n" * (kind in ("estimators", "tests"))
    done = python(code, tmp_path, SENSORLESS_CACHE=str(tmp_path / "cache"))
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert not list((tmp_path / "cache").rglob("*.nb?"))  # numba's files of compiled code
    listed = getattr(sandbox, f"list_{kind}")()
    assert list(listed) == [line.split()[0] for line in done.stdout.splitlines()]


WRONG_NAMES = {
    "motor": ["simulate", "--motor", "nosuch"],
    "scenario": ["simulate", "--scenario", "nosuch"],
    "estimator": ["simulate", "--estimator", "nosuch"],
    "file": ["compare", "--estimator", "nosuch.py"],
    "effect": ["compare", "--effects", "nosuch.time=1"],
    "motor to compare": ["compare", "--motor", "nosuch"],
    "motor of the protocol": ["protocol", "--motors", "nosuch"],
    "estimator of the protocol": ["protocol", "--estimators", "nosuch"],
    "test": ["protocol", "--tests", "nosuch"],
}


def test_wrong_names_are_refused_before_anything_is_compiled(tmp_path):
    """One process for all of them, its cache empty; a mapping's effects, which no command reads, at
    the end."""
    code = f"""
from sandbox import BadInput, compare
from sandbox.cli import main
for call in {list(WRONG_NAMES.values())}:
    assert main(call) == 2, call
try:
    compare(effects={{"nosuch.time": 1.0}})
except BadInput as error:
    assert "nosuch.time" in str(error)
else:
    raise AssertionError
"""
    done = python(code, tmp_path, SENSORLESS_CACHE=str(tmp_path / "cache"))
    assert done.returncode == 0, done.stderr
    said = done.stderr.splitlines()
    assert len(said) == len(WRONG_NAMES)
    assert all("nosuch" in line for line in said)
    assert not list((tmp_path / "cache").rglob("*.nb?"))


def test_listed_estimators_say_what_their_objects_say():
    assert sandbox.list_estimators() == {
        name: sandbox.load_estimator(name).summary for name in sandbox.list_estimators()
    }


def test_listed_tests_are_those_of_the_protocol():
    from sandbox.evaluation.protocol import TESTS

    assert list(sandbox.list_tests()) == list(TESTS)


def test_a_motor_and_a_scenario_have_cards(capsys):
    assert main(["list", "motors", "ipm_exchanged"]) == 0
    assert "magnet_flux           0.0981 Wb" in capsys.readouterr().out
    # its map is a data set, which is not asked for
    assert main(["list", "motors", "thor_fea"]) == 0
    assert "data set 'thor_fea'" in capsys.readouterr().out
    assert main(["list", "scenarios", "creep_reversal"]) == 0
    assert "2.5 s, load 150 %, speed 0.2 % of rated" in " ".join(capsys.readouterr().out.split())
    assert main(["list", "presets", "vesc"]) == 2
    assert "'presets' have no cards" in capsys.readouterr().err


def test_an_unknown_option_is_refused_in_its_command_s_name(capsys):
    assert main(["bench", "--foo"]) == 2
    assert (
        capsys.readouterr().err
        == "sensorless bench: unknown option '--foo'; see `sensorless bench --help`\n"
    )


def test_limits_given_in_the_call_are_not_said_to_stand_in_a_file():
    with pytest.raises(sandbox.BadInput, match=r"^current = -1.0 is out of range"):
        sandbox.plan(current=-1.0)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: sandbox.simulate(duration="1 s"), "duration = '1 s' is no number"),
        (lambda: sandbox.audit(radius="2"), "radius = '2' is no number"),
        (lambda: sandbox.maps(points="5"), "points = '5' is no whole number"),
        (lambda: sandbox.plan(jobs=None), "jobs = None is no whole number"),
        (lambda: sandbox.maps(points=True), "points = True is no whole number"),
    ],
)
def test_an_argument_that_should_be_a_number_is_refused(call, said):
    with pytest.raises(sandbox.BadInput, match=said):
        call()
