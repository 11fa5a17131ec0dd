"""What recordings of a bench say: the motor, the gap to the simulator and its cause, a replay of chosen effects."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from dataclasses import replace as replace_fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from model.effects.library import parse
from sandbox.output.columns import Column, columns_of, write_table
from sandbox.output.files import results, write_json
from sandbox.public.calls import told
from sandbox.public.loading import motion_only, read_campaign
from sandbox.public.moved import MotionResult, diagnose_motion
from sandbox.public.result import Result
from sandbox.recordings.campaign import Campaign
from sandbox.recordings.motion_log import motion_of, too_slow
from sandbox.recordings.preflight import further

if TYPE_CHECKING:
    from sandbox.gap.report.answers import Answers
    from sandbox.output.plots import Figure
    from sandbox.recordings.identify import Identification
    from sandbox.replay.replay import Prediction, Prepared

AnyCampaign = str | Path | Campaign


@dataclass(frozen=True, repr=False)
class IdentificationResult(Result):
    """The motor that locked-rotor recordings show, by the paper's least squares and by the exact fit."""

    command: ClassVar[str] = "identify"
    identification: Identification

    def summary(self) -> str:
        """Return the campaign, and what each fit leaves."""
        found = self.identification
        left = ", ".join(f"{name} {1e3 * fit.residual_rms:.3g} mA rms" for name, fit in found.fits.items())
        return f"{found.campaign.name}, {len(found.levels.axis)} levels, left by the fits: {left}"

    def as_json(self) -> dict[str, Any]:
        """Return what `identify.json` holds beyond its header and the names of files."""
        return self.identification.as_json()

    def columns(self) -> dict[str, Column]:
        """Return one row a parameter and method: value, 95 % interval, unit."""
        rows = [
            {"method": method, "parameter": name, "value": p["value"], "low": p["ci95"][0], "high": p["ci95"][1],
             "unit": p["unit"]}
            for method, fit in self.as_json()["methods"].items() for name, p in fit["parameters"].items()
        ]  # fmt: skip
        return columns_of(rows, {})

    def plot(self, path: str | Path | None = None) -> Figure:
        """Return measured slopes and the fits through them over current; a path is written as well."""
        from sandbox.public.figures import identification_figure

        return identification_figure(self.identification, path)


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
        return contract(a.diagnosis, a.where, a.position, a.following, a.remains, a.alike, a.ranking)

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
        from sandbox.gap.pages.traces import write_traces

        write_traces(Path(path), self.answers)
        return Path(path)

    def to_html(self, path: str | Path) -> Path:
        """Write the report, one page with its figures inside (`.html`); return its path."""
        from sandbox.gap.pages.page import write_report

        write_report(Path(path), self.answers)
        return Path(path)

    def save(self, folder: str | Path, *, csv: bool = False) -> Path:
        """Write diagnosis.json, report.html and diagnosis.rrd (csv: hypotheses, too) into a folder; return it."""
        with results(Path(folder), self.command) as out:
            self.to_html(out / "report.html")
            self.to_rerun(out / "diagnosis.rrd")
            if csv:
                write_table(out / "diagnosis.csv", self.to_table())
            write_json(out, "diagnosis", self.as_json(), "diagnose", self.made_by(out))
        return Path(folder)


