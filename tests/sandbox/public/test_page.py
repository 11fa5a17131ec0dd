"""The page of public Python as a whole: lazy, documented, every name tested, a user's own
`model.py` beside ours."""

from __future__ import annotations

import ast
import doctest
import inspect
import re
from importlib import import_module
from pathlib import Path

import pytest

import sandbox
from model.parameters import Motor
from sandbox.public.page import HOME
from tests.sandbox.public.naming import ROOT, names_tested, python

FUNCTIONS = [name for name in sandbox.__all__ if inspect.isfunction(getattr(sandbox, name))]
ERRORS = ("BadInput", "PhysicsError")
OBJECTS = [
    *(getattr(sandbox, name) for name in sandbox.__all__ if name not in (*FUNCTIONS, *ERRORS)),
    Motor,
]


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


@pytest.mark.parametrize("kind", OBJECTS, ids=lambda kind: kind.__name__)
def test_every_object_has_a_numpydoc_text(kind):
    """Every field, in order, with its default, and the unit and range that it is declared and
    checked with."""
    text = inspect.getdoc(kind)
    assert "Examples\n--------\n" in text
    assert ">>> from sandbox import" in text
    head, *listed = re.split(
        r"^([\w, ]+) : (.+)$", text.partition("Parameters\n----------\n")[2], flags=re.M
    )
    assert head == ""
    told = [
        (name, of, means)
        for names, of, means in zip(listed[::3], listed[1::3], listed[2::3], strict=True)
        for name in names.split(", ")
    ]
    parameters = inspect.signature(kind).parameters
    assert [name for name, _, _ in told] == list(parameters)
    declared = getattr(kind, "__dataclass_fields__", {})
    for name, of, means in told:
        usual, own = parameters[name].default, declared[name].metadata if name in declared else {}
        if usual is None:
            assert of.endswith(", optional"), name
        else:
            assert of.partition("default ")[2] == (
                "" if usual is inspect.Parameter.empty else repr(usual)
            ), name
        if own:
            assert " ".join(means.split()).startswith(
                f"{own['unit']}, {own['low']:g} to {own['high']:g}:".lstrip(", ")
            )
    if declared and kind is not sandbox.Estimator:
        assert "Raises\n------" in text


@pytest.mark.parametrize("name", [*FUNCTIONS, *(kind.__name__ for kind in OBJECTS)])
def test_examples_run(name):
    function = Motor if name == "Motor" else getattr(sandbox, name)
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    for example in doctest.DocTestFinder(recurse=False).find(
        function, name, module=False, globs={}
    ):
        runner.run(example)
    assert runner.failures == 0
    assert runner.tries > 0


def test_a_module_of_the_same_name_leaves_the_function():
    """The room `sandbox.replay` bears the name of one of the page's functions."""
    import_module("sandbox.replay")
    assert inspect.isfunction(sandbox.replay)


def test_importing_the_page_is_light(tmp_path):
    heavy = (
        "numba",
        "rerun",
        "matplotlib",
        "control",
        "scipy",
        "rich",
        "numpy",
        "pyarrow",
        "model",
    )
    code = f"import sys, sandbox; print(set({heavy}) & set(sys.modules))"
    assert python(code, tmp_path).stdout.strip() == "set()"


MINE = """
print("own code runs")
from sandbox import list_motors

energy, registry, kept = "energy of mine", "registry of mine", len(list_motors()) > 2


class Net:
    pass
"""
BESIDE = """
from sandbox import list_scenarios, load_estimator, load_motor

print(load_motor("ipm").motor.name, load_estimator("qnull").name)
import {name}

print("so far ours")
print({name}.energy, "|", {name}.registry, "|", {name}.kept)
from {name} import Net
from {name}.{ours} import {what}

print(Net.__module__, {what}.__module__, {name}.{ours})
import pickle

pickle.loads(pickle.dumps(Net()))
try:
    {name}.nothing
except AttributeError as error:
    print(error)
"""


OURS = {"model": ("energy", "flux_from_current"), "estimators": ("registry", "load_estimator")}


