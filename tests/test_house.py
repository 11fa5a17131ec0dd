"""The house's rules that a machine can check."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from model.effects.library import effect_names, load_effect

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("model", "estimators", "sandbox")
SOURCES = sorted(p for room in ROOMS for p in (ROOT / room).rglob("*.py"))


@cache
def tree_of(path: Path) -> ast.Module:
    """Return a file's syntax tree, parsed once for all rules."""
    return ast.parse(path.read_text())


@cache
def nodes(tree: ast.Module) -> tuple[ast.AST, ...]:
    """Return all nodes of a file's tree, walked once for all rules."""
    return tuple(ast.walk(tree))


@cache
def imported(path: Path) -> frozenset[str]:
    """Return the modules of all imports of a file, those inside functions or for types only
    included."""
    names = set()
    for node in nodes(tree_of(path)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add(node.module or "")
    return frozenset(names)


@cache
def files_imported(path: Path) -> set[Path]:
    """Return the files of the rooms that a file imports; of `from a import b` a or a.b, whichever
    is a file."""
    names = set(imported(path))
    for node in nodes(tree_of(path)):
        if isinstance(node, ast.ImportFrom):
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    files = {ROOT.joinpath(*name.split(".")).with_suffix(".py") for name in names}
    return files & set(SOURCES)


def test_layers():
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            "from importlinter.cli import lint_imports_command; lint_imports_command()",
        ],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout


