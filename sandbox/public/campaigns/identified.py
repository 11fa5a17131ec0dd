"""What locked-rotor recordings say of the motor."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from sandbox.output.columns import Column, columns_of
from sandbox.public.calls import told
from sandbox.public.loading import read_campaign
from sandbox.public.result import Result
from sandbox.recordings.campaign import Campaign

if TYPE_CHECKING:
    from sandbox.output.plots import AnyAxes, Figure
    from sandbox.recordings.identify import Identification

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

    def report(self) -> None:
        """Print both fits beside the nominal values."""
        from sandbox.public.printed import print_identification

        print_identification(self.identification)

    def _write_more(self, out: Path) -> dict[str, Any]:
        """Write motor.toml and effects.toml."""
        self.identification.refitted().write(out)
        return {}

    def plot(self, path: str | Path | None = None, *, ax: AnyAxes = None) -> Figure:
        """Return measured slopes and the fits through them over current; a path is written as well.

        ax: eight axes of your own to draw in, two rows of four; see `Result.plot`.
        """
        from sandbox.public.figures import identification_figure

        return identification_figure(self.identification, path, ax=ax)


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
