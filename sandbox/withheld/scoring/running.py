"""Diagnosing the campaigns of a check, one report each: goes on after an interruption, whatever
fails is a miss.

Every report says by `code` which version of the code made it, by `made` when, and by `cpu_seconds`
what it took (a recommended recording made for it included), whatever else ran on the machine.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from sandbox.engine.journal import state_of_code
from sandbox.engine.processes import ALONE, Workers, spread
from sandbox.output.files import json_bytes, plain, write_whole
from sandbox.withheld.making.draw import Drawn
from sandbox.withheld.making.make import CAMPAIGNS
from sandbox.withheld.scoring.recommended import drawn_again, grow

Diagnose = Callable[[Path, tuple[str, ...]], Any]
# what diagnoses and what records, with all that they import; motors, effects and estimators are
# found by name
CODE = (
    "sandbox/withheld/**/*.py",
    "model/**/*.py",
    "estimators/**/*.py",
    "model/**/*.toml",
    "sandbox/**/*.toml",
    "sandbox/engine/shadowing.py",
    "sandbox/public/page.py",
)


@dataclass(frozen=True)
class Check:
    """A check's folder, what diagnoses its campaigns, and who does; told the share done.

    A cluster's workers read and write the same folder, at the same place.
    """

    folder: Path
    diagnose: Diagnose
    workers: Workers = ALONE
    progress: Callable[[float], None] | None = None


def run_all(check: Check, work: Mapping[str, tuple[str, ...]], reports: Path) -> None:
    """Diagnose campaigns, each with effects excluded, that have no report yet; every finished one
    is kept."""
    _spread(check, [_Task(check.folder / CAMPAIGNS / n, x, reports) for n, x in work.items()])


def follow_all(
    check: Check, asked: Mapping[str, tuple[str, float]], content: Mapping[str, Any], reports: Path
) -> None:
    """Make the recording asked for (entry, seconds) of each campaign that has no report here yet,
    and diagnose it with the rest."""
    left = [
        n for n in asked if not reported(reports, n) or _of_another(reports / f"{n}.json", asked[n])
    ]
    for name in left:
        (reports / f"{name}.json").unlink(missing_ok=True)
    campaigns = check.folder / CAMPAIGNS
    _spread(
        check, [_Task(campaigns / n, (), reports, asked[n], drawn_again(content, n)) for n in left]
    )


def reported(reports: Path, name: str) -> bool:
    """Tell whether a campaign has a report; one that says why diagnosing failed is worth another
    try."""
    path = reports / f"{name}.json"
    return path.exists() and (not path.is_file() or b'"failed":' not in path.read_bytes())


def _of_another(report: Path, entry: tuple[str, float]) -> bool:
    """Tell whether another recording was made for a report; a damaged one is kept, to be named
    where it is judged."""
    try:
        return bool(json.loads(report.read_text(encoding="utf-8")).get("recorded") != list(entry))
    except (ValueError, AttributeError, OSError, RecursionError):
        return False


@dataclass(frozen=True)
class _Task:
    """One campaign to diagnose: its folder, effects excluded, where reports go, the recording to
    make before."""

    campaign: Path
    exclude: tuple[str, ...]
    reports: Path
    entry: tuple[str, float] | None = None
    drawn: Drawn | None = None

    @property
    def name(self) -> str:
        """The campaign's name."""
        return self.campaign.name


def _spread(check: Check, tasks: Sequence[_Task]) -> None:
    left = [t for t in tasks if not reported(t.reports, t.name)]
    if check.progress is not None:
        check.progress(0.0)
    for done, _ in enumerate(spread(partial(_one, check.diagnose), left, check.workers, _lost), 1):
        if check.progress is not None:
            check.progress(done / len(left))


def _one(diagnose: Diagnose, task: _Task) -> None:
    """Diagnose one campaign; whatever goes wrong is written down as a miss, not raised."""
    started = time.process_time()
    code_digest()  # now, not when it is done: files may change in the meantime, what runs does not
    try:
        folder = task.campaign
        if task.entry is not None and task.drawn is not None:
            folder = grow(folder, task.reports / CAMPAIGNS / task.name, task.entry, task.drawn)
        content = plain(diagnose(folder, task.exclude).json)
    except Exception as error:  # a failing campaign is a result
        content = {"campaign": task.name, "failed": f"{type(error).__name__}: {error}"}
    _write(task, {**content, "cpu_seconds": time.process_time() - started})


def _lost(task: _Task) -> None:
    _write(task, {"campaign": task.name, "failed": "the process that diagnosed it died"})


def _write(task: _Task, content: dict[str, Any]) -> None:
    task.reports.mkdir(parents=True, exist_ok=True)
    more = {} if task.entry is None else {"recorded": list(task.entry)}
    now = datetime.now(UTC).isoformat(timespec="seconds")
    text = json_bytes({**content, **more, "code": code_digest(), "made": now})
    write_whole(task.reports / f"{task.name}.json", text)


def code_digest() -> str:
    """Return a short hash of the code that diagnoses, which tells reports of one version from those
    of another."""
    return state_of_code(*CODE)[:12]