def circle(graph):
    """Return the files of a circle of imports, empty where there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_no_imports_in_a_circle():
    """Those inside functions, and for types only, count, too: two modules that need each other are
    one."""
    graph = {path: files_imported(path) for path in SOURCES}
    assert sum(map(len, graph.values())) > len(SOURCES)  # imports are seen at all
    assert circle(graph) == []
    low, high = ROOT / "model" / "quartic.py", ROOT / "sandbox" / "drive" / "loop.py"
    assert {low, high} <= set(circle({**graph, low: {high}}))


def room_of(path):
    """Return the room of a file: a folder of the sandbox, or a package beside it."""
    parts = path.relative_to(ROOT).parts
    return "/".join(parts[:2]) if parts[0] == "sandbox" else parts[0]


def floors(below):
    """Return how many rooms stand on each other at most; below: which rooms each one imports."""
    order = TopologicalSorter(below).static_order()  # CycleError where two need each other
    height = {}
    for room in order:
        height[room] = 1 + max((height[x] for x in below.get(room, ())), default=0)
    return max(height.values())


def test_few_rooms_on_few_floors_and_no_arrow_up():
    """Sixteen rooms on eleven floors at most, experiments and the command line's entry counted;
    issue 51 asks for that."""
    assert floors({"a": {"b", "c"}, "b": {"c"}}) == 3
    below = {}
    for path in (p for p in SOURCES if p.parent != ROOT / "sandbox"):
        found = {room_of(f) for f in files_imported(path)} - {room_of(path)}
        below.setdefault(room_of(path), set()).update(found)
    assert len(below) + 2 <= 16
    assert floors(below) + 1 <= 11


def test_rooms_stay_small():
    """Some fifteen files a room; an effect and an estimator are a file each by design."""
    many = {ROOT / "model" / "effects", ROOT / "estimators", ROOT / "model"}
    for folder in {path.parent for path in SOURCES} - many:
        assert len(list(folder.glob("*.py"))) <= 17, folder


@pytest.mark.parametrize(
    ("library", "home"),
    [("rerun", "sandbox/output/trace.py"), ("matplotlib", "sandbox/output/plots.py")],
)
def test_one_module_imports_it(library, home):
    users = {
        p.relative_to(ROOT).as_posix()
        for p in SOURCES
        if any(n.split(".")[0] == library for n in imported(p))
    }
    assert users == {home}


def test_estimators_know_equations_only():
    allowed = {
        "model.frames",
        "model.energy",
        "model.fluxmap",
        "model.saliency",
        "model.compiled",
        "model.errors",
        "model.names",
        "model.plugins",
        "model",
    }
    for path in (ROOT / "estimators").glob("*.py"):
        assert {n for n in imported(path) if n.split(".")[0] == "model"} <= allowed, path


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_public_names_have_docstrings_and_files_stay_small(path):
    text = path.read_text()
    tree = tree_of(path)
    assert ast.get_docstring(tree), path
    assert text.count("\n") <= 600, path
    for node in nodes(tree):
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith("_"):
            assert ast.get_docstring(node), f"{path}: {node.name}"


def wide(tree):
    """Return the functions of a file, kernels apart, that take more than eight by place or return
    five and more."""
    found = []
    for node in (n for n in nodes(tree) if isinstance(n, ast.FunctionDef)):
        if any(re.match(r"kernel|inlined|njit", ast.unparse(d)) for d in node.decorator_list):
            continue
        own = [
            n
            for n in ast.walk(node)
            if isinstance(n, ast.Return) and isinstance(n.value, ast.Tuple)
        ]
        if len(node.args.posonlyargs + node.args.args) > 8 or any(
            len(n.value.elts) > 4 for n in own
        ):
            found.append(node.name)
    return found


def wide_kernels(tree):
    """Return the kernels of a file that take more than fifteen arguments or return seven numbers
    and more.

    A kernel has no arguments by name; what belongs together goes into a record.  The compiled loops
    take fifteen.
    """
    found = []
    for node in (n for n in nodes(tree) if isinstance(n, ast.FunctionDef)):
        if any(re.match(r"kernel|inlined|njit", ast.unparse(d)) for d in node.decorator_list):
            returned = [
                n.value
                for n in ast.walk(node)
                if isinstance(n, ast.Return) and isinstance(n.value, ast.Tuple)
            ]
            if len(node.args.args) > 15 or any(len(value.elts) > 6 for value in returned):
                found.append(node.name)
    return found


def long(tree):
    """Return the functions of a file, kernels apart, of more than a screen: 60 lines without their
    docstring."""
    found = []
    for node in (n for n in nodes(tree) if isinstance(n, ast.FunctionDef)):
        if any(re.match(r"kernel|inlined|njit", ast.unparse(d)) for d in node.decorator_list):
            continue
        said = node.body[0] if ast.get_docstring(node) else None
        lines = node.end_lineno - node.lineno + 1
        if lines - (said.end_lineno - said.lineno + 1 if said else 0) > 60:
            found.append(node.name)
    return found


def test_functions_fit_a_screen():
    rows = "    x = 1\n" * 60
    assert long(ast.parse(f"def f():\n{rows}")) == ["f"]
    assert long(ast.parse(f"@kernel\ndef f():\n{rows}")) == []
    for path in SOURCES:
        assert long(tree_of(path)) == [], path


def test_kernels_take_records():
    many = ", ".join(f"x{k}" for k in range(16))
    assert wide_kernels(
        ast.parse(f"@kernel\ndef f({many}): pass\n@inlined\ndef g(): return {many}\n")
    ) == ["f", "g"]
    for path in SOURCES:
        assert wide_kernels(tree_of(path)) == [], path


def test_many_arguments_go_by_name_and_many_results_have_names():
    assert wide(
        ast.parse("def f(a, b, c, d, e, f, g, h, i): pass\ndef g(): return 1, 2, 3, 4, 5\n")
    ) == ["f", "g"]
    assert (
        wide(
            ast.parse("@kernel\ndef f(a, b, c, d, e, f, g, h, i): pass\ndef g(*, a): return 1, 2\n")
        )
        == []
    )
    for path in [*SOURCES, *(ROOT / "experiments").glob("*.py")]:
        assert wide(tree_of(path)) == [], path


def many(tree):
    """Return the functions of a file, kernels apart, that take eight arguments and more, those by
    name included."""
    return {
        node.name
        for node in nodes(tree)
        if isinstance(node, ast.FunctionDef)
        and not any(re.match(r"kernel|inlined|njit", ast.unparse(d)) for d in node.decorator_list)
        and len([a for a in (*node.args.args, *node.args.kwonlyargs) if a.arg != "self"]) > 7
    }


def test_functions_take_seven_arguments_at_most():
    """But for the public page and the command line, whose arguments are the contract."""
    assert many(ast.parse("def f(a, b, c, d, *, e, f, g, h): pass")) == {"f"}
    contract = [ROOT / "sandbox" / room for room in ("public", "cli")]
    for path in SOURCES:
        if not {*path.parents} & {*contract}:
            assert many(tree_of(path)) == set(), path


def test_no_path_of_one_machine():
    pattern = re.compile(r"(?<![\w.])/(home/\w+|root|work)/")
    for path in ROOT.rglob("*"):
        parts = path.relative_to(ROOT).parts
        hidden = any(
            (p.startswith(".") and p != ".ci") or p in ("__pycache__", "sensorless-out")
            for p in parts
        )
        if path.is_file() and not hidden and path.suffix in (".py", ".md", ".toml", ".cff"):
            assert not pattern.search(path.read_text()), path


def test_start_is_light():
    """Heavy libraries come in only when a command needs them."""
    heavy = ("numba", "rerun", "matplotlib", "control", "scipy", "rich")
    code = f"import sys, sandbox.cli; print(set({heavy}) & set(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "set()"


def test_the_diagnosis_names_no_effect():
    """What is special about an effect stands on its card: neither diagnosis nor replay nor the
    diagnosis of motions has an effect's name in a string (words of a sentence apart) or imports its
    file; `magnet_flux` is also a field of a motor."""
    names = "|".join(effect_names())
    quoted = re.compile(rf"(?:cross_)?(?:{names})(?:\.\w*)?")
    for path in sorted(
        p for room in ("gap", "replay") for p in (ROOT / "sandbox" / room).rglob("*.py")
    ):
        if path.name == "torques.py":  # the table of what an effect is in the shaft's equation
            continue
        if path.parent.name == "identification":  # of a motor's own parameters
            continue
        tree = tree_of(path)
        assert not any(re.fullmatch(rf"model\.effects\.(?:{names})", n) for n in imported(path)), (
            path
        )
        for node in nodes(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                of_motor = node.value in ("inertia", "magnet_flux")  # as [motor] states them
                of_shaft = path.parent.name == "motion" and of_motor
                assert of_shaft or not quoted.fullmatch(node.value), (
                    f"{path}:{node.lineno}: {node.value}"
                )


def test_diagnosis_and_replay_read_no_row_of_one_effect():
    """Rows of the plant's batch bear the names of effects, too."""
    rows = {f"{name}_{p.name}" for name in effect_names() for p in load_effect(name).parameters} - {
        "magnet_flux_magnet_flux"
    }
    paths = [p for room in ("gap", "replay") for p in (ROOT / "sandbox" / room).rglob("*.py")]
    for path in sorted(paths):
        for node in nodes(tree_of(path)):
            own = getattr(node, "value", None) if isinstance(node, ast.Constant) else None
            own = node.attr if isinstance(node, ast.Attribute) else own
            assert own not in rows, f"{path}:{node.lineno}: {own}"


