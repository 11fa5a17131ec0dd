"""A campaign that knows only the motion, diagnosed: the shaft's part, electrical effects no
candidates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from sandbox.output.columns import Column, columns_of
from sandbox.public.result import Result

if TYPE_CHECKING:
    from sandbox.gap.motion.judging import Motion
    from sandbox.output.plots import AnyAxes, Figure
    from sandbox.recordings.motion_log import MotionCampaign


@dataclass(frozen=True, repr=False)
class MotionResult(Result):
    """Which mechanical effects a motion without voltages shows; `.as_json()` as of any diagnosis,
    with `motion`."""

    command: ClassVar[str] = "diagnosis"
    header: ClassVar[str] = "diagnose"
    kinds: ClassVar[tuple[str, ...]] = ()
    motion: Motion

    @property
    def verdict(self) -> str:
        """'no_gap', 'explained', 'ambiguous' or 'unknown', of the mechanical part alone."""
        from sandbox.gap.motion.telling import verdict

        return verdict(self.motion)

    def summary(self) -> str:
        """Return the verdict and the most probable set."""
        named = ", ".join(self.motion.best.effects) or "no effect"
        return f"{self.motion.campaign.name}, motion only, {self.verdict}: {named}"

    def as_json(self) -> dict[str, Any]:
        """Return what `diagnosis.json` holds beyond its header."""
        from sandbox.gap.motion.telling import document

        return document(self.motion)

    def columns(self) -> dict[str, Column]:
        """Return one row a parameter of the best set: name, value, 95 % interval, unit."""
        from sandbox.gap.motion.telling import parameters

        rows = [
            {
                "parameter": k,
                "value": v["value"],
                "low": v["ci95"][0],
                "high": v["ci95"][1],
                "unit": v["unit"],
            }
            for k, v in parameters(self.motion, self.motion.best).items()
        ]
        return columns_of(
            rows or [{"parameter": None, "value": None, "low": None, "high": None, "unit": None}],
            {},
        )

    def plot(self, path: str | Path | None = None, *, ax: AnyAxes = None) -> Figure:
        """Return each recording's residual over its noise floor; a path is written as well.

        ax: axes of your own to draw in; see `Result.plot`.
        """
        from sandbox.public.figures import replay_figure

        rows = {file: after for file, _, after, _ in self.motion.by_recording}
        return replay_figure(self.summary(), rows, path, ax=ax)

    def to_html(self, path: str | Path) -> Path:
        """Write the report, one page with its figures inside (`.html`); return its path."""
        from sandbox.gap.motion.telling import page
        from sandbox.output.document import write_page
        from sandbox.output.vector import dots_svg

        m = self.motion
        shown = m.by_recording[:40]
        picture = dots_svg(
            [r[0] for r in shown],
            {"before": [r[1] for r in shown], "after": [r[2] for r in shown]},
            f"residual {m.campaign.axis.torque} (noise floors)",
        )
        title = f"{m.campaign.name}: what the motion says"
        write_page(Path(path), title, page(m, title, picture))
        return Path(path)

    def report(self) -> None:
        """Print the answers in sentences, orders of cogging and the residual of each recording as
        tables."""
        from sandbox.gap.motion.telling import cogging_rows, sentences, verdict
        from sandbox.output.sentences import VERDICTS
        from sandbox.output.tables import print_prose, print_table

        m = self.motion
        print_prose(f"{m.campaign.name}, motion only: {VERDICTS[verdict(m)].lower()}")
        for head, text in sentences(m):
            print_prose(text, f"{head:<11} ")
        rows = cogging_rows(m)
        if rows:
            print_table("cogging", ["order", "N m", "A", "phase rad"], rows)
        table = [
            [f + (" (held out)" if h else ""), f"{b:.2f}", f"{a:.2f}"]
            for f, b, a, h in m.by_recording[:20]
        ]
        head = f"residual {m.campaign.axis.torque} over its noise floor (rms)"
        print_table(head, ["recording", "before", "after"], table)
        for finding in m.campaign.findings:
            print_prose(f"note: {finding.text}")

    def _write_more(self, out: Path) -> dict[str, Any]:
        """Write report.html and effects.toml."""
        from sandbox.gap.motion.telling import refitted

        self.to_html(out / "report.html")
        refitted(self.motion).write(out)
        return {}


def diagnose_motion(campaign: MotionCampaign, exclude: Sequence[str] = ()) -> MotionResult:
    """Return which mechanical effects a campaign's motion shows; BadInput where it hardly moves."""
    from sandbox.gap.motion.judging import judge

    return MotionResult(judge(campaign, exclude))
