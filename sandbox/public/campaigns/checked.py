"""The pre-flight: what is wrong or suspicious in a campaign, and which effects its recordings could
tell."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from model.drive_files import load_limits
from model.effects.library import effect_names, load_effect
from model.errors import BadInput
from model.parameters import Drive
from model.ratings import assumed, cautions
from sandbox.gap.motion.checked import noticed_in_motion, shaft_contradicted
from sandbox.output.columns import Column, columns_of, table_of, write_table
from sandbox.output.files import CORRECTED
from sandbox.output.tables import many, print_prose, print_table
from sandbox.public.calls import records_call
from sandbox.public.campaigns import drafting
from sandbox.public.campaigns.exchanged import asking, exchanged
from sandbox.public.loading import AnyCampaign, load_motor
from sandbox.public.result import Result
from sandbox.recordings import importing, motion_log
from sandbox.recordings.campaign import NO_LIMITS, Campaign
from sandbox.recordings.findings import Finding, Unanswered
from sandbox.recordings.importing import Source, how_to_map
from sandbox.recordings.nominal_motor import RATED
from sandbox.recordings.preflight import NOTE, REFUSED, SUSPICIOUS, Noticed, noticed, tried
from sandbox.recordings.rows.held import HeldReadings

if TYPE_CHECKING:
    from sandbox.gap.planning.bench_plan import Plan
    from sandbox.gap.planning.visible import Visible
    from sandbox.output.plots import AnyAxes, Figure

# scales of typical sizes that need a rated speed
OF_SPEED = ("rated reactance", "rated torque / rated speed")
REPEATS = 2  # of each planned recording: one is fitted, one held out


@dataclass(frozen=True, repr=False)
class CheckResult(Result):
    """What a pre-flight found; `visible` is None where the recordings cannot be replayed, `why`
    says why."""

    command: ClassVar[str] = "check"
    kinds: ClassVar[tuple[str, ...]] = ()
    name: str
    noticed: tuple[Noticed, ...]
    visible: Visible | None
    why: str
    draft: str = ""  # of a column map, where a folder holds tables that nothing describes
    # effects of no known size, and what is missing
    cannot: Mapping[str, str] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        """Whether nothing stops the campaign."""
        return not any(n.level == REFUSED for n in self.noticed)

    @property
    def mistakes(self) -> tuple[str, ...]:
        """What stops the campaign or is suspicious, each in a sentence."""
        return tuple(n.finding.text for n in self.noticed if n.level != NOTE)

    def words(self, effect: str) -> str:
        """Return whether an effect is 'clear', 'faint' or 'not' visible, or why nobody can say."""
        if effect in self.cannot:
            return f"cannot say, {self.cannot[effect]} is missing"
        return "" if self.visible is None else self.visible.words(effect)

    def summary(self) -> str:
        """Return how much was found."""
        refused = sum(n.level == REFUSED for n in self.noticed)
        return f"{self.name}, {refused} refused, {len(self.mistakes) - refused} suspicious"

    def as_json(self) -> dict[str, Any]:
        """Return what `check.json` holds beyond its header."""
        v = self.visible
        effects = (
            []
            if v is None
            else [
                {"name": e, "deviations": None if e in self.cannot else z, "visible": self.words(e)}
                for e, z in v.sizes.items()
            ]
        )
        return {
            "campaign": self.name,
            "ok": self.ok,
            "findings": [
                {
                    "level": n.level,
                    "file": n.finding.file,
                    "column": n.finding.column,
                    "row": n.finding.row,
                    "text": n.finding.text,
                }
                for n in self.noticed
            ],
            "effects": effects,
            "effects_unknown_because": self.why or None,
            "alike": [] if v is None else [list(pair) for pair in v.alike],
        }

    def columns(self) -> dict[str, Column]:
        """Return one row a finding: level, file, column, row, text."""
        rows = self.as_json()["findings"] or [
            dict.fromkeys(("level", "file", "column", "row", "text"))
        ]
        return columns_of(rows, {})

    def plot(self, path: str | Path | None = None, *, ax: AnyAxes = None) -> Figure:
        """Return how many standard deviations a typical size of each effect is worth; a path is
        written as well.

        ax: axes of your own to draw in; see `Result.plot`.
        """
        from sandbox.public.figures import replay_figure

        sizes = {} if self.visible is None else self.visible.sizes
        return replay_figure(
            f"{self.name}: typical size of effects / what recordings leave of it",
            sizes,
            path,
            ax=ax,
        )

    def report(self) -> None:
        """Print the findings and what the recordings could tell."""
        words = {"refused": "REFUSED", "suspicious": "suspicious", "note": "note"}
        for n in self.noticed:
            print_prose(f"{words[n.level]}: {n.finding.text}")
        if not self.mistakes:
            print_prose(f"{self.name}: nothing wrong or suspicious")
        if self.visible is None:
            print_prose(self.why)
            if self.draft:
                print_prose(
                    "a draft of a column map, from the tables' own columns: "
                    f"{drafting.NAME} among the results"
                )
                print_prose(
                    f"(one of an earlier call that differs is kept as {CORRECTED[drafting.NAME]})"
                )
            return
        v = self.visible
        sized = [e for e in v.sizes if e not in self.cannot]
        rows = [
            [e, deviations_text(v.sizes[e]) if e in sized else "–", self.words(e)]
            for e in [*sized, *self.cannot]
        ]
        print_table("effects at typical size", ["effect", "standard deviations", "visible"], rows)
        for a, b, cosine in v.alike[:6]:
            print_prose(f"{a} and {b} look alike on these recordings (cosine {cosine:.3f})")

    def _write_more(self, out: Path) -> dict[str, Any]:
        """Write a draft of a column map, columns.toml, where tables are there that nothing
        describes."""
        if self.draft:
            (out / drafting.NAME).write_text(self.draft, encoding="utf-8")
        return {}


def deviations_text(z: float) -> str:
    """Return standard deviations as a person reads them, 0 where none of the digits would show."""
    return f"{z:.0f}" if z >= 100.0 else f"{z:.3g}" if z >= 0.005 else "0"


@records_call
def check(
    campaign: AnyCampaign,
    *,
    columns: str | Path | None = None,
    preset: str | None = None,
    effects: bool = True,
    jobs: int = 1,
) -> CheckResult:
    """Return all that is wrong or suspicious in a campaign, and which effects its recordings could
    tell.

    Parameters
    ----------
    campaign : str, Path or Campaign
        See `read_campaign`.
    columns : str or Path, optional
        See `read_campaign`.
    preset : str, optional
        See `read_campaign`.
    effects : bool
        Whether to work out, from an excerpt of each recording, which effects would be visible at
        typical size.
    jobs : int
        Threads.

    Returns
    -------
    CheckResult
        `.ok`, `.mistakes` (sentences), `.visible.sizes` (standard deviations that a typical size is
        worth).

    Raises
    ------
    BadInput
        Where there is no campaign at that place.

    Examples
    --------
    >>> import tempfile
    >>> from sandbox import check, simulate
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     run = simulate("ipm_exchanged", duration=0.2, record=f"{folder}/mine")
    ...     check(f"{folder}/mine", effects=False).mistakes
    ()
    """
    name, source, read, found, why = _read(campaign, columns, preset)
    found += [] if read is None else noticed(read)
    found = _exchanged(source, found, read is None)
    if read is not None and not any(n.level == REFUSED for n in found):
        old = any(isinstance(n.finding, HeldReadings) for n in found)
        found += [] if old else _of_noise(read)
        found += tried("", lambda: shaft_contradicted(read))
    if columns is None and preset is None and not isinstance(campaign, Campaign):
        found = [
            replace(n, finding=replace(n.finding, text=how_to_map(n.finding.text))) for n in found
        ]
    if read is None:
        return CheckResult(name, tuple(found), None, why, _draft(campaign, columns))
    if not any(n.level == REFUSED for n in found):
        found += [*_of_stand_ins(read), *_of_identify(read)]
    if any(n.level == REFUSED for n in found) or not effects:
        return CheckResult(
            read.name, tuple(found), None, "the recordings cannot be replayed as they are" * effects
        )
    from sandbox.gap.planning.visible import visible

    try:
        seen = visible(read, workers=jobs)
        cannot = {e: k for e, k in _of_no_size(read).items() if e in seen.sizes}
        return CheckResult(read.name, tuple(found), seen, "", cannot=cannot)
    except BadInput as error:
        found.append(Noticed(REFUSED, Finding(read.name, "", None, str(error))))
        return CheckResult(read.name, tuple(found), None, str(error))


def _exchanged(source: Source | None, found: list[Noticed], motion: bool) -> list[Noticed]:
    """Return what was found, or the columns that are exchanged in its place where these are its
    cause."""
    stated = asking(found, motion)
    finding = exchanged(source, stated) if source is not None and stated else None
    if finding is None:
        return found
    notes = [n for n in found if n.level == NOTE and not isinstance(n.finding, Unanswered)]
    return [Noticed(REFUSED, finding), *notes]


def _of_identify(campaign: Campaign) -> list[Noticed]:
    """Return why `identify` would refuse a campaign's locked recordings with injection, or not read
    levels in them. Of a motor with a flux map nothing: it has no alphas, which levels tell."""
    staircase = any(r.rotor == "locked" and r.injection_axis != "none" for r in campaign.recordings)
    if not staircase or campaign.drive.motor.has_map:
        return []
    from model.levels import NoStaircase, require_information
    from sandbox.recordings.staircase import levels_of

    try:
        require_information(levels_of(campaign))
    except NoStaircase as error:
        text = (
            "identify would take these as ordinary recordings, and tell R, inductances "
            f"and flux, saturation as beside them alone: {error}"
        )
        return [Noticed(NOTE, Finding(campaign.name, "", None, text))]
    except BadInput as error:
        text = f"identify would refuse these recordings: {error}"
        return [Noticed(NOTE, Finding(campaign.name, "", None, text))]
    return []


def _of_stand_ins(campaign: Campaign) -> list[Noticed]:
    """Return which ratings [motor] does not state, and what stands in for them."""
    motor, own = campaign.drive.motor, campaign.drive.provenance
    said = [
        f"{k} = {getattr(motor, k):.3g} ({own[k].rpartition(': ')[2]})"
        for k in RATED
        if k in campaign.stand_ins
    ]
    if not said:
        return []
    text = (
        f"{campaign.name}: [motor] does not state {', '.join(k.partition(' ')[0] for k in said)}; "
        f"{'these values stand' if len(said) > 1 else 'this value stands'} in: {', '.join(said)}. "
        "Typical sizes of effects are shares of them"
    )
    return [Noticed(NOTE, Finding(campaign.name, "", None, text))]


def _of_no_size(campaign: Campaign) -> dict[str, str]:
    """Return the effects whose typical size depends on a rated speed that nothing states and no
    recording reached."""
    speed = "rated_speed_rpm"
    if speed not in campaign.stand_ins or any(r.rotor != "locked" for r in campaign.recordings):
        return {}
    cards = (load_effect(e) for e in effect_names())
    return {c.name: speed for c in cards if any(p.relative_to in OF_SPEED for p in c.parameters)}


def _of_noise(campaign: Campaign) -> list[Noticed]:
    """Return what is said where the stated noise of the current sensors is far from what their
    readings show."""
    from sandbox.gap.evidence.noise import far_apart, noise_caution, noise_of

    own = noise_of(campaign)
    try:
        text = noise_caution(campaign, own)
    except BadInput as error:
        return [Noticed(REFUSED, Finding(campaign.name, "", None, str(error)))]
    return [Noticed(SUSPICIOUS, Finding(campaign.name, "", None, text))] if far_apart(own) else []


@dataclass(frozen=True, repr=False)
class PlanResult(Result):
    """What to record on a bench: experiments in their order, each with what it adds, and setpoints
    over time."""

    command: ClassVar[str] = "plan"
    kinds: ClassVar[tuple[str, ...]] = ("page",)
    plan: Plan

    def summary(self) -> str:
        """Return the experiments' names."""
        return f"{self.plan.drive.name}: {', '.join(p.entry.name for p in self.plan.experiments)}"

    def as_json(self) -> dict[str, Any]:
        """Return what `plan.json` holds beyond its header."""
        v = self.plan.together
        return {
            "motor": self.plan.drive.name,
            "recordings": [
                {
                    "name": p.entry.name,
                    "description": p.entry.description,
                    "rotor": p.entry.rotor,
                    "seconds": p.entry.seconds,
                    "settings": p.settings,
                    "repeats": REPEATS,
                    "tells": list(p.tells),
                    "adds": list(p.adds),
                    "setpoints": f"{p.entry.name}.csv",
                }
                for p in self.plan.experiments
            ],
            "together_adds": list(self.plan.adds),
            "dc_link": self.plan.link,
            "cautions": [*cautions(self.plan.drive), *assumed(self.plan.drive)],
            "effects": [
                {"name": e, "deviations": z, "visible": v.words(e)} for e, z in v.sizes.items()
            ],
            "alike": [list(pair) for pair in v.alike],
        }

    def columns(self) -> dict[str, Column]:
        """Return one row an experiment: name, rotor, seconds, settings, what it adds."""
        rows = [
            {
                "name": p.entry.name,
                "rotor": p.entry.rotor,
                "seconds": p.entry.seconds,
                "settings": p.settings,
                "adds": ", ".join(p.adds),
            }
            for p in self.plan.experiments
        ]
        return columns_of(rows, {"seconds": "s"})

    def plot(self, path: str | Path | None = None, *, ax: AnyAxes = None) -> Figure:
        """Return how many standard deviations a typical size of each effect is worth; a path is
        written as well.

        ax: axes of your own to draw in; see `Result.plot`.
        """
        from sandbox.public.figures import replay_figure

        return replay_figure(
            f"{self.plan.drive.name}: what the planned recordings tell",
            self.plan.together.sizes,
            path,
            ax=ax,
        )

    def to_html(self, path: str | Path) -> Path:
        """Write the plan as one page (`.html`), its setpoints drawn over time; return it."""
        from sandbox.gap.pages.plan_page import write_plan

        write_plan(Path(path), self.plan, REPEATS)
        return Path(path)

    def report(self) -> None:
        """Print the experiments and what stays alike."""
        from sandbox.gap.pages.plan_page import NEXT
        from sandbox.public.printed import print_cautions

        print_prose(
            f"{self.plan.drive.name}: record each of these {REPEATS} times, one to be "
            "fitted and one to be held out"
        )
        for k, p in enumerate(self.plan.experiments, 1):
            print_prose(
                f"{p.entry.name} ({p.entry.seconds:.3g} s): {p.entry.description}; {p.settings}",
                f"{k}. ",
            )
            beyond = f", {len(p.adds)} of them not told by those before it" if k > 1 else ""
            print_prose(f"tells {many(len(p.tells), 'effect')}{beyond}: {', '.join(p.adds)}", "   ")
        print_prose(self.plan.link)
        v = self.plan.together
        if self.plan.adds:
            print_prose(f"told by all of them together, by none alone: {', '.join(self.plan.adds)}")
        for word, said in (("faint", "only faintly told"), ("not", "not told")):
            names = ", ".join(e for e in v.sizes if v.words(e) == word)
            if names or word == "not":
                print_prose(f"{said}: {names or 'none of the library' + chr(39) + 's effects'}")
        for a, b, cosine in v.alike[:6]:
            print_prose(f"{a} and {b} still look alike (cosine {cosine:.3f})")
        print_cautions(self.plan.drive)
        print_prose(NEXT)

    def _write_more(self, out: Path) -> dict[str, Any]:
        """Write one table of setpoints an experiment."""
        from sandbox.gap.planning.bench_plan import setpoints

        for p in self.plan.experiments:
            write_table(
                out / f"{p.entry.name}.csv",
                table_of(columns_of(setpoints(p.entry, self.plan.drive), {})),
            )
        return {}


