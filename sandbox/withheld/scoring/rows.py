"""One row a diagnosis: truth, answer, code; every figure of a check follows from its rows and from
nothing else.

Numbers keep DIGITS significant digits, in the file and in the figures alike, so that figures
computed from a file are those of the run to the last digit.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from model.errors import BadInput
from model.given import MOST_JSON, given_bytes
from sandbox.output.files import rounded, write_whole
from sandbox.withheld.scoring.documents import check_report

FILE = "withheld.rows.jsonl"
DIGITS = 6
BLIND, LEFT_OUT, RESOLVED = "blind", "left_out", "resolved"
PARTS = (BLIND, LEFT_OUT, RESOLVED)
TRUTH = (
    "kind",
    "family",
    "style",
    "pair",
    "outside",
    "outside_subsystem",
    "effects",
    "sizes",
    "parameters",
)
# as they are; the rest is shortened
ANSWER = ("failed", "verdict", "ambiguity_set", "waterfall", "cpu_seconds")
KEPT = {
    "gap": ("raw", "before", "after", "closed"),
    "next_recording": ("entry", "seconds", "power"),
    "cost": ("seconds", "simulations"),
    "unknown": ("probability", "share"),
}
INCLUDED = ("name", "probability", "share", "group")  # of one effect among many
INTERVAL = ("value", "ci95")
PLACES = 3  # of where a gap lies
LIKELY = 0.5  # probability from which on an effect among many keeps its parameters


@dataclass(frozen=True)
class Row:
    """One diagnosis of one campaign beside its truth.

    part: BLIND, LEFT_OUT (the true effects out of the library) or RESOLVED (with the recommended
    recording); truth: of the seal, TRUTH; answer: of the report, shortened, or {"failed": why};
    code: hash of what diagnosed; made: UTC.
    """

    method: str
    part: str
    campaign: str
    truth: Mapping[str, Any]
    answer: Mapping[str, Any]
    code: str
    made: str = ""

    def line(self) -> str:
        """Return the row as one line of JSON."""
        return json.dumps(dict(vars(self)), allow_nan=False, separators=(",", ":"))


def row(
    method: str, part: str, campaign: str, truth: Mapping[str, Any], report: Mapping[str, Any]
) -> Row:
    """Return the row of one report (as `diagnosis.json`, with `code` and `made`) beside its entry
    of the seal."""
    code, made = str(report.get("code", "unknown")), str(report.get("made", ""))
    kept = {k: truth[k] for k in TRUTH if truth.get(k) is not None}
    return Row(
        method,
        part,
        campaign,
        rounded(kept, DIGITS),
        rounded(answer_of(report), DIGITS),
        code,
        made,
    )


def answer_of(report: Mapping[str, Any]) -> dict[str, Any]:
    """Return what judging and a reader need of a report: parameters of the first hypothesis only,
    no text."""
    out = {k: report[k] for k in ANSWER if k in report}
    if "failed" in out:
        return out
    out["hypotheses"] = [
        {"effects": h["effects"], "probability": h["probability"]} for h in report["hypotheses"]
    ]
    out["hypotheses"][0]["parameters"] = _intervals(report["hypotheses"][0])
    for key, names in KEPT.items():
        if key in report:
            part = report[key]
            out[key] = None if part is None else {n: part[n] for n in names if n in part}
    out["where"] = [
        {k: w[k] for k in ("subsystem", "share") if k in w}
        for w in report.get("where", [])[:PLACES]
    ]
    if "effects" in report:
        out["effects"] = [
            {k: e[k] for k in INCLUDED if k in e}
            | ({"parameters": _intervals(e)} if e["probability"] > LIKELY else {})
            for e in report["effects"]
        ]
    return out


def _intervals(part: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters of a hypothesis or an effect with their intervals, units left away."""
    return {k: {n: p[n] for n in INTERVAL if n in p} for k, p in part.get("parameters", {}).items()}


def write_rows(path: Path, rows: Iterable[Row]) -> Path:
    """Write rows as JSON lines, whole or not at all; return the path."""
    return write_whole(path, "".join(r.line() + "\n" for r in rows).encode())


def read_rows(path: Path) -> list[Row]:
    """Return the rows of a file; BadInput names the first line that is none."""
    out: list[Row] = []
    content = given_bytes(
        path, MOST_JSON, "give the rows that `sensorless withheld score` has written"
    )
    for k, line in enumerate(content.decode("utf-8", "replace").splitlines(), 1):
        try:
            found = Row(**json.loads(line))
            check_report(found.answer, found.campaign)
            named = all(
                isinstance(text, str)
                for text in (found.method, found.campaign, found.code, found.made)
            )
            sound = named and found.part in PARTS and isinstance(found.truth, dict)
        except (ValueError, TypeError):  # BadInput, too
            sound = False
        if not sound:
            raise BadInput(f"'{path}' line {k} is no row of a check; score its campaigns once more")
        out.append(found)
    return out


def check_seal(rows: Sequence[Row], seal: Mapping[str, Any]) -> None:
    """Raise BadInput where the truth of a row is not what the opened seal says of its campaign."""
    truths = seal["campaigns"]
    for r in rows:
        if r.campaign not in truths or row(
            r.method, r.part, r.campaign, truths[r.campaign], {"failed": ""}
        ).truth != (r.truth):
            raise BadInput(
                f"row of {r.campaign}: its truth is not the sealed one; score the check once more"
            )


def codes(rows: Iterable[Row]) -> tuple[str, ...]:
    """Return the hashes of the code that rows come from."""
    return tuple(sorted({r.code for r in rows}))


def one_code(rows: Sequence[Row], what: str, more: Iterable[str] = ()) -> None:
    """Raise BadInput where rows (and more hashes) come from more than one state of the code."""
    found = sorted({*codes(rows), *more})
    if len(found) > 1:
        counts = ", ".join(f"{c}: {sum(r.code == c for r in rows)}" for c in found)
        raise BadInput(
            f"{what} mixes {len(found)} states of the code ({counts}); diagnose anew with --again, "
            "or give --allow-mixed, which tells the figures of each apart"
        )
