"""The kernel cache must never hand out machine code of an older source."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from numba import types

from model.compiled import compiled_as, kernel

ROOT = Path(__file__).resolve().parents[3]


def answer(folder: Path, callee: str, cache: Path) -> str:
    """Run a copy of the rooms in which `callee` returns another value; return what its caller
    prints."""
    room = folder / "model"
    room.mkdir(parents=True, exist_ok=True)
    (room / "__init__.py").write_text("")
    shutil.copy(ROOT / "model" / "compiled.py", room)
    shutil.copytree(ROOT / "model" / "kernels", room / "kernels", dirs_exist_ok=True)
    (room / "callee.py").write_text(
        f"from model.compiled import kernel\n\n\n@kernel\ndef f(x):\n    return {callee}\n"
    )
    caller = """
        from model.callee import f
        from model.compiled import kernel

        @kernel
        def g(x):
            return f(x) + 1.0
    """
    if not (room / "caller.py").exists():
        (room / "caller.py").write_text(textwrap.dedent(caller))
    run = [sys.executable, "-c", "from model.caller import g; print(g(2.0))"]
    env = {
        **os.environ,
        "SENSORLESS_CACHE": str(cache),
        "PYTHONPATH": str(folder),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    return subprocess.run(
        run, cwd=folder, env=env, capture_output=True, text=True, check=True
    ).stdout.strip()


def kept(cache: Path) -> set[Path]:
    return set(cache.glob("kernels-*/*/*.nbc"))


def test_changed_callee_recompiles_its_caller(tmp_path):
    assert answer(tmp_path / "copy", "10.0 * x", tmp_path / "cache") == "21.0"
    assert answer(tmp_path / "copy", "20.0 * x", tmp_path / "cache") == "41.0"
    assert len(kept(tmp_path / "cache")) == 4  # callee and caller, twice


def test_a_changed_file_that_no_kernel_imports_recompiles_nothing(tmp_path):
    """A report may change as often as its writer likes; so may what it imports, and the kernels
    that it imports."""
    room = tmp_path / "copy" / "model"
    room.mkdir(parents=True)
    for text in ("A = 1\n", "A = 2\n"):
        (room / "report.py").write_text(f"from model.caller import g\n\n{text}print(g(2.0))\n")
        assert answer(tmp_path / "copy", "10.0 * x", tmp_path / "cache") == "21.0"
        assert len(kept(tmp_path / "cache")) == 2


def test_changed_constant_of_a_file_without_kernels_recompiles(tmp_path):
    """`estimators.contract` holds no kernel, but its constants and fields are compiled into
    others."""
    (tmp_path / "copy" / "model").mkdir(parents=True)
    for value in ("3.0", "4.0"):
        (tmp_path / "copy" / "model" / "constants.py").write_text(f"K = {value}\n")
        callee = "K * x\n\n\nfrom model.constants import K  # noqa: E402"
        assert answer(tmp_path / "copy", callee, tmp_path / "cache") == str(
            2.0 * float(value) + 1.0
        )


def double(x):
    return x + x


def test_a_signature_is_compiled_once_whichever_thread_asks():
    """Four threads at once get one dispatcher with one machine code; another signature gets
    another."""
    real = types.float64(types.float64)
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda _: compiled_as(real, double), range(4)))
    assert all(f is found[0] for f in found)
    assert found[0].signatures == [(types.float64,)]
    assert found[0](1.5) == 3.0
    whole = compiled_as(types.int64(types.int64), double)
    assert whole is not found[0]
    assert whole(3) == 6


@kernel
def scaled(k, x):
    return k * x


@kernel
def both(x):
    return scaled(2, x) + scaled(3, x)


def test_callers_share_one_callee_and_python_has_its_own():
    """5 x 1.5: constants are integers to the callee, which is made ready for Python when Python
    calls it."""
    assert both(1.5) == 7.5
    integer_and_real = (types.int64, types.float64)
    # the caller's code was kept by an earlier run, so its callee is not compiled
    kept = not both.stats.cache_misses
    assert scaled.twin.signatures == ([] if kept else [integer_and_real])
    assert scaled.signatures == []
    assert scaled(2, 1.5) == 3.0
    assert scaled.signatures == [integer_and_real]