@dataclass(frozen=True, repr=False)
class ReplayResult(Result):
    """What the simulator says to a campaign's own voltages with chosen effects, beside what was measured."""

    command: ClassVar[str] = "replay"
    prepared: Prepared
    prediction: Prediction
    effects: Mapping[str, float]
    rms: Mapping[str, float]  # of each recording's current residual, over its noise floor: 1 is noise alone

    def summary(self) -> str:
        """Return the worst recording."""
        file = max(self.rms, key=lambda name: self.rms[name])
        return (
            f"{self.prepared.campaign.name}, {len(self.rms)} recordings, {file} {self.rms[file]:.3g} noise floors off"
        )

    def as_json(self) -> dict[str, Any]:
        """Return campaign, effects, noise floor (A) and each recording's rms over it."""
        return {
            "campaign": self.prepared.campaign.name, "effects": dict(self.effects), "floor": self.prepared.floor,
            "recordings": [{"file": file, "rms": value} for file, value in self.rms.items()],
        }  # fmt: skip

    def columns(self) -> dict[str, Column]:
        """Return measured and simulated currents, one row a sample: file, t (s), i_a .. (A), i_a_simulated .. (A)."""
        parts: dict[str, list[Any]] = {}
        for inputs, predicted in zip(self.prepared.recordings, self.prediction.currents, strict=True):
            own = self.prepared.campaign[inputs.file]
            n = len(predicted)
            parts.setdefault("file", []).append(np.full(n, inputs.file))
            parts.setdefault("t", []).append(own.t[:n])
            for k, phase in enumerate("abc"):
                parts.setdefault(f"i_{phase}", []).append(own[f"i_{phase}"][:n])
                parts.setdefault(f"i_{phase}_simulated", []).append(predicted[:, k, 0])
        units = {"file": "", "t": "s"}
        return {
            k: Column(list(np.concatenate(v)) if k == "file" else np.concatenate(v), units.get(k, "A"))
            for k, v in parts.items()
        }

    def plot(self, path: str | Path | None = None) -> Figure:
        """Return the rms of each recording's residual over its noise floor; a path is written as well."""
        from sandbox.public.figures import replay_figure

        named = ", ".join(f"{k} = {v:g}" for k, v in self.effects.items()) or "the nominal model"
        return replay_figure(f"{self.prepared.campaign.name}: {named}", self.rms, path)

    def to_rerun(self, path: str | Path) -> Path:
        """Write measured and simulated currents as a trace (`.rrd`), a tab a recording; return its path."""
        from sandbox.output.trace import COLOURS, GREY, Plot, write_series

        tabs = {}
        for inputs, predicted in zip(self.prepared.recordings, self.prediction.currents, strict=True):
            own, n = self.prepared.campaign[inputs.file], len(predicted)
            tabs[Path(inputs.file).stem] = {
                f"i_{phase}": Plot(
                    f"i_{phase} (A)", own.t[:n],
                    {"measured": own[f"i_{phase}"][:n], "simulated": predicted[:, k, 0]}, [GREY, COLOURS["saturated"]],
                )
                for k, phase in enumerate("abc")
            }  # fmt: skip
        title = f"replay {self.prepared.campaign.name}"
        write_series(Path(path), title, f"# {title}\nMeasured currents in grey, simulated ones in blue.", tabs)
        return Path(path)


@told
def identify(
    campaign: AnyCampaign, columns: str | Path | None = None, preset: str | None = None
) -> IdentificationResult:
    """Identify the motor of a campaign from its locked-rotor recordings with injection.

    Parameters
    ----------
    campaign : str, Path or Campaign
        See `read_campaign`; bias staircases at locked rotor, with injection on d and on q.
    columns : str or Path, optional
        See `read_campaign`.
    preset : str, optional
        See `read_campaign`.

    Returns
    -------
    IdentificationResult
        `.identification.fits["exact"].values` and `.ci95(name)`: resistance (ohm), inductances (H), alphas.

    Raises
    ------
    BadInput
        Names recording and row, level or axis where the recordings do not allow it.

    Examples
    --------
    >>> from sandbox import identify, load_motor
    >>> from sandbox.drive.locked_test import paper_campaign
    >>> found = identify(paper_campaign(load_motor("ipm_exchanged")))
    >>> round(found.identification.fits["exact"].values["resistance"], 2)  # ohm
    12.15
    """
    from sandbox.recordings.identify import identify as fitted

    return IdentificationResult(fitted(read_campaign(campaign, columns, ("locked",), preset=preset)))


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


@told
def replay(
    campaign: AnyCampaign,
    effects: Mapping[str, float] | str | None = None,
    *,
    files: Sequence[str] | None = None,
    columns: str | Path | None = None,
    jobs: int = 1,
) -> ReplayResult:
    """Put a campaign's own voltages and angle through the simulator, with effects, beside what was measured.

    Parameters
    ----------
    campaign : str, Path or Campaign
        See `read_campaign`.
    effects : mapping or str, optional
        What the nominal model lacks, such as ``{"dead_time.time": 2e-6}`` (SI units, see `list_effects`).
    files : sequence of str, optional
        Which recordings; all by default.
    columns : str or Path, optional
        See `read_campaign`.
    jobs : int
        Threads; results do not depend on it.

    Returns
    -------
    ReplayResult
        `.rms[file]`: rms of measured less simulated current over the noise floor; `.to_dataframe()`: both, in A.

    Raises
    ------
    BadInput
        For a campaign that cannot be read or replayed, or an effect out of its range.

    Examples
    --------
    >>> from sandbox import replay
    >>> as_measured = replay("campaign", {"dead_time.time": 2e-6})  # doctest: +SKIP
    >>> as_measured.rms  # doctest: +SKIP
    {'locked_d.parquet': 1.02}
    """
    from sandbox.replay.replay import prepare, residuals
    from sandbox.replay.replay import replay as put_through

    added = parse(effects) if isinstance(effects, str) else dict(effects or {})
    prepared = prepare(read_campaign(campaign, columns), added, files=files)
    prediction = put_through(prepared, [added], workers=jobs)
    rms = {r.file: float(r.rms()[0]) for r in residuals(prepared, prediction)}
    return ReplayResult(prepared, prediction, added, rms)
