"""Where the gap between recordings and simulator lies, which effect causes it, how far it shrinks."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from dataclasses import replace as replace_fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from sandbox.output.columns import Column, columns_of, write_table
from sandbox.output.files import results, write_json
from sandbox.public.calls import told
from sandbox.public.campaigns.moved import MotionResult, diagnose_motion
from sandbox.public.loading import motion_only, read_campaign
from sandbox.public.result import Result
from sandbox.recordings.campaign import Campaign
from sandbox.recordings.motion_log import motion_of, too_slow
from sandbox.recordings.preflight import further

if TYPE_CHECKING:
    from sandbox.gap.report.answers import Answers
    from sandbox.output.plots import Figure
    from sandbox.output.refitted import Refitted

AnyCampaign = str | Path | Campaign


@dataclass(frozen=True, repr=False)
class DiagnosisResult(Result):
    """Where the gap between recordings and simulator lies, which effect causes it, how far it shrinks."""

    command: ClassVar[str] = "diagnosis"
    answers: Answers

    @property
    def verdict(self) -> str:
        """'no_gap', 'explained', 'ambiguous' or 'unknown'."""
        return self.answers.verdict

    def summary(self) -> str:
        """Return the verdict and the most probable cause."""
        d = self.answers.diagnosis
        cause = ", ".join(d.best.effects) or "no effect"
        return f"{d.campaign.name}, {self.verdict}: {cause}, probability {d.best.probability:.3f}"

    def as_json(self) -> dict[str, Any]:
        """Return what `diagnosis.json` holds beyond its header."""
        from sandbox.gap.report.diagnosis_json import contract

        a = self.answers
        told = contract(a.diagnosis, a.where, a.position, a.following, a.remains, a.alike, a.ranking)
        return told | {"simulator": self.refitted.as_json()}

    @cached_property
    def refitted(self) -> Refitted:
        """The refitted motor and the effects with which the simulator meets the recordings, as files for it."""
        from sandbox.gap.report.simulator import refitted

        return refitted(self.answers.diagnosis)

    def columns(self) -> dict[str, Column]:
        """Return one row a hypothesis and parameter: effects, probability, share of the gap closed, value."""
        rows = []
        for h in self.as_json()["hypotheses"]:
            head = {"effects": ", ".join(h["effects"]), "probability": h["probability"], "closed": h["closed"]}
            none = {"parameter": None, "value": None, "low": None, "high": None, "unit": None}
            own = [
                {"parameter": k, "value": p["value"], "low": p["ci95"][0], "high": p["ci95"][1], "unit": p["unit"]}
                for k, p in h["parameters"].items()
            ]
            rows += [head | one for one in own or [none]]
        return columns_of(rows, {"closed": "of the reducible gap"})

    def plot(self, path: str | Path | None = None) -> Figure:
        """Return the gap of each recording after the best hypothesis; a path is written as well."""
        from sandbox.public.figures import replay_figure

        d = self.answers.diagnosis
        return replay_figure(f"{d.campaign.name}: with {', '.join(d.best.effects) or 'no effect'}",
                             {file: after for file, _, after, _ in d.size.recordings}, path)  # fmt: skip

    def to_rerun(self, path: str | Path) -> Path:
        """Write residuals before and after as a trace (`.rrd`); return its path."""
        from sandbox.gap.report.traces import write_traces

        write_traces(Path(path), self.answers)
        return Path(path)

    def to_html(self, path: str | Path) -> Path:
        """Write the report, one page with its figures inside (`.html`); return its path."""
        from sandbox.gap.report.page import write_report

        write_report(Path(path), self.answers)
        return Path(path)

    def save(self, folder: str | Path, *, csv: bool = False) -> Path:
        """Write diagnosis.json, report.html, diagnosis.rrd, motor.toml and effects.toml into a folder; return it.

        csv: hypotheses, too.
        """
        with results(Path(folder), self.command) as out:
            self.to_html(out / "report.html")
            self.to_rerun(out / "diagnosis.rrd")
            self.refitted.write(out)
            if csv:
                write_table(out / "diagnosis.csv", self.to_table())
            write_json(out, "diagnosis", self.as_json(), "diagnose", self.made_by(out))
        return Path(folder)


@told
def diagnose(
    campaign: AnyCampaign,
    *,
    exclude: Sequence[str] | str = (),
    nominal: str | None = None,
    columns: str | Path | None = None,
    preset: str | None = None,
    jobs: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> DiagnosisResult | MotionResult:
    """Return where the gap between a campaign and its simulator lies, which effect causes it, how far it shrinks.

    Parameters
    ----------
    campaign : str, Path or Campaign
        See `read_campaign`.
    exclude : sequence of str
        Effects that are no candidates (names of `list_effects`).
    nominal : {'linear'}, optional
        Leave the nominal model's saturation out.
    columns : str or Path, optional
        See `read_campaign`.
    preset : str, optional
        See `read_campaign`.
    jobs : int, optional
        Threads; all cores by default.
    progress : callable, optional
        Is told in a few words what is being done.

    Returns
    -------
    DiagnosisResult
        `.verdict`, `.answers.diagnosis.hypotheses` (effects, probability), `.as_json()` as in DIAGNOSIS.md.
        A campaign without voltages, or whose samples stand further apart than L/R, is judged by its motion alone:
        `MotionResult`, of the same `.verdict` and `.as_json()`.

    Raises
    ------
    BadInput
        For a campaign that cannot be read or replayed, or an unknown effect.
    PhysicsError
        Where the nominal model predicts no finite currents.

    Examples
    --------
    >>> from sandbox import diagnose
    >>> diagnose("campaign").verdict  # doctest: +SKIP
    'explained'
    """
    from model.errors import unknown
    from sandbox.gap.report.answers import answer, linear

    if nominal not in (None, "linear"):
        raise unknown("nominal model", nominal, ["linear"])
    names = [exclude] if isinstance(exclude, str) else list(exclude)
    motion = motion_only(campaign, columns, preset)
    if motion is not None:
        return diagnose_motion(motion, names)
    own = read_campaign(campaign, columns, preset=preset)
    if slow := too_slow(own):
        return diagnose_motion(motion_of(own, slow), names)
    if not isinstance(campaign, Campaign):
        own = replace_fields(own, findings=(*own.findings, *further(own)))
    own = linear(own) if nominal else own
    return DiagnosisResult(
        answer(own, exclude=names, workers=jobs or os.cpu_count() or 1, report=progress or (lambda _: None))
    )
