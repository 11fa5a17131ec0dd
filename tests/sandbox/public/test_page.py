"""The page of public Python as a whole: lazy, documented, every name tested, a hidden package named."""

from __future__ import annotations

import doctest
import inspect
from importlib import import_module

import pytest

import sandbox
from tests.sandbox.public.naming import names_tested, python

FUNCTIONS = [name for name in sandbox.__all__ if inspect.isfunction(getattr(sandbox, name))]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_has_a_numpydoc_text(name):
    function = getattr(sandbox, name)
    text = inspect.getdoc(function)
    parameters = inspect.signature(function).parameters
    if parameters:
        assert "Parameters\n----------" in text
        assert "Raises\n------" in text
    if inspect.signature(function).return_annotation != "None":
        assert "Returns\n-------" in text
    assert "Examples\n--------\n>>> " in text
    assert ">>> from sandbox import" in text
    for parameter in parameters:
        assert f"\n{parameter} : " in text, parameter


@pytest.mark.parametrize("name", FUNCTIONS)
def test_examples_run(name):
    function = getattr(sandbox, name)
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    for example in doctest.DocTestFinder(recurse=False).find(function, name, module=False):
        runner.run(example)
    assert runner.failures == 0
    assert runner.tries > 0


def test_a_module_of_the_same_name_leaves_the_function():
    """The rooms `sandbox.replay` and `sandbox.sweep` bear names of the page's functions."""
    for name in ("replay", "sweep"):
        import_module(f"sandbox.{name}")
        assert inspect.isfunction(getattr(sandbox, name))


def test_importing_the_page_is_light(tmp_path):
    heavy = ("numba", "rerun", "matplotlib", "control", "scipy", "rich", "numpy", "pyarrow", "model")
    code = f"import sys, sandbox; print(set({heavy}) & set(sys.modules))"
    assert python(code, tmp_path).stdout.strip() == "set()"


@pytest.mark.parametrize(
    ("place", "name"),
    [("model.py", "model"), ("estimators.py", "estimators"), ("model/__init__.py", "model")],
)
def test_a_users_own_module_of_our_name_is_named(place, name, tmp_path):
    file = tmp_path / place
    file.parent.mkdir(exist_ok=True)
    file.write_text("x = 1\n")
    for code in ("from sandbox import simulate", f"import {name}\nfrom sandbox import simulate"):
        done = python(code, tmp_path)
        said = done.stderr.strip().splitlines()[-1]
        assert done.returncode == 1
        assert said.startswith(f"ImportError: '{file}' hides the package '{name}'")
        assert f"rename that file or folder, for example to my_{name}" in said


def test_a_folder_without_package_hides_nothing(tmp_path):
    (tmp_path / "model").mkdir()
    done = python("from sandbox import list_scenarios; print(len(list_scenarios()))", tmp_path)
    assert done.stdout.strip() == "3", done.stderr


def test_every_name_is_there_and_has_a_test():
    assert set(sandbox.__all__) == set(sandbox._HOME) == names_tested()
    assert len(sandbox.__all__) == len(set(sandbox.__all__))
    for name in sandbox.__all__:
        assert getattr(sandbox, name).__name__ == name
        assert inspect.getdoc(getattr(sandbox, name))
    with pytest.raises(AttributeError, match="simulat"):
        sandbox.simulat  # noqa: B018
