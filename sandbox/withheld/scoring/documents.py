"""The documents that a score reads, checked before anything is judged: stored diagnoses, and what
the seal holds.

Both are JSON that anybody may have edited or a full disk cut short; the first thing wrong is named
by its place.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from model.errors import BadInput, brief
from model.parameters import finite

VERDICTS = ("explained", "ambiguous", "unknown", "no_gap")  # as schemas/diagnosis.json has them
LONGEST = 60.0  # s of a recommended recording
MAX_ENTRIES = 1000  # hypotheses, effects or places of one report


def check_report(content: Any, name: str) -> dict[str, Any]:
    """Return a diagnosis of campaign `name` as judging reads it; BadInput for the first place that
    is wrong."""
    report = _table(content, "the report")
    if report.get("campaign", name) != name:
        raise BadInput(f"it is of campaign {brief(report['campaign'])}")
    if "failed" in report:
        return report
    if _there(report, "verdict") not in VERDICTS:
        raise BadInput(
            f"verdict is {brief(report['verdict'])}; it has to be one of {', '.join(VERDICTS)}"
        )
    gap = _table(_there(report, "gap"), "gap")
    _number(_there(gap, "before"), "gap.before")
    for key in ("raw", "after", "closed"):
        _number(gap.get(key), f"gap.{key}", absent=True)
    _number(report.get("cpu_seconds"), "cpu_seconds", absent=True)
    _table({} if report.get("unknown") is None else report["unknown"], "unknown")
    if not _rows(_there(report, "hypotheses"), "hypotheses"):
        raise BadInput("hypotheses is empty")
    for k, row in enumerate(report["hypotheses"]):
        _check_hypothesis(row, f"hypotheses[{k}]")
    for k, names in enumerate(_rows(_there(report, "ambiguity_set"), "ambiguity_set")):
        _texts(names, f"ambiguity_set[{k}]")
    for k, row in enumerate(_rows(report.get("where", []), "where")):
        _text(_table(row, f"where[{k}]"), "subsystem")
    for k, row in enumerate(_rows(report.get("effects", []), "effects")):
        effect = _table(row, f"effects[{k}]")
        _text(effect, "name")
        _share(_there(effect, "probability"), f"effects[{k}].probability")
        for key, value in _table(effect.get("parameters", {}), f"effects[{k}].parameters").items():
            _table(value, f"effects[{k}].parameters.{key}")
    cost = _table(report.get("cost", {}), "cost")
    for key in ("seconds", "simulations"):
        _number(cost.get(key), f"cost.{key}", absent=True)
    if report.get("next_recording") is not None:
        _check_following(_table(report["next_recording"], "next_recording"))
    return report


def _check_hypothesis(row: Any, where: str) -> None:
    hypothesis = _table(row, where)
    _texts(_there(hypothesis, "effects"), f"{where}.effects")
    _share(_there(hypothesis, "probability"), f"{where}.probability")
    for key, value in _table(hypothesis.get("parameters", {}), f"{where}.parameters").items():
        interval = _table(value, f"{where}.parameters.{key}").get("ci95")
        if interval is None:
            continue
        if not isinstance(interval, list) or len(interval) != 2:
            raise BadInput(f"{where}.parameters.{key}.ci95 = {brief(interval)} is no pair")
        for end in interval:
            _number(end, f"{where}.parameters.{key}.ci95", absent=True)


def _check_following(following: Mapping[str, Any]) -> None:
    if following.get("power") is not None:
        _share(following["power"], "next_recording.power")
    if following.get("entry") is not None:
        _text(following, "entry")
        seconds = _number(_there(following, "seconds"), "next_recording.seconds")
        if not 0.0 < seconds <= LONGEST:
            raise BadInput(f"next_recording.seconds = {seconds:g} is not in (0, {LONGEST:g}]")


def check_truth(content: Any) -> dict[str, Any]:
    """Return what a seal holds; BadInput for the first place that is wrong."""
    truth = _table(content, "the seal")
    for name, row in _table(_there(truth, "campaigns"), "campaigns").items():
        where = f"campaigns.{name}"
        entry = _table(row, where)
        for key in ("kind", "family"):
            _text(entry, key)
        _texts(_there(entry, "effects"), f"{where}.effects")
        sizes = _rows(_there(entry, "sizes"), f"{where}.sizes")
        for size in sizes:
            if not _number(size, f"{where}.sizes") > 0.0:
                raise BadInput(
                    f"{where}.sizes = {brief(size)} is no size; it is a multiple of the "
                    "medium one, above 0"
                )
        if entry["kind"] == "one" and not (len(sizes) == len(entry["effects"]) == 1):
            raise BadInput(
                f"{where} is of one effect, but names {len(entry['effects'])} and "
                f"{len(sizes)} sizes"
            )
        for key, value in _table(_there(entry, "parameters"), f"{where}.parameters").items():
            _number(value, f"{where}.parameters.{key}")
        if entry.get("outside_subsystem") is not None:
            _text(entry, "outside_subsystem")
    return truth


def _there(table: Mapping[str, Any], key: str) -> Any:
    if key not in table:
        raise BadInput(f"'{key}' is missing")
    return table[key]


def _table(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise BadInput(f"{where} = {brief(value)} is no table")
    return value


def _rows(value: Any, where: str) -> list[Any]:
    if not isinstance(value, list) or len(value) > MAX_ENTRIES:
        raise BadInput(f"{where} = {brief(value)} is no list of at most {MAX_ENTRIES}")
    return value


def _text(table: Mapping[str, Any], key: str) -> None:
    if not isinstance(_there(table, key), str):
        raise BadInput(f"{key} = {brief(table[key])} is no text")


def _texts(value: Any, where: str) -> None:
    if not all(isinstance(x, str) for x in _rows(value, where)):
        raise BadInput(f"{where} = {brief(value)} is no list of names")


def _number(value: Any, where: str, absent: bool = False) -> float:
    if value is None and absent:
        return 0.0
    number = finite(value)
    if number is None:
        raise BadInput(f"{where} = {brief(value)} is no finite number")
    return number


def _share(value: Any, where: str) -> None:
    if not 0.0 <= _number(value, where) <= 1.0 + 1e-9:
        raise BadInput(f"{where} = {brief(value)} is no probability")
