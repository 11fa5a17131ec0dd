"""What is kept on disk is checked before it is believed; damage is a note and a new entry, never an
error."""

from __future__ import annotations

import os
import random
import subprocess
import sys
from pathlib import Path

import pytest

from model.kernels import kept

ROOT = Path(__file__).resolve().parents[2]
CODE = """
from model.compiled import kernel, kernel_as
from numba import types

@kernel
def f(x):
    return 10.0 * x

@kernel_as(types.float64(types.float64))
def g(x):
    return f(x) + 1.0
"""


def run(folder, cache, *, code="from here import f, g; print(g(2.0), f(3))", **env):
    """Return what a process says that loads two kernels of a file of its own: standard output,
    standard error."""
    (folder / "here.py").write_text(CODE)
    env = {
        **os.environ,
        "SENSORLESS_CACHE": str(cache),
        "PYTHONPATH": f"{ROOT}{os.pathsep}{folder}",
        **env,
    }
    done = subprocess.run(
        [sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True
    )
    return done.stdout, done.stderr


ANSWER = "21.0 30.0\n"  # 10 * 2 + 1, 10 * 3


def damaged(content, chance):
    """Return bytes with one bit turned, cut short, empty, or others of the same length."""
    kind = chance.randrange(4)
    k = chance.randrange(len(content) or 1)
    if kind == 0 and content:
        return content[:k] + bytes([content[k] ^ (1 << chance.randrange(8))]) + content[k + 1 :]
    return (content[:k], b"", chance.randbytes(len(content)), b"x")[kind]


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """A folder with a cache of the two kernels, as one process left it and another read it without
    a word."""
    folder = tmp_path_factory.mktemp("compiled")
    for _ in range(2):
        assert run(folder, folder / "cache") == (ANSWER, "")
    return folder


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
def test_damaged_kernels_are_compiled_again(compiled, suffix):
    cache, chance = compiled / "cache", random.Random(1)
    for _ in range(2):
        files = list(cache.rglob(f"*{suffix}"))
        assert files
        for path in files:
            path.write_bytes(damaged(path.read_bytes(), chance))
        said, noted = run(compiled, cache)
        assert said == ANSWER
        assert noted.count("was damaged and is made anew") == noted.count("\n") >= 1
    assert run(compiled, cache) == (ANSWER, "")  # made anew


def test_machine_code_of_another_function_is_not_believed(tmp_path):
    """Exchanged files: each is whole, neither is what the index names."""
    cache = tmp_path / "cache"
    run(tmp_path, cache)
    one, other = (next(cache.rglob(f"here.{name}-*.nbc")) for name in "fg")
    first, second = one.read_bytes(), other.read_bytes()
    one.write_bytes(second)
    other.write_bytes(first)
    said, noted = run(tmp_path, cache)
    assert said == ANSWER
    assert noted.count("damaged") == 2


def test_a_place_that_cannot_be_written_is_no_error(tmp_path):
    (tmp_path / "file").write_text("")
    assert run(tmp_path, tmp_path / "file" / "below")[0] == ANSWER
    bare = "import tempfile; tempfile.mkdtemp = lambda **_: open('/not/there'); "
    code = bare + "from here import f, g; print(g(2.0), f(3))"
    assert run(tmp_path, tmp_path / "file" / "below", code=code)[0] == ANSWER


def test_a_function_without_a_file_is_compiled_too(tmp_path):
    code = (
        "from model.compiled import kernel; exec('def h(x): return x + x'); print(kernel(h)(2.0))"
    )
    assert run(tmp_path, tmp_path / "cache", code=code) == ("4.0\n", "")


def test_an_entry_is_read_as_written_or_not_at_all(tmp_path, capsys):
    path, chance = tmp_path / "deep" / "entry", random.Random(2)
    kept.note.cache_clear()  # said once a process
    assert kept.read(path) is None
    body = chance.randbytes(500)
    kept.write(path, body)
    assert kept.read(path) == body
    whole = path.read_bytes()
    for _ in range(200):
        path.write_bytes(damaged(whole, chance))
        assert kept.read(path) in (None, body)
        if path.read_bytes() != whole:
            assert kept.read(path) is None
    assert "'entry' was damaged and is made anew" in capsys.readouterr().err
    assert [p.name for p in path.parent.iterdir()] == ["entry"]
