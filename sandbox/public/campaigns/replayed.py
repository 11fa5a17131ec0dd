"""A campaign's own commands through the simulator, with a motor and effects of one's choice."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from model.effect_files import effects_and_angles
from model.parameters import Drive
from sandbox.output.columns import Column
from sandbox.output.tables import many, print_table
from sandbox.public.calls import records_call
from sandbox.public.loading import AnyCampaign, load_motor, read_campaign
from sandbox.public.result import Result

if TYPE_CHECKING:
    from sandbox.output.plots import AnyAxes, Figure
    from sandbox.replay.replay import Prediction, Prepared


@dataclass(frozen=True, repr=False)
class ReplayResult(Result):
    """What the simulator says to a campaign's own voltages with chosen effects, beside what was
    measured."""

    command: ClassVar[str] = "replay"
    prepared: Prepared
    prediction: Prediction
    effects: Mapping[str, float]
    # of each recording's current residual, over its noise floor: 1 is noise alone
    rms: Mapping[str, float]

    def summary(self) -> str:
        """Return the worst recording."""
        file = max(self.rms, key=lambda name: self.rms[name])
        count = many(len(self.rms), "recording")
        return (
            f"{self.prepared.campaign.name}, {count}, {file} {self.rms[file]:.3g} noise floors off"
        )

    def as_json(self) -> dict[str, Any]:
        """Return campaign, effects, noise floor (A) and each recording's rms over it."""
        return {
            "campaign": self.prepared.campaign.name,
            "effects": dict(self.effects),
            "floor": self.prepared.noise_std,
            "recordings": [{"file": file, "rms": value} for file, value in self.rms.items()],
        }

    def columns(self) -> dict[str, Column]:
        """Return measured and simulated currents, one row a sample: file, t (s), i_a .. (A),
        i_a_simulated .. (A)."""
        parts: dict[str, list[Any]] = {}
        for inputs, predicted in zip(
            self.prepared.recordings, self.prediction.currents, strict=True
        ):
            own = self.prepared.campaign[inputs.file]
            n = len(predicted)
            parts.setdefault("file", []).append(np.full(n, inputs.file))
            parts.setdefault("t", []).append(own.t[:n])
            for k, phase in enumerate("abc"):
                parts.setdefault(f"i_{phase}", []).append(own[f"i_{phase}"][:n])
                parts.setdefault(f"i_{phase}_simulated", []).append(predicted[:, k, 0])
        units = {"file": "", "t": "s"}
        return {
            k: Column(
                list(np.concatenate(v)) if k == "file" else np.concatenate(v), units.get(k, "A")
            )
            for k, v in parts.items()
        }

    def plot(self, path: str | Path | None = None, *, ax: AnyAxes = None) -> Figure:
        """Return the rms of each recording's residual over its noise floor; a path is written as
        well.

        ax: axes of your own to draw in; see `Result.plot`.
        """
        from sandbox.public.figures import replay_figure

        named = ", ".join(f"{k} = {v:g}" for k, v in self.effects.items()) or "the nominal model"
        return replay_figure(f"{self.prepared.campaign.name}: {named}", self.rms, path, ax=ax)

    def report(self) -> None:
        """Print each recording's residual."""
        table = [[file, f"{rms:.3g}"] for file, rms in self.rms.items()]
        print_table(
            "residual of the currents over the noise floor (rms; 1 is noise)",
            ["recording", "rms"],
            table,
        )

    def to_rerun(self, path: str | Path) -> Path:
        """Write measured and simulated currents as a trace (`.rrd`), a tab a recording; return its
        path."""
        from sandbox.output.sheets import COLOURS, GREY, Plot
        from sandbox.output.trace import write_series

        tabs = {}
        for inputs, predicted in zip(
            self.prepared.recordings, self.prediction.currents, strict=True
        ):
            own, n = self.prepared.campaign[inputs.file], len(predicted)
            tabs[Path(inputs.file).stem] = {
                f"i_{phase}": Plot(
                    f"i_{phase} (A)",
                    own.t[:n],
                    {"measured": own[f"i_{phase}"][:n], "simulated": predicted[:, k, 0]},
                    [GREY, COLOURS["saturated"]],
                )
                for k, phase in enumerate("abc")
            }
        title = f"replay {self.prepared.campaign.name}"
        write_series(
            Path(path),
            title,
            f"# {title}\nMeasured currents in grey, simulated ones in blue.",
            tabs,
        )
        return Path(path)


@records_call
def replay(
    campaign: AnyCampaign,
    effects: Mapping[str, float] | str | Path | None = None,
    *,
    motor: str | Path | Drive | None = None,
    files: Sequence[str] | None = None,
    columns: str | Path | None = None,
    preset: str | None = None,
    jobs: int = 1,
) -> ReplayResult:
    """Put a campaign's own voltages and angle through the simulator, with effects, beside what was
    measured.

    Parameters
    ----------
    campaign : str, Path or Campaign
        See `read_campaign`.
    effects : mapping, str or Path, optional
        What the motor lacks, such as ``{"dead_time.time": 2e-6}`` (SI units, see `list_effects`),
        or a file of effects as `diagnose` writes it (``effects.toml``; its angles are turned and
        its offsets taken off, too).
    motor : str, Path or Drive, optional
        See `load_motor`; in place of the campaign's nominal motor, such as the ``motor.toml`` that
        `diagnose` writes.
    files : sequence of str, optional
        Which recordings; all by default.
    columns : str or Path, optional
        See `read_campaign`.
    preset : str, optional
        See `read_campaign`.
    jobs : int
        Threads; results do not depend on it.

    Returns
    -------
    ReplayResult
        `.rms[file]`: rms of measured less simulated current over the noise floor;
        `.to_dataframe()`: both, in A.

    Raises
    ------
    BadInput
        For a campaign that cannot be read or replayed, or an effect out of its range.

    Examples
    --------
    >>> import tempfile
    >>> from sandbox import replay, simulate
    >>> late = {"dead_time.time": 2e-6}  # recorded with it; replayed with it only noise remains
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     run = simulate("ipm_exchanged", duration=0.2, effects=late, record=f"{folder}/mine")
    ...     with_it, without = replay(f"{folder}/mine", late), replay(f"{folder}/mine")
    >>> max(with_it.rms.values()) < 1.1 < min(without.rms.values())
    True
    """
    from sandbox.gap.evidence.noise import noise_std_of
    from sandbox.gap.evidence.normal import ParameterPoint
    from sandbox.gap.unstated.drifting import without_offsets
    from sandbox.replay.replay import prepare, residuals
    from sandbox.replay.replay import replay as put_through

    added, angles, offsets = effects_and_angles(effects)
    own = without_offsets(read_campaign(campaign, columns, preset=preset), offsets)
    if motor is not None:
        own = dataclasses.replace(
            own, drive=dataclasses.replace(own.drive, motor=load_motor(motor).motor)
        )
    prepared = prepare(own, added, files=files)
    prepared = ParameterPoint(
        dataclasses.replace(prepared, noise_std=noise_std_of(own, prepared.noise_std)),
        added,
        angles,
    ).turned()
    prediction = put_through(prepared, [added], workers=jobs)
    rms = {r.file: float(r.rms()[0]) for r in residuals(prepared, prediction)}
    return ReplayResult(prepared, prediction, added, rms)
