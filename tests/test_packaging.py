"""What is beside the package for those who install it: a recipe for conda, the versions that name
each other."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest

import sandbox

ROOT = Path(__file__).resolve().parents[1]
CONDA = ROOT / ".ci" / "conda"


@pytest.fixture
def check():
    spec = importlib.util.spec_from_file_location("conda_check", CONDA / "check.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_conda_recipe_says_what_pyproject_says(check):
    assert check.problems() == []


@pytest.mark.parametrize(
    ("line", "wrong", "told"),
    [
        ("    - scipy >=1.13\n", "", "run scipy: recipe None, pyproject.toml >=1.13"),
        (
            "    - scipy >=1.13",
            "    - scipy >=1.12",
            "run scipy: recipe >=1.12, pyproject.toml >=1.13",
        ),
        ("license: MIT", "license: BSD", "license: recipe BSD, pyproject.toml MIT"),
        (
            f'"{sandbox.__version__}"',
            '"0.0.1"',
            f"version: recipe 0.0.1, pyproject.toml {sandbox.__version__}",
        ),
    ],
)
def test_a_recipe_that_says_something_else_is_told(check, monkeypatch, tmp_path, line, wrong, told):
    (tmp_path / "a" / "b").mkdir(parents=True)
    recipe = (CONDA / "recipe.yaml").read_text(encoding="utf-8")
    assert line in recipe
    (tmp_path / "a" / "b" / "recipe.yaml").write_text(recipe.replace(line, wrong), encoding="utf-8")
    (tmp_path / "pyproject.toml").write_text(
        (ROOT / "pyproject.toml").read_text(encoding="utf-8"), encoding="utf-8"
    )
    monkeypatch.setattr(check, "HERE", tmp_path / "a" / "b")
    assert check.problems() == [told]


def test_the_release_is_dated_and_cited():
    version = sandbox.__version__
    assert re.search(
        rf"^## {re.escape(version)}, \d{{4}}-\d\d-\d\d$", (ROOT / "CHANGELOG.md").read_text(), re.M
    )
    assert re.search(rf"^version: {re.escape(version)}$", (ROOT / "CITATION.cff").read_text(), re.M)