def test_the_plant_names_no_effect():
    """An effect is one file: neither the library nor the plant nor the closed loop has its name or
    imports its file.

    `record` speaks of a bench.
    """
    others = {"record.py"}
    names = "|".join(effect_names())
    rooms = [
        p
        for room in ("plant", "drive")
        for p in (ROOT / "sandbox" / room).glob("*.py")
        if p.name not in others
    ]
    # what turns an angle that is read; a key of [background]
    known = {"encoder_offset.offset", "current_offset"}
    # else the bench's own zone of a current's sign
    known |= {f"dead_time.zone_{name}" for name in ("width", "shape", "center")}
    # else the motor's rated current, speed
    known |= {f"{e}.reference" for e in ("leg_voltage", "current_linearity", "friction_torque")}
    for path in (
        ROOT / "model" / "effects" / "library.py",
        ROOT / "model" / "effects" / "adopt.py",
        *rooms,
    ):
        assert not any(re.fullmatch(rf"model\.effects\.(?:{names})", n) for n in imported(path)), (
            path
        )
        strings = {n.value for n in nodes(tree_of(path)) if isinstance(n, ast.Constant)}
        quoted = {
            s for s in strings if isinstance(s, str) and re.fullmatch(rf"(?:{names})(?:\.\w*)?", s)
        }
        assert quoted <= (known if path.name == "sets.py" else set()), path


def test_the_product_uses_every_file_of_the_sandbox():
    """What only experiments or tests use stands with them.  The paper's test is what a tutorial
    records; schemas are read by the documentation and by whoever reads results."""
    others = {"sandbox/replay/identification/locked_test.py", "sandbox/output/schema.py"}
    used = set().union(*map(files_imported, SOURCES))
    free = {
        p.relative_to(ROOT).as_posix()
        for p in SOURCES
        if p not in used and not p.stem.startswith("__")
    }
    assert {name for name in free if name.startswith("sandbox/")} == others


def test_the_formatter_lays_out():
    """Code is 100 columns wide, in the formatter's own layout: nothing is exempt from it."""
    told = "# fmt: " + "skip", "# fmt: " + "off"
    for path in (
        p for room in (*ROOMS, "experiments", "tests") for p in (ROOT / room).rglob("*.py")
    ):
        assert not any(word in path.read_text() for word in told), path


def test_rooms_of_the_diagnosis_stay_small():
    for room in (ROOT / "sandbox" / "gap").rglob("*"):
        if room.is_dir():
            assert len(list(room.glob("*.py"))) <= 15, room


def test_tests_mirror_the_code():
    """A test's file stands where the code's does, by the same name, and a topic where there are
    several: tests/model/test_energy_values.py tests model/energy.py."""
    for path in (p for room in ROOMS for p in (ROOT / "tests" / room).rglob("test_*.py")):
        folder = path.parent.relative_to(ROOT / "tests")
        words = path.stem.removeprefix("test_").split("_")
        names = ["_".join(words[: k + 1]) for k in range(len(words))]
        assert any((ROOT / folder / f"{name}.py").is_file() for name in names), path


def test_no_test_imports_another():
    """What several tests need stands in a file beside them, whose name does not begin with
    `test_`."""
    for path in (ROOT / "tests").rglob("*.py"):
        assert not [name for name in imported(path) if re.search(r"\.test_\w+$", name)], path


WITHDRAWN = {
    *("told", "foretold", "stranger", "needless", "tardy", "sunk"),
    *("beside", "rr", "noise_floor", "floor_of", "angle_floor"),
    *("Beside", "Judged", "Course", "Push", "Told", "Normal", "Point", "Part"),
}


def withdrawn(tree):
    """Return which of the words that were exchanged for those of the field a file still gives to
    functions, classes, arguments and variables."""
    named = set()
    for node in nodes(tree):
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            named.add(node.name.strip("_"))
        elif isinstance(node, ast.arg):
            named.add(node.arg)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            named.add(node.id)
    return named & WITHDRAWN


def test_words_are_those_of_the_field():
    assert withdrawn(ast.parse("def _told(foretold): sunk = 1")) == {"told", "foretold", "sunk"}
    for path in SOURCES:
        assert withdrawn(tree_of(path)) == set(), path
