"""A user's effects in a check: drawn and recorded by the switched bench, candidates where the check
is scored."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[4]
EXAMPLE = ROOT / "experiments" / "my_effects.py"
LIST = """
import json, sys
from model.effects.adopt import adopt
adopt(sys.argv[1])
from sandbox.withheld.making.case_list import Case, cases
from sandbox.withheld.making.draw import draw
drawn = draw(Case(0, "one", "ipm", "scored", ("resolver",), (0.5,), table="published"), 4)
listed = {name for c in cases(400, 1, "mixed", "scored", table="published") for name in c.names}
print(json.dumps([drawn.own, drawn.as_json()["parameters"], drawn.sizes, sorted(listed & {"fan", "resolver"})]))
"""  # noqa: E501


def python(*arguments):
    return subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )


def test_they_are_drawn_beside_the_librarys():
    """In the middle of 1/4 ... 2 typical sizes stands 0.25 sqrt(8) = 0.7071; the card's typical
    amplitude is 3 mrad."""
    done = python("-c", LIST, str(EXAMPLE))
    assert not done.returncode, done.stderr
    own, parameters, sizes, listed = json.loads(done.stdout)
    assert sizes == [pytest.approx(0.5**0.5)]
    assert own["resolver"] == pytest.approx(0.003 * 0.5**0.5)
    assert parameters == {
        "resolver.amplitude": own["resolver"],
        "resolver.phase": own["resolver_phase"],
    }
    assert listed == ["fan", "resolver"]


def test_an_effect_that_the_bench_lacks_is_refused_before_anything_is_made(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(EXAMPLE.read_text().replace('name="fan"', 'name="propeller"'))
    out = tmp_path / "check"
    done = python(
        "-m",
        "sandbox.cli",
        "withheld",
        "make",
        str(out),
        "--count",
        "1",
        "--effects-from",
        str(file),
    )
    assert done.returncode == 2
    assert "the switched bench has no number 'propeller' for 'propeller.coefficient'" in done.stderr
    assert not out.exists()
