"""The bench shares nothing with the product: its imports, followed transitively."""

import ast
import subprocess
import sys
from pathlib import Path

ROOM = Path(__file__).resolve().parents[3] / "experiments" / "testbench"
ALLOWED = {"numpy", "scipy", "numba", "pyarrow", *sys.stdlib_module_names}


def _imported(path: Path) -> set[str]:
    """Absolute names that a file imports; relative ones are resolved from its place."""
    package = ["experiments", "testbench", *path.relative_to(ROOM).parts[:-1]]
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {a.name for a in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            names.add(".".join([*base, *([node.module] if node.module else [])]))
    return names


def test_every_file_imports_only_its_room_and_four_libraries():
    files = sorted(ROOM.rglob("*.py"))
    assert len(files) > 10
    for path in files:
        for name in _imported(path):
            inside = name == "experiments.testbench" or name.startswith("experiments.testbench.")
            assert inside or name.split(".")[0] in ALLOWED, f"{path.name} imports {name}"


def test_nothing_of_the_product_is_loaded_when_it_runs():
    """In a process of its own."""
    code = "import sys, experiments.testbench.make; print(' '.join(m for m in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    ours = {
        m
        for m in done.stdout.split()
        if m.split(".")[0] in ("sandbox", "model", "estimators", "experiments")
    }
    assert {m for m in ours if not m.startswith("experiments.testbench")} == {"experiments"}


def test_no_dynamic_import():
    for path in ROOM.rglob("*.py"):
        text = path.read_text()
        assert "__import__" not in text
        assert "importlib" not in text
