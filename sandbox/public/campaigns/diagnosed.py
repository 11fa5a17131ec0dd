"""Where the gap between recordings and simulator lies, which effect causes it, how far it
shrinks."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from dataclasses import replace as replace_fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from model.effects.library import load_effect
from model.errors import BadInput
from model.given import MOST_JSON, given_bytes
from sandbox.gap.motion.checked import shaft_contradicted
from sandbox.output.columns import Column, columns_of
from sandbox.output.tables import print_prose
from sandbox.public.calls import records_call
from sandbox.public.campaigns.moved import MotionResult, diagnose_motion
from sandbox.public.loading import AnyCampaign, motion_only, read_campaign
from sandbox.public.result import Result
from sandbox.recordings.campaign import Campaign
from sandbox.recordings.motion_log import motion_of, too_slow, with_replayable
from sandbox.recordings.preflight import further

if TYPE_CHECKING:
    from sandbox.gap.planning.bench_table import BenchTable
    from sandbox.gap.report.answers import Answers
    from sandbox.output.plots import AnyAxes, Figure
    from sandbox.output.refitted import Refitted


@dataclass(frozen=True, repr=False)
class DiagnosisResult(Result):
    """Where the gap between recordings and simulator lies, which effect causes it, how far it
    shrinks."""

    command: ClassVar[str] = "diagnosis"
    header: ClassVar[str] = "diagnose"
    kinds: ClassVar[tuple[str, ...]] = ()
    answers: Answers
    # the earlier diagnosis: its verdict, ambiguity set, recommendation
    continued: Mapping[str, Any] | None = None

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
        from sandbox.gap.planning.bench_table import NAME
        from sandbox.gap.report.diagnosis_json import document

        a = self.answers
        content = document(
            a.diagnosis, a.where, a.position, a.following, a.remains, a.alike, a.ranking
        )
        if self.table is not None and content["next_recording"] is not None:
            content["next_recording"] |= {
                "table": NAME,
                "recording": dict(self.table.recording),
                "limits": dict(self.table.limits),
            }
        drifts = a.diagnosis.drifting
        content["recording_offsets"] = None if drifts is None else drifts.as_json()
        rounds = a.diagnosis.counted
        content["pwm_counts"] = None if rounds is None else rounds.as_json()
        content["held_by_readings"] = a.diagnosis.held_by or None
        content["flux_map"] = None if a.map_found is None else asdict(a.map_found)
        content["curves"] = [asdict(c) for c in a.curves]
        content["odd_phase"] = None if a.odd_phase is None else asdict(a.odd_phase)
        return content | {"simulator": self.refitted.as_json(), "continued": self.continued}

    @cached_property
    def table(self) -> BenchTable | None:
        """The recommended recording as a bench can play it; None where none is recommended."""
        from sandbox.gap.planning.bench_table import bench_table

        following, drive = self.answers.following, self.refitted.drive
        return (
            None
            if following is None or drive is None
            else bench_table(self.campaign, following, drive)
        )

    @property
    def campaign(self) -> Campaign:
        """What was diagnosed."""
        return self.answers.diagnosis.campaign

    @cached_property
    def refitted(self) -> Refitted:
        """The refitted motor and the effects with which the simulator meets the recordings, as
        files for it."""
        from sandbox.gap.report.simulator import refitted

        return refitted(self.answers.diagnosis)

    def columns(self) -> dict[str, Column]:
        """Return one row a hypothesis and parameter: effects, probability, share of the gap closed,
        value."""
        rows = []
        for h in self.as_json()["hypotheses"]:
            head = {
                "effects": ", ".join(h["effects"]),
                "probability": h["probability"],
                "closed": h["closed"],
            }
            none = {"parameter": None, "value": None, "low": None, "high": None, "unit": None}
            own = [
                {
                    "parameter": k,
                    "value": p["value"],
                    "low": p["ci95"][0],
                    "high": p["ci95"][1],
                    "unit": p["unit"],
                }
                for k, p in h["parameters"].items()
            ]
            rows += [head | one for one in own or [none]]
        return columns_of(rows, {"closed": "of the reducible gap"})

    def plot(self, path: str | Path | None = None, *, ax: AnyAxes = None) -> Figure:
        """Return the gap of each recording after the best hypothesis; a path is written as well.

        ax: axes of your own to draw in; see `Result.plot`.
        """
        from sandbox.public.figures import replay_figure

        d = self.answers.diagnosis
        return replay_figure(
            f"{d.campaign.name}: with {', '.join(d.best.effects) or 'no effect'}",
            {file: after for file, _, after, _ in d.size.recordings},
            path,
            ax=ax,
        )

    def to_rerun(self, path: str | Path) -> Path:
        """Write residuals before and after as a trace (`.rrd`); return its path."""
        from sandbox.gap.pages.traces import write_traces

        write_traces(Path(path), self.answers)
        return Path(path)

    def to_html(self, path: str | Path) -> Path:
        """Write the report, one page with its figures inside (`.html`); return its path."""
        from sandbox.gap.pages.page import write_report

        write_report(Path(path), self.answers)
        return Path(path)

    def report(self) -> None:
        """Print the answers, what became of an earlier one, and which files go on from here."""
        from sandbox.gap.pages.page import print_answers

        print_answers(self.answers)
        if self.continued is not None:
            left = "; or ".join(
                " + ".join(s) or "no effect" for s in self.continued["ambiguity_set"]
            )
            print_prose(f"The earlier diagnosis said: {self.continued['verdict']} ({left}).")
        best = self.answers.diagnosis.best
        found = best.effects
        if best.evaluated.effects and any(e != "unknown" for e in found):
            but = ": what is outside the library is not in it" if "unknown" in found else ""
            print_prose(
                "For a simulator that has what was found, give motor.toml and effects.toml to "
                f"--motor and --effects{but}."
            )
        else:
            alone = self.answers.diagnosis.offsets_named
            print_prose(
                "Nothing was found to simulate: motor.toml holds ordinary deviations alone"
                f"{', effects.toml the offsets, which `sensorless replay` takes off' * alone}."
            )
        if self.table is not None:
            print_prose(
                "next_recording.csv is the recording to make next; add it to the campaign and "
                "--continue from this result."
            )

    def _write_more(self, out: Path) -> dict[str, Any]:
        """Write report.html, diagnosis.rrd, motor.toml, effects.toml, and next_recording.csv where
        one is advised."""
        from sandbox.gap.planning.bench_table import NAME, write_bench_table

        self.to_html(out / "report.html")
        self.to_rerun(out / "diagnosis.rrd")
        self.refitted.write(out)
        if self.table is not None and self.answers.following is not None:
            write_bench_table(out / NAME, self.table, self.answers.following)
        return {}


@records_call
def diagnose(
    campaign: AnyCampaign,
    *,
    exclude: Sequence[str] | str = (),
    nominal: str | None = None,
    columns: str | Path | None = None,
    preset: str | None = None,
    earlier: str | Path | None = None,
    jobs: int | None = None,
    memory: float | None = None,
    samples: float | None = None,
    progress: Callable[[str], None] | None = None,
) -> DiagnosisResult | MotionResult:
    """Return where the gap between a campaign and its simulator lies, which effect causes it, how
    far it shrinks.

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
    earlier : str or Path, optional
        Folder of an earlier diagnosis of this drive (or its diagnosis.json), to go on from once
        further recordings are in the campaign: every set of effects that it left is weighed again,
        whatever the search comes upon.
    jobs : int, optional
        Threads; all cores by default.
    memory : float, optional
        GB that the diagnosis may take (8); at least 0.7 and 0.7 kB a sample. Slopes that do not fit
        wait in a file in TMPDIR (/var/tmp), about 1.5 kB a sample; the answer is the same. A free
        regression of what remains, which takes 14 kB a sample, is then made on a part of each
        recording, and the report says so.
    samples : float, optional
        Use at most so many samples; `math.inf` for all. By default all of them up to 250 000, else
        100 000: parts of the recordings, in which currents, speed, voltage, link and load differ
        most, and some spread evenly. `.as_json()["excerpts"]` lists them.
    progress : callable, optional
        Is told in a few words what is being done.

    Returns
    -------
    DiagnosisResult
        `.verdict`, `.answers.diagnosis.hypotheses` (effects, probability), `.as_json()` as
        `diagnosis.json` has it. A campaign without voltages, or whose samples stand further apart
        than L/R, is judged by its motion alone: `MotionResult`, of the same `.verdict` and
        `.as_json()`.

    Raises
    ------
    BadInput
        For a campaign that cannot be read or replayed, an unknown effect, or a campaign too long
        for the memory.
    PhysicsError
        Where the nominal model predicts no finite currents.

    Examples
    --------
    >>> from sandbox import diagnose
    >>> diagnose("campaign").verdict  # doctest: +SKIP
    'explained'
    """
    from model.effects.library import effect_names
    from model.errors import unknown
    from sandbox.gap.by_recording import with_offsets
    from sandbox.gap.excerpts import check_samples, excerpted
    from sandbox.gap.report.answers import answer, linear
    from sandbox.replay.memory import USUAL, check_memory

    if nominal not in (None, "linear"):
        raise unknown("nominal model", nominal, ["linear"])
    check_samples(samples)
    before = None if earlier is None else earlier_answer(earlier)
    names = [exclude] if isinstance(exclude, str) else list(exclude)
    for name in names:
        if name not in effect_names():
            raise unknown("effect", name, effect_names())
    check_memory(USUAL if memory is None else memory)
    motion = motion_only(campaign, columns, preset)
    if motion is not None:
        return diagnose_motion(motion, names)
    own = with_replayable(read_campaign(campaign, columns, preset=preset))
    if not isinstance(campaign, Campaign):
        own = replace_fields(own, findings=(*own.findings, *further(own)))
    if slow := too_slow(own):
        return diagnose_motion(motion_of(own, slow), names)
    if not isinstance(campaign, Campaign):
        own = replace_fields(own, findings=(*own.findings, *shaft_contradicted(own)))
    own = excerpted(linear(own) if nominal else own, samples)
    rivals = [] if before is None else [s for s in before["rivals"] if not set(s) & set(names)]
    found = with_offsets(
        answer(
            own,
            exclude=names,
            rivals=rivals,
            workers=jobs or os.cpu_count() or 1,
            memory=USUAL if memory is None else memory,
            report=progress or (lambda _: None),
        )
    )
    return DiagnosisResult(found, None if before is None else before["said"])


def earlier_answer(place: str | Path) -> dict[str, Any]:
    """Return an earlier diagnosis: `said`, what it said, and `rivals`, the sets it left; BadInput
    where it is none."""
    from sandbox.gap.posterior.hypotheses import UNKNOWN

    path = Path(place)
    path = path / "diagnosis.json" if path.is_dir() else path
    remedy = "give the folder that an earlier `sensorless diagnose` wrote"
    text = given_bytes(path, MOST_JSON, remedy)
    try:
        content = json.loads(text)
        sets = [
            tuple(sorted(str(e) for e in one if e != UNKNOWN)) for one in content["ambiguity_set"]
        ]
        said = {
            "verdict": str(content["verdict"]),
            "ambiguity_set": content["ambiguity_set"],
            "recommended": (content["next_recording"] or {}).get("entry"),
        }
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise BadInput(f"'{path}' is no diagnosis.json; {remedy}") from None
    for name in {e for one in sets for e in one}:
        load_effect(name)
    return {"said": said, "rivals": list(dict.fromkeys(one for one in sets if one))}
