"""What a motor's model says without a run: where it is valid, and its maps over the plane of
currents."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from model.drive_files import QUOTED
from model.errors import BadInput
from model.parameters import Drive
from model.ratings import cautions
from sandbox.output.columns import Column
from sandbox.public.calls import records_call
from sandbox.public.loading import load_motor
from sandbox.public.result import Result

if TYPE_CHECKING:
    from model.map_quality import Quality
    from model.saliency import Audit
    from sandbox.evaluation.maps import Maps
    from sandbox.output.plots import AnyAxes, Figure

LARGEST = 20.0  # x rated current: radius of an audit


@dataclass(frozen=True, repr=False)
class AuditResult(Result):
    """Where a motor's model is valid, and the cross-saturation angle against load."""

    command: ClassVar[str] = "audit"
    drive: Drive
    audit: Audit
    flux_map: Quality | None = None

    @property
    def passed(self) -> bool:
        """Whether the energy is strictly convex over the whole audited disc."""
        return self.audit.passed

    def summary(self) -> str:
        """Return how far the model is valid."""
        a = self.audit
        return f"{a.motor}, valid up to {a.valid_radius:.4g} A of {a.radius:.4g} A audited"

    def as_json(self) -> dict[str, Any]:
        """Return what `audit.json` holds beyond its header and the names of files."""
        from sandbox.public.printed import audit_content

        content = audit_content(self.drive, self.audit)
        return content if self.flux_map is None else {**content, "flux_map": asdict(self.flux_map)}

    def columns(self) -> dict[str, Column]:
        """Return the cross-saturation angle against load (i_d = 0), one row a load."""
        content = self.as_json()
        return {
            "load": Column(self.audit.load, "of rated current"),
            "angle_local_deg": Column(content["angle_local_deg"], "deg"),
            "angle_closed_deg": Column(content["angle_closed_deg"], "deg"),
            "relative_slope": Column(content["relative_slope"]),
            "error_per_10mA_deg": Column(content["error_per_10mA_deg"], "deg"),
        }

    def plot(self, path: str | Path | None = None, *, ax: AnyAxes = None) -> Figure:
        """Return the plane of currents and the cross-saturation angle; a path (.png, .svg, .pdf) is
        written as well.

        ax: two axes of your own to draw in; see `Result.plot`.
        """
        from sandbox.evaluation.pages.plane_figures import audit_figure

        return audit_figure(self.drive, self.audit, path, ax=ax)

    def report(self) -> None:
        """Print validity in sentences, then the cross-saturation angle against load."""
        from sandbox.output.tables import print_prose
        from sandbox.public.printed import print_audit

        print_audit(self.drive, self.audit)
        for sentence in self.flux_map.sentences() if self.flux_map else ():
            print_prose(sentence)


@dataclass(frozen=True, repr=False)
class MapsResult(Result):
    """A motor's incremental inductances, cross-saturation angle and gain over the plane of
    currents."""

    command: ClassVar[str] = "maps"
    kinds: ClassVar[tuple[str, ...]] = ("figure",)
    coordinates: ClassVar[tuple[str, ...]] = ("i_d", "i_q")
    drive: Drive
    maps: Maps
    flux_map: Quality | None = None

    def summary(self) -> str:
        """Return the motor and the plane."""
        return (
            f"{self.maps.motor}, {self.maps.i_d.size} x {self.maps.i_q.size} currents up to "
            f"{self.maps.i_d[-1]:.4g} A"
        )

    def as_json(self) -> dict[str, Any]:
        """Return what `maps.json` holds beyond its header and the names of files."""
        content: dict[str, Any] = {"motor": self.maps.motor, **self.maps.summary()}
        content["cautions"] = list(cautions(self.drive))
        return content if self.flux_map is None else {**content, "flux_map": asdict(self.flux_map)}

    def columns(self) -> dict[str, Column]:
        """Return the maps, one row a current: i_d, i_q (A), inductances (H), angle (rad), gain."""
        m = self.maps
        i_d, i_q = np.meshgrid(m.i_d, m.i_q, indexing="ij")
        units = {
            "l_dd": "H",
            "l_dq": "H",
            "l_qq": "H",
            "angle": "rad",
            "gain": "of that at zero current",
        }
        arrays = {name: values for name, values in m.arrays().items() if name not in ("i_d", "i_q")}
        named = {
            name: Column(v.ravel(), units[name.removeprefix("first_")])
            for name, v in arrays.items()
        }
        return {"i_d": Column(i_d.ravel(), "A"), "i_q": Column(i_q.ravel(), "A"), **named}

    def plot(self, path: str | Path | None = None, *, ax: AnyAxes = None) -> Figure:
        """Return the maps as contours; a path (.png, .svg, .pdf) is written as well.

        ax: six axes of your own to draw in, two rows of three; see `Result.plot`.
        """
        from sandbox.evaluation.pages.plane_figures import maps_figure

        return maps_figure(self.maps, path, ax=ax)

    def report(self) -> None:
        """Print the maps at zero and rated current, their ranges, and how far they can be
        believed."""
        from sandbox.output.tables import print_prose
        from sandbox.public.printed import print_cautions, print_maps

        print_maps(self.maps)
        print_cautions(self.drive, QUOTED)
        for sentence in self.flux_map.sentences() if self.flux_map else ():
            print_prose(sentence)

    def _write_more(self, out: Path) -> dict[str, Any]:
        """Write the arrays."""
        arrays: dict[str, Any] = dict(self.maps.arrays())
        np.savez_compressed(out / "maps.npz", **arrays)
        return {"arrays": "maps.npz"}