@pytest.mark.parametrize("first", ["", *OURS])
def test_a_users_own_modules_of_our_names_are_there_beside_ours(first, tmp_path):
    """Theirs runs when it is asked for, once, keeps its names, and may use the page itself; ours
    stay ours."""
    code, said = (f"import {first}\n", ["own code runs"]) if first else ("", [])
    for name, (ours, what) in OURS.items():
        file = tmp_path / f"{name}.py"
        file.write_text(MINE)
        code += BESIDE.format(name=name, ours=ours, what=what)
        said += ["ipm qnull", "so far ours"]
        said += ["own code runs"] * (name != first)
        said += [
            "energy of mine | registry of mine | True",
            f"{name} {name}.{ours} {ours} of mine",
            f"module '{name}' ('{file}') has no attribute 'nothing'",
        ]
    done = python(code, tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == said


def test_a_script_of_our_name_runs_once(tmp_path):
    """`python model.py` is a program, which our code must not run again."""
    done = python(
        "from sandbox import load_motor\nprint(load_motor('ipm').motor.name)\n",
        tmp_path,
        "model.py",
    )
    assert done.stdout == "ipm\n", done.stderr


def test_a_users_file_that_fails_says_why_and_leaves_ours(tmp_path):
    (tmp_path / "model.py").write_text("x = 1 / 0\n")
    code = (
        "from sandbox import load_motor\ntry:\n    from model import x\nexcept "
        "ZeroDivisionError as e:\n    print(e)\n"
    )
    done = python(code + "print(load_motor('ipm').motor.name)", tmp_path)
    assert done.stdout.splitlines() == ["division by zero", "ipm"], done.stderr


ATTACKS = """
import importlib
import sys
from concurrent.futures import ThreadPoolExecutor

import sandbox
import model

print(model.__version__, importlib.reload(model).x)
del sys.modules["model"]  # as tools do that load modules again
print(sandbox.load_motor("ipm").motor.name)
import model

with ThreadPoolExecutor(4) as pool:
    print(*pool.map(lambda _: model.x, range(4)))
"""


def test_a_users_module_may_be_loaded_again_forgotten_and_read_from_threads(tmp_path):
    (tmp_path / "model.py").write_text(
        "import time\nprint('runs')\ntime.sleep(0.1)\n__version__, x = '1.2', 3\n"
    )
    done = python(ATTACKS, tmp_path)
    assert done.stdout.splitlines() == ["runs", "runs", "1.2 3", "ipm", "runs", "3 3 3 3"], (
        done.stderr
    )


def test_a_users_module_may_be_collected_by_pytest(tmp_path):
    """Its loader is pytest's own there."""
    text = (
        "from sandbox import load_motor\n\n\ndef test_it():\n    assert "
        "load_motor('ipm').motor.name == 'ipm'\n"
    )
    (tmp_path / "model.py").write_text(text)
    done = python(
        "import pytest, sys\nsys.exit(pytest.main(['-q', '-p', 'no:cacheprovider', 'model.py']))",
        tmp_path,
    )
    assert done.returncode == 0, done.stdout


PACKAGE = {
    "__init__.py": (
        "print('package runs')\nfrom .net import Net\nfrom sandbox import "
        "list_motors\nenergy = 'of mine'\n"
    ),
    "net.py": "print('net runs')\nfrom sandbox import Scenario\n\n\nclass Net:\n    pass\n",
    "deep/__init__.py": "",
    "deep/layer.py": "from ..net import Net\nfrom sandbox import simulate\n",
    "weights.csv": "1,2\n",
}
OF_PACKAGE = """
{first}
from sandbox import load_motor

print(load_motor("ipm").motor.name)
from model.{part} import Net

print(Net.__module__)
import model
import model.deep.layer
from model.errors import BadInput

print(model.energy, model.net.Net is model.deep.layer.Net is model.Net, BadInput.__module__)
from importlib.resources import files

print(files(model).joinpath("weights.csv").read_text().strip())
"""


def users_package(folder, files):
    """Write a package of a user's own named `model`; return its folder."""
    for name, text in files.items():
        file = folder / "model" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return folder / "model"


@pytest.mark.parametrize(
    ("first", "part"), [("", "net"), ("", "deep.layer"), ("import model", "net")]
)
def test_a_users_package_of_our_name_is_there_beside_ours(first, part, tmp_path):
    """Theirs runs once, before its first submodule as Python does, keeps its names, and may use the
    page itself."""
    users_package(tmp_path, PACKAGE)
    done = python(OF_PACKAGE.format(first=first, part=part), tmp_path)
    assert done.returncode == 0, done.stderr
    said, runs = ["ipm"], ["package runs", "net runs"]
    said = [*runs, *said] if first else [*said, *runs]
    assert done.stdout.splitlines() == [*said, "model.net", "of mine True model.errors", "1,2"]


def test_a_part_that_a_users_package_and_ours_both_have_is_named(tmp_path):
    file = (
        users_package(tmp_path, {"__init__.py": "", "errors.py": "", "data/errors.py": ""})
        / "errors.py"
    )
    for code in ("from sandbox import simulate", "import model\nfrom sandbox import simulate"):
        done = python(code, tmp_path)
        assert done.returncode == 1
        assert done.stderr.strip().splitlines()[-1] == (
            f"ImportError: '{file}' and a part of sensorless-sandbox are both called "
            "'model.errors'; rename yours, or its folder, for example to my_model"
        )


def test_a_compiled_library_of_our_name_is_named(tmp_path):
    """Nothing can run beside it."""
    from importlib.machinery import EXTENSION_SUFFIXES

    file = tmp_path / f"model{EXTENSION_SUFFIXES[0]}"
    file.write_bytes(b"")
    done = python("from sandbox import simulate", tmp_path)
    said = done.stderr.strip().splitlines()[-1]
    assert said.startswith(f"ImportError: '{file}' hides the package 'model'")
    assert "rename that file or folder, for example to my_model" in said


def test_our_code_takes_names_from_submodules_alone():
    """So a user's `model.py`, whose attributes the package then has, never comes into it
    (`sandbox/engine/shadowing.py`)."""
    root = Path(sandbox.__file__).parent.parent
    for folder in ("model", "estimators", "sandbox"):
        for path in (root / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ImportFrom):
                    assert node.module not in ("model", "estimators"), path
                if isinstance(node, ast.Import):
                    assert not {a.name.partition(".")[0] for a in node.names} & {
                        "model",
                        "estimators",
                    }, path


PLAIN = """
{before}
from sandbox import list_scenarios

print(len(list_scenarios()))
from model.mine import x
from model.errors import BadInput

print(x, BadInput.__module__)
"""


@pytest.mark.parametrize("before", ["", "from model.mine import x"])
def test_a_plain_folder_of_our_name_hides_nothing_and_is_not_hidden(before, tmp_path):
    """Scripts and data, without `__init__.py`; ours is found first where both have a file of one
    name."""
    users_package(
        tmp_path, {"mine.py": "x = 3\n", "errors.py": "x = 1 / 0\n", "weights.csv": "1,2\n"}
    )
    done = python(PLAIN.format(before=before), tmp_path)
    assert done.stdout.splitlines() == ["3", "3 model.errors"], done.stderr


def test_a_plain_folder_found_before_ours_came_onto_the_path(tmp_path):
    users_package(tmp_path, {"mine.py": "x = 3\n"})
    late = f"import model, sys\nsys.path.append({str(ROOT)!r})\nimport model.mine\n"
    code = (
        late + "from sandbox import load_motor\nprint(model.mine.x, load_motor('ipm').motor.name)\n"
    )
    bare = (
        "import os, sys\nsys.path[:] = [p for p in sys.path if not "
        "os.path.isdir(os.path.join(p, 'sandbox'))]\n"
    )
    done = python(bare + code, tmp_path, PYTHONPATH="")
    assert done.stdout.splitlines() == ["3 ipm"], done.stderr


def test_every_name_is_there_and_has_a_test():
    assert set(sandbox.__all__) == set(HOME) == names_tested()
    assert len(sandbox.__all__) == len(set(sandbox.__all__))
    for name in sandbox.__all__:
        assert getattr(sandbox, name).__name__ == name
        assert inspect.getdoc(getattr(sandbox, name))
    with pytest.raises(AttributeError, match="simulat"):
        sandbox.simulat  # noqa: B018