@records_call
def plan(
    motor: str | Path | Drive = "ipm_exchanged",
    *,
    current: float | None = None,
    speed_rpm: float | None = None,
    voltage: float | None = None,
    can: Sequence[str] | None = None,
    fixed_link: bool | None = None,
    jobs: int = 1,
    progress: Callable[[float], None] | None = None,
) -> PlanResult:
    """Return what to record on a bench so that a diagnosis can tell effects apart, by simulating
    the nominal motor.

    Parameters
    ----------
    motor : str, Path or Drive
        See `load_motor`: the nominal model, its converter and sensors.  `[limits]` of its file
        holds the bench's limits under the names below; what is given here comes before it.
    current : float, optional
        A peak, the bench's limit; the motor's rated current by default.
    speed_rpm : float, optional
        Its limit of speed; the rated one by default.
    voltage : float, optional
        V of the DC link; that of the drive by default.
    can : sequence of str
        What the bench can do with the rotor: 'locked', 'driven', 'free'; all of them by default.
    fixed_link : bool, optional
        Whether the link's voltage cannot be changed: no experiment then asks for another one.
    jobs : int
        Threads.
    progress : callable, optional
        Called with the share (0 to 1) that is done.

    Returns
    -------
    PlanResult
        `.plan.experiments` (settings, seconds, effects told), `.as_json()`.

    Raises
    ------
    BadInput
        Where the limits leave no experiment.

    Examples
    --------
    >>> from sandbox import plan
    >>> plan("ipm_exchanged", can=("locked",)).plan.experiments[0].entry.rotor  # doctest: +SKIP
    'locked'
    """
    from sandbox.gap.planning.bench_plan import plan as planned

    drive = load_motor(motor)
    limits = NO_LIMITS if isinstance(motor, Drive) else load_limits(motor)
    given = {
        "current": current,
        "speed_rpm": speed_rpm,
        "voltage": voltage,
        "can": can,
        "fixed_link": fixed_link,
    }
    try:
        limits = dataclasses.replace(limits, **{k: v for k, v in given.items() if v is not None})  # type: ignore[arg-type]
    except BadInput as error:
        raise BadInput(str(error).replace("[limits] ", "")) from None  # these stand in no file
    return PlanResult(planned(drive, limits, workers=jobs, progress=progress))


