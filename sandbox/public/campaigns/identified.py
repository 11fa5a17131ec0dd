"""What recordings say of the motor."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from sandbox.output.columns import Column, columns_of
from sandbox.public.calls import records_call
from sandbox.public.loading import AnyCampaign, read_campaign
from sandbox.public.result import Result

if TYPE_CHECKING:
    from sandbox.output.plots import AnyAxes, Figure
    from sandbox.recordings.identify import Identification
    from sandbox.replay.identification.identified import OrdinaryIdentification


@dataclass(frozen=True, repr=False)
class IdentificationResult(Result):
    """The motor that recordings show: by the paper's least squares and the exact fit to staircases
    at locked rotor, or by a replay of ordinary recordings."""

    command: ClassVar[str] = "identify"
    identification: Identification | OrdinaryIdentification

    def summary(self) -> str:
        """Return the campaign, and what each fit leaves."""
        return self.identification.summary()

    def as_json(self) -> dict[str, Any]:
        """Return what `identify.json` holds beyond its header and the names of files."""
        return self.identification.as_json()

    def columns(self) -> dict[str, Column]:
        """Return one row a parameter and method: value, 95 % interval, unit."""
        rows = [
            {
                "method": method,
                "parameter": name,
                "value": p["value"],
                "low": p["ci95"][0],
                "high": p["ci95"][1],
                "unit": p["unit"],
            }
            for method, fit in self.as_json()["methods"].items()
            for name, p in fit["parameters"].items()
        ]
        return columns_of(rows, {})

    def report(self) -> None:
        """Print what was found beside the nominal values."""
        from sandbox.public.printed import print_identification, print_ordinary
        from sandbox.recordings.identify import Identification

        if isinstance(self.identification, Identification):
            print_identification(self.identification)
        else:
            print_ordinary(self.identification)

    def _write_more(self, out: Path) -> dict[str, Any]:
        """Write motor.toml and effects.toml."""
        self.identification.refitted().write(out)
        return {}

    def plot(self, path: str | Path | None = None, *, ax: AnyAxes = None) -> Figure:
        """Return measured slopes and the fits through them over current, of ordinary recordings
        what the replay leaves of each; a path is written as well.

        ax: eight axes of your own to draw in, two rows of four (one of ordinary recordings); see
        `Result.plot`.
        """
        from sandbox.public.figures import identification_figure, replay_figure
        from sandbox.recordings.identify import Identification

        own = self.identification
        if isinstance(own, Identification):
            return identification_figure(own, path, ax=ax)
        return replay_figure(
            f"{own.campaign.name}: the motor that was identified", own.fit.rms, path, ax=ax
        )


@records_call
def identify(
    campaign: AnyCampaign, columns: str | Path | None = None, preset: str | None = None
) -> IdentificationResult:
    """Identify the motor of a campaign.

    From bias staircases at locked rotor with injection come R, the inductances and how they
    saturate. From ordinary recordings (a step, a sweep, a spin) come R, the inductances at no
    current and the magnet flux, as far as they tell them.

    Parameters
    ----------
    campaign : str, Path or Campaign
        See `read_campaign`. Where locked recordings have injection, these alone are used.
    columns : str or Path, optional
        See `read_campaign`.
    preset : str, optional
        See `read_campaign`.

    Returns
    -------
    IdentificationResult
        `.identification.fits["exact"].values` and `.ci95(name)`: resistance (ohm), inductances (H),
        alphas; of ordinary recordings `.identification.fit.values`, and `.fit.untold`: what they
        cannot tell, and why.

    Raises
    ------
    BadInput
        Names recording and row, level or axis where the recordings do not allow it.

    Examples
    --------
    >>> from sandbox import identify, load_motor
    >>> from sandbox.replay.identification.locked_test import paper_campaign
    >>> found = identify(paper_campaign(load_motor("ipm_exchanged")))
    >>> round(found.identification.fits["exact"].values["resistance"], 2)  # ohm
    12.15
    """
    from model.levels import NoStaircase
    from sandbox.recordings.identify import identify as fitted
    from sandbox.recordings.identify import staircases
    from sandbox.replay.identification.identified import identify_ordinary

    own, why = read_campaign(campaign, columns, preset=preset), ""
    if staircases(own):
        try:
            return IdentificationResult(fitted(own))
        except NoStaircase as error:
            why = f"taken as ordinary recordings: {error}"
    return IdentificationResult(identify_ordinary(own, why))
