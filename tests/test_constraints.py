"""Lists of library versions: the newest holds all that the project needs, the oldest is its lower
bounds; what a wheel holds (`.ci/supply wheel` builds, installs and uses one)."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.version import Version

ROOT = Path(__file__).parents[1]
WHOLE = tomllib.loads((ROOT / "pyproject.toml").read_text())
PROJECT = WHOLE["project"]


def listed(name):
    lines = (ROOT / ".ci" / name).read_text().splitlines()
    found = dict(line.split("==") for line in lines if not line.startswith("#"))
    # no addresses, no options
    assert all(re.fullmatch(r"[a-z0-9-]+", package) for package in found)
    return {package: Version(version) for package, version in found.items()}


def needed(*extras):
    more = [line for extra in extras for line in PROJECT["optional-dependencies"][extra]]
    return [
        r for r in map(Requirement, PROJECT["dependencies"] + more) if r.name != PROJECT["name"]
    ]


def test_the_newest_list_holds_every_dependency():
    found = listed("constraints.txt")
    for requirement in needed(*PROJECT["optional-dependencies"]):
        assert requirement.specifier.contains(found[requirement.name]), requirement


def test_the_oldest_list_is_the_lower_bounds():
    found = listed("constraints-oldest.txt")
    needs = needed("test")
    assert set(found) == {r.name for r in needs}
    for requirement in needs:
        (bound,) = [Version(s.version) for s in requirement.specifier if s.operator == ">="]
        assert found[requirement.name] == bound, requirement


def test_a_wheel_holds_only_package_data():
    """Whatever lies in the packages is code or data that code reads, or left out of the wheel by
    name."""
    target = WHOLE["tool"]["hatch"]["build"]["targets"]["wheel"]
    rule = re.search(r"DATA = (.*)", (ROOT / ".ci" / "wheel_content.py").read_text())
    left_out = {pattern.removeprefix("*") for pattern in target["exclude"]}
    data = {s.strip(' "') for s in rule[1].strip("{}").split(",")}
    assert target["packages"] == ["model", "estimators", "sandbox"]
    assert not data & left_out
    files = [
        p for package in target["packages"] for p in (ROOT / package).rglob("*") if p.is_file()
    ]
    strange = [p for p in files if p.suffix not in data | left_out and "__pycache__" not in p.parts]
    assert strange == []
    assert len(files) > 300
