"""Make the diagnosis that the tutorial walks through: `python docs/stored/diagnosis.py` (two to six
minutes).

It writes diagnosis.json, report.html and truth.json beside this file, with the date.
"""

from __future__ import annotations

import datetime
import json
import shutil
import tempfile
from pathlib import Path

from sandbox import diagnose
from sandbox.output.files import rounded
from sandbox.withheld.making.make import CheckPlan, make

HERE = Path(__file__).resolve().parent
SEED, COUNT, WHICH = 7, 2, "w001"


def keep(answer: Path, sealed: Path) -> None:
    """Keep a diagnosis and what its seal says, six digits of every number, paths without the folder
    they lay in."""
    found = json.loads((answer / "diagnosis.json").read_text(encoding="utf-8"))
    truth = json.loads(sealed.read_text(encoding="utf-8"))["campaigns"][WHICH]
    today = {"date": datetime.date.today().isoformat()}
    for name, content in (
        ("diagnosis", found),
        ("truth", {k: truth[k] for k in ("effects", "parameters")}),
    ):
        text = (
            json.dumps(rounded(today | content, 6), indent=1).replace(f"{answer.parent}/", "")
            + "\n"
        )
        (HERE / f"{name}.json").write_text(text, encoding="utf-8")
    shutil.copy(answer / "report.html", HERE / "report.html")


def main() -> None:
    """Seal and record two campaigns, diagnose the second, then open the seal."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "drill"
        make(folder, CheckPlan(COUNT, SEED))
        answer = diagnose(folder / "campaigns" / WHICH).save(Path(place) / "answer")
        keep(answer, folder / "truth.sealed")


if __name__ == "__main__":
    main()