class Read(NamedTuple):
    """A campaign's name, its source (None where it has none), the campaign (None where it cannot be
    read, or only its motion can be judged), what was found on the way, and why it is None."""

    name: str
    source: Source | None
    campaign: Campaign | None
    found: list[Noticed]
    why: str


def _read(campaign: AnyCampaign, columns: str | Path | None, preset: str | None) -> Read:
    """Return a campaign as it could be read."""
    if isinstance(campaign, Campaign):
        return Read(campaign.name, None, campaign, [], "")
    path = Path(campaign)
    if not path.exists():
        raise BadInput(f"campaign '{path}' does not exist; give its folder, or one table in it")
    name = path.resolve().name
    importing.check_asked(columns, preset)
    source = None
    try:
        source = importing.source_of(path, None if columns is None else Path(columns), preset)
        why = motion_log.motion_only(source)
        if why is not None:
            motion = motion_log.read_motion(source, why)
            return Read(motion.name, source, None, noticed_in_motion(motion), why)
        return Read(name, source, importing.unchecked(source), [], "")
    except BadInput as error:
        found = [Noticed(REFUSED, Finding(name, "", None, str(error)))]
        return Read(name, source, None, found, "the campaign cannot be read")


def _draft(campaign: AnyCampaign, columns: str | Path | None) -> str:
    """Return a draft of a column map where a folder holds tables and nothing that describes
    them."""
    if isinstance(campaign, Campaign) or columns is not None:
        return ""
    folder = Path(campaign) if Path(campaign).is_dir() else Path(campaign).parent
    return "" if (folder / "campaign.toml").is_file() else drafting.draft(folder)
