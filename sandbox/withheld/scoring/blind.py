"""Scoring a withheld check: diagnose blindly, then open the seal.

`diagnose(folder, exclude)` is any function that answers with an object whose `json` is the
diagnosis of `diagnosis.json`; the baselines are such functions, too.  It is given a campaign's
folder and never the seal.  Reports and seal become rows (`rows.py`), figures come from the rows
alone (`tables_of_rows.py`).
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from model.effects import library
from model.errors import BadInput
from model.given import MOST_JSON, given_bytes
from sandbox.gap.by_recording import with_offsets
from sandbox.gap.diagnose import diagnosis_of
from sandbox.gap.location.where import where
from sandbox.gap.report.answers import Answers, next_recording
from sandbox.gap.report.diagnosis_json import document
from sandbox.gap.report.ranking import ranking
from sandbox.output.files import plain
from sandbox.recordings.campaign import read_folder
from sandbox.withheld.making.make import CAMPAIGNS, HASH, SEAL
from sandbox.withheld.scoring.documents import check_report, check_truth
from sandbox.withheld.scoring.recommended import recommended
from sandbox.withheld.scoring.rows import BLIND, LEFT_OUT, RESOLVED, Row, one_code, row
from sandbox.withheld.scoring.running import Check, code_digest, follow_all, run_all
from sandbox.withheld.scoring.tables_of_rows import Scores, scored

DIAGNOSES = "diagnoses"
LEAST_LEFT_OUT = 1.0  # size from which on an effect is left out of the library


def standard(folder: Path, exclude: tuple[str, ...] = ()) -> Any:
    """Diagnose a campaign with the project's own diagnosis; what effects do to the position error
    is not scored."""
    d = diagnosis_of(read_folder(folder), exclude=exclude, workers=1)
    whole = ranking(d, position=False)
    a = with_offsets(Answers(d, where(d), None, next_recording(d), None, ranking=whole))
    found = document(a.diagnosis, a.where, None, a.following, whole=a.ranking)
    return SimpleNamespace(json=plain(found))


def score(
    check: Check,
    *,
    method: str = "diagnosis",
    limit: int | None = None,
    leave_out: float = 0.0,
    again: bool = False,
    finished: bool = False,
    allow_mixed: bool = False,
) -> Scores:
    """Diagnose a check's campaigns (those without a report yet) and judge them.

    limit: the first so many campaigns; leave_out: share of the single effects of medium size or
    more diagnosed once more without the true effect in the library; again: forget earlier reports;
    finished: run nothing, judge what has a report; allow_mixed: reports may come from several
    states of the code, whose figures are then told apart.
    Where a diagnosis is ambiguous, the recording that it recommends is made and all is diagnosed
    again. BadInput where the folder is no check, its seal is not the one that was hashed, or states
    of the code are mixed.
    """
    if not 0.0 <= leave_out <= 1.0:
        raise BadInput(f"leave_out = {leave_out} is no share; give a number in [0, 1]")
    if check.workers.cluster is not None:
        check = replace(check, folder=check.folder.resolve())
    folder = check.folder
    names = campaign_names(folder, limit)
    sealed(folder)  # an hour of diagnosing is not spent on a check whose truth was changed
    reports = folder / DIAGNOSES if method == "diagnosis" else folder / DIAGNOSES / method
    if again:
        _forget(reports)
    if finished:
        names = with_report(reports, names)
        if not names:
            raise BadInput(
                f"no campaign of '{folder}' has a report of '{method}' yet; score "
                "without --finished"
            )
    else:
        if not allow_mixed:  # nor on reports that cannot be judged beside older ones
            _check_code(method, reports, names)
        run_all(check, dict.fromkeys(names, ()), reports)
    content = opened(folder)
    truth = content["campaigns"]
    _complete(folder, truth)
    without = _left_out(truth, names, leave_out)
    asked = _asked(reports, names)
    if not finished:
        run_all(check, without, reports / LEFT_OUT)
        follow_all(check, asked, content, reports / RESOLVED)
    parts = (
        (BLIND, reports, names),
        (LEFT_OUT, reports / LEFT_OUT, without),
        (RESOLVED, reports / RESOLVED, asked),
    )
    rows = [r for part, place, chosen in parts for r in _rows(method, part, place, chosen, truth)]
    if not allow_mixed:
        one_code(rows, f"'{reports}'")
    return scored(rows)


def _check_code(method: str, reports: Path, names: Sequence[str]) -> None:
    """Raise BadInput where reports were made by another state of the code than this one."""
    places = (reports, reports / LEFT_OUT, reports / RESOLVED)
    earlier = [r for p in places for r in _rows(method, BLIND, p, names, {})]
    one_code(earlier, f"'{reports}'", [code_digest()])


def _left_out(
    truth: Mapping[str, Any], names: Sequence[str], share: float
) -> dict[str, tuple[str, ...]]:
    """Return what is taken from the library for a share of the single effects that are large
    enough."""
    single = [
        n for n in names if truth[n]["kind"] == "one" and truth[n]["sizes"][0] >= LEAST_LEFT_OUT
    ]
    return {n: taken_out(truth[n]["effects"]) for n in single[: round(share * len(single))]}


def _asked(reports: Path, names: Sequence[str]) -> dict[str, tuple[str, float]]:
    """Return the recordings that diagnoses recommend, by campaign."""
    found = {n: read_report(reports, n) for n in names}
    return {
        n: entry
        for n, d in found.items()
        if "failed" not in d and (entry := recommended(d)) is not None
    }


def taken_out(effects: Sequence[str]) -> tuple[str, ...]:
    """Return true effects with those that have all of their numbers among their own: with one of
    these in the library, the cause would still be there under another name."""
    return (*effects, *(h for e in effects for h in library.holders(e)))


def _rows(
    method: str, part: str, reports: Path, names: Iterable[str], truth: Mapping[str, Any]
) -> list[Row]:
    """Return a row for every campaign that has a report."""
    return [
        row(method, part, n, truth.get(n, {}), read_report(reports, n))
        for n in with_report(reports, names)
    ]


def _forget(reports: Path) -> None:
    """Delete the reports of earlier calls."""
    shutil.rmtree(reports / LEFT_OUT, ignore_errors=True)
    shutil.rmtree(reports / RESOLVED, ignore_errors=True)
    for old in reports.glob("*.json"):
        old.unlink()


def _complete(folder: Path, truth: Mapping[str, Any]) -> None:
    """Raise BadInput unless the recorded campaigns are those sealed."""
    recorded = campaign_names(folder)
    absent, foreign = sorted(set(truth) - set(recorded)), sorted(set(recorded) - set(truth))
    if foreign:
        raise BadInput(
            f"'{folder / CAMPAIGNS / foreign[0]}' is no campaign of this check; move it elsewhere"
        )
    if absent:
        raise BadInput(
            f"{len(absent)} of {len(truth)} sealed campaigns are not recorded ({absent[0]}, ...); "
            "run `withheld make` once more"
        )


def with_report(reports: Path, names: Iterable[str]) -> list[str]:
    """Return the campaigns that have a report already."""
    return [n for n in names if (reports / f"{n}.json").exists()]


def campaign_names(folder: Path, limit: int | None = None) -> list[str]:
    """Return the names of a check's campaigns; BadInput where there is none, or recording is not
    finished."""
    found = sorted(p.name for p in (folder / CAMPAIGNS).glob("w[0-9][0-9][0-9]*") if p.is_dir())
    if not found or not (folder / SEAL).is_file():
        raise BadInput(f"'{folder}' is no withheld check; make one with `sensorless withheld make`")
    return found[:limit]


def read_report(reports: Path, name: str) -> dict[str, Any]:
    """Return one stored diagnosis; BadInput where a file is none, or another campaign's."""
    path = reports / f"{name}.json"
    try:
        return check_report(read_json(given_bytes(path, MOST_JSON, "score again")), name)
    except (OSError, ValueError) as error:  # BadInput, too
        raise BadInput(
            f"'{path}' holds no report of {name}; delete it and score again ({error})"
        ) from None


def read_json(text: bytes) -> Any:
    """Return a JSON document; ValueError where it is none."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("lists in lists without an end") from None


def sealed(folder: Path) -> bytes:
    """Return the sealed file unread; BadInput where it is not the one that was hashed."""
    data, path = given_bytes(folder / SEAL, MOST_JSON, "make the check anew"), folder / HASH
    stated = path.read_bytes().split()[:1] if path.is_file() else []
    if not stated:
        raise BadInput(
            f"'{path}' is missing or empty, so the seal cannot be checked; make the check anew"
        )
    found, declared = hashlib.sha256(data).hexdigest(), stated[0].decode("ascii", "replace")
    if found != declared:
        raise BadInput(
            f"{SEAL} has SHA-256 {found}, {HASH} says {declared}: the truth was changed; "
            "make the check anew"
        )
    return data


def opened(folder: Path) -> dict[str, Any]:
    """Return what the seal holds; BadInput where it is not the file that was hashed, or holds no
    truth."""
    data = sealed(folder)
    try:
        return check_truth(read_json(data))
    except ValueError as error:  # BadInput, too
        raise BadInput(
            f"'{folder / SEAL}' holds no truth of a check; make the check anew ({error})"
        ) from None