@records_call
def audit(motor: str | Path | Drive = "ipm_exchanged", radius: float | None = None) -> AuditResult:
    """Return where a motor's model is valid: convexity, saliency, cross-saturation angle.

    Parameters
    ----------
    motor : str, Path or Drive
        See `load_motor`.
    radius : float, optional
        A, of the audited disc of currents; 180 % of rated current by default.

    Returns
    -------
    AuditResult
        `.passed`, `.audit.valid_radius` (A), `.audit.angle_closed` (rad, over `.audit.load` of
        rated current).

    Raises
    ------
    BadInput
        For an unknown motor, or a radius out of range.

    Examples
    --------
    >>> from sandbox import audit
    >>> audit("spm").passed  # the paper's surface motor as printed
    False
    """
    from model.saliency import audit as audited

    drive = load_motor(motor)
    _check_radius(drive, radius)
    return AuditResult(drive, audited(drive.motor, radius), _map_of(motor))


def _map_of(motor: str | Path | Drive) -> Quality | None:
    """Return how far the flux map of a motor's file can be believed, None for a motor without
    one."""
    from model.drive_files import motor_file
    from model.given import read_toml
    from model.mapped import map_quality

    if isinstance(motor, Drive):
        return None
    path = motor_file(motor)
    table = read_toml(path).get("flux_map")
    return None if table is None else map_quality(table, path.parent)


@records_call
def maps(
    motor: str | Path | Drive = "ipm_exchanged", radius: float | None = None, points: int = 61
) -> MapsResult:
    """Return a motor's maps over the plane of currents: inductances, cross-saturation angle, gain.

    Parameters
    ----------
    motor : str, Path or Drive
        See `load_motor`.
    radius : float, optional
        A, half width of the plane; 180 % of rated current by default.
    points : int
        Currents along each side.

    Returns
    -------
    MapsResult
        `.maps.l_dd` and others: arrays (points, points) over i_d (first axis) and i_q, H, NaN where
        not valid.

    Raises
    ------
    BadInput
        For an unknown motor, or a radius out of range.

    Examples
    --------
    >>> from sandbox import maps
    >>> maps("ipm_exchanged", points=5).to_table().num_rows
    25
    """
    from sandbox.evaluation.maps import maps as mapped

    drive = load_motor(motor)
    _check_radius(drive, radius)
    return MapsResult(drive, mapped(drive.motor, radius, points), _map_of(motor))


def _check_radius(drive: Drive, radius: float | None) -> None:
    """Raise BadInput for a radius (A) beyond what a motor's model is made for."""
    most = LARGEST * drive.motor.rated_current
    if radius is not None and not 0.0 < radius <= most:
        raise BadInput(
            f"radius {radius} A must lie in (0, {most:g}] A ({LARGEST:g} x rated current)"
        )
