"""Effects of one's own, named by the diagnosis: a fan that the library does not hold, and a
resolver's order by itself (`my_effects.py`).

Recordings come from the switched bench, which has both and shares no code with the plant.  Each
campaign is diagnosed twice by the command line: with the library alone, and with --effects-from
my_effects.py.
"""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from experiments.drawing import RESULTS
from sandbox.recordings.campaign import Campaign
from sandbox.recordings.writing import write_campaign
from sandbox.withheld.making.case_list import Case
from sandbox.withheld.making.draw import draw
from sandbox.withheld.making.make import campaign_of

FILE = Path(__file__).parent / "my_effects.py"
SEED = 20261122
# of the switched bench
PLANTED = {"fan": {"fan": 1.5e-5}, "resolver": {"resolver": 0.004, "resolver_phase": 0.7}}
TRUE = {
    "fan": {"fan.coefficient": 1.5e-5},
    "resolver": {"resolver.amplitude": 0.004, "resolver.phase": 0.7},
}


def recorded(name: str) -> Campaign:
    """Return a campaign of the switched bench with one of the two effects."""
    drawn = draw(Case(sorted(PLANTED).index(name), "none", "ipm_exchanged", "practice"), SEED)
    return campaign_of(dataclasses.replace(drawn, own=PLANTED[name]))


def diagnosed(campaign: Path, out: Path, *more: str) -> dict[str, Any]:
    """Return diagnosis.json of a campaign, by the command line."""
    call = [
        sys.executable,
        "-m",
        "sandbox.cli",
        "diagnose",
        str(campaign),
        "--out",
        str(out),
        "--quiet",
        *more,
    ]
    subprocess.run(call, check=True)
    found: dict[str, Any] = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    return found


def row(name: str, folder: Path) -> str:
    """Return the table's row of an effect."""
    campaign = folder / name
    write_campaign(campaign, recorded(name))
    cells = [name]
    for key, more in (("library", ()), ("own", ("--effects-from", str(FILE)))):
        found = diagnosed(campaign, folder / f"{name}-{key}", *more)
        best = found["hypotheses"][0]
        cells.append(
            f"{', '.join(best['effects']) or 'none'} ({best['probability']:.2f}), "
            f"{found['verdict']}"
        )
    values = [
        f"{p} {v['value']:.3g} [{v['ci95'][0]:.3g}, {v['ci95'][1]:.3g}], true {TRUE[name][p]:.3g}"
        for p, v in best["parameters"].items()
        if p in TRUE[name]
    ]
    return "| " + " | ".join([*cells, "; ".join(values), f"{found['gap']['after']:.2f}"]) + " |"


def main() -> None:
    """Record, diagnose and write the table."""
    head = [
        (
            "| on the bench | by the library alone | with my_effects.py | value | residual, "
            "noise floors |"
        ),
        "|---|---|---|---|--:|",
    ]
    with tempfile.TemporaryDirectory() as folder:
        rows = [row(name, Path(folder)) for name in PLANTED]
    text = (
        "# Effects of one's own\n\n`python -m experiments.own_effects`\n\n"
        + "\n".join([*head, *rows])
        + "\n"
    )
    (RESULTS / "own_effects.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
