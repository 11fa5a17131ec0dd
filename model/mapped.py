"""A motor whose magnetic model is a flux map: the spline energy fitted to it stands where others
have the quartic.

Built in are the maps of the data-set registry (`model/motors/mapped/*.toml`); a user's own motor is
a TOML file of the same kind, its [flux_map] naming a file.  Inductances and magnet flux are those
of the map at zero current, and of the linear belief.  A fit is kept on disk under a hash of the map
and of what fits it.
"""

from __future__ import annotations

import hashlib
import io
import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from model.arrays import MOST_BYTES
from model.datasets import dataset, fetch
from model.energy import AnyEnergy
from model.errors import BadInput, PhysicsError, as_toml, unknown
from model.fluxmap import check_axis
from model.given import given_bytes
from model.kernels.folders import cache_home
from model.kernels.kept import note_damage
from model.kernels.kept import read as read_kept
from model.kernels.kept import write as write_kept
from model.kernels.sources import source_key
from model.map_checks import (
    TorqueLine,
    cell_notes,
    off_fit_notes,
    slope_notes,
    torque_line,
    torque_notes,
    wild_flux_notes,
    wild_notes,
)
from model.map_energy import energy_file, energy_in, with_stiffness
from model.map_fit import choose_for_points, left_out
from model.map_mistakes import check_points
from model.map_names import STATED
from model.map_points import MapPoints, check_angle, read_points
from model.map_quality import Quality, quality
from model.names import check_file, check_path
from model.parameters import Motor, build
from model.spline import DEGREE, SplineEnergy, hessian

if TYPE_CHECKING:
    from model.spline_energy import Choice

KEYS = ("dataset", "file", "magnet", "angle", "cells", "smooth", *STATED)
OF_MAP = (
    "inductance_d",
    "inductance_q",
    "magnet_flux",
    "alpha_30",
    "alpha_12",
    "alpha_40",
    "alpha_22",
    "alpha_04",
)
ALPHAS = OF_MAP[3:]
FOUND = "flux_map_found.npz"  # a map as recordings have it
# of the map's lowest psi_d: without magnets, a flux at zero current that is negative by less is
# noise
NO_MAGNET = 1e-3


class MapFile(NamedTuple):
    """Where a flux map came from: its file, the [flux_map] table that names it, and what it says
    against itself."""

    path: Path
    table: dict[str, Any]
    notes: tuple[str, ...] = ()


class FittedMap(NamedTuple):
    """The centred fit of a map, the magnet flux (Wb), cells and smoothness, the line of its torque,
    and notes."""

    spline: SplineEnergy
    magnet: float
    choice: Choice
    torque: TorqueLine
    notes: tuple[str, ...]


@dataclass(frozen=True)
class MappedMotor(Motor):
    """A motor with a spline energy; `map_hash` tells one map from another (and stands for it in
    comparisons)."""

    map_hash: str = ""
    origin: MapFile | None = field(default=None, repr=False, compare=False)
    spline: SplineEnergy = field(default=None, repr=False, compare=False)  # type: ignore[assignment]

    def __post_init__(self) -> None:
        super().__post_init__()
        given = {
            "inductance_d": 1.0 / self.spline.gamma_d,
            "inductance_q": 1.0 / self.spline.gamma_q,
        }
        given |= dict.fromkeys(ALPHAS, 0.0)
        for name, value in given.items():
            if not math.isclose(getattr(self, name), value, rel_tol=1e-9):
                raise BadInput(
                    f"[motor] {name} = {getattr(self, name):.4g} contradicts the flux map of "
                    f"'{self.name}', which alone says how it saturates; leave it (and effects on "
                    "it) away, or use a motor with alphas"
                )

    @property
    def energy(self) -> AnyEnergy:
        """The saturated magnetic model, of the current-induced fluxes."""
        return self.spline

    @property
    def has_map(self) -> bool:
        """Its file names a flux map."""
        return True

    @property
    def linear(self) -> Motor:
        """The motor linearised at zero current: what a campaign's nominal model can say of it."""
        own = {name: getattr(self, name) for name in Motor.__dataclass_fields__}
        return Motor(**own)


FROM_ZERO = 0.05  # of a map's range of a current: as far as a fit may be carried to zero


def stand_in(values: Mapping[str, Any], table: Mapping[str, Any]) -> Motor:
    """Return the motor of a [motor] table, its map unread, with the largest inductances there are.

    Raises BadInput for what can be seen to be wrong without the map.
    """
    for key in OF_MAP:
        if key in values:
            raise BadInput(f"[motor] {key} comes from the flux map; leave it away")
    for key in table:
        if key not in KEYS:
            raise unknown("key in [flux_map]", key, KEYS)
    if "file" not in table:
        raise BadInput("[flux_map] lacks 'file'; name the map (.npz, .mat or .csv)")
    inside = "dataset" in table
    file = (check_file if inside else check_path)(table["file"], "[flux_map] file")
    if inside:
        names = [f.name for f in dataset(str(table["dataset"])).files]
        if file not in names:
            raise unknown(f"file of data set '{table['dataset']}'", file, names)
    check_axis(table.get("magnet", "d"))
    check_angle(table.get("angle", 0.0))
    for key in STATED:
        if not isinstance(table.get(key, ""), str):
            raise BadInput(
                f"[flux_map] {key} = {as_toml(table[key])} is no name of an array; put it in quotes"
            )
    _choice(table)
    return build(
        Motor, {**values, "inductance_d": 10.0, "inductance_q": 10.0, "magnet_flux": 1.0}, "motor"
    )


def hash_of(spline: SplineEnergy) -> str:
    """Return what tells a map's energy from another."""
    return hashlib.sha256(spline.cells.tobytes() + repr(spline[1:]).encode()).hexdigest()[:16]


def mapped_motor(values: Mapping[str, Any], table: Mapping[str, Any], folder: Path) -> MappedMotor:
    """Return the motor of a [motor] table and its [flux_map] (both right as far as `stand_in`
    sees), its file named from `folder` or in a data set. BadInput where its points make no
    motor."""
    path = _path(table, folder)
    found = _remembered(path, _reading(table), _choice(table))
    spline, magnet = found.spline, found.magnet
    magnet = 0.0 if -NO_MAGNET * abs(spline.low_d) < magnet < 0.0 else magnet
    more = {
        "inductance_d": 1.0 / spline.gamma_d,
        "inductance_q": 1.0 / spline.gamma_q,
        "magnet_flux": magnet,
    }
    try:
        motor = build(Motor, {**values, **more}, "motor")
    except BadInput:
        stand_in(values, table)  # what is wrong with what is stated comes first
        raise BadInput(
            f"{path.name}: its points make a magnet flux of {magnet:.4g} Wb, L_d = "
            f"{more['inductance_d']:.4g} H and L_q = {more['inductance_q']:.4g} H, which no motor "
            "has; write the units into its header, e.g. psi_d [mWb]"
        ) from None
    own = {name: getattr(motor, name) for name in Motor.__dataclass_fields__}
    notes = (*torque_notes(found.torque, motor.pole_pairs, path.name), *found.notes)
    return MappedMotor(
        **own, map_hash=hash_of(spline), origin=MapFile(path, dict(table), notes), spline=spline
    )


def _path(table: Mapping[str, Any], folder: Path) -> Path:
    """Return where a map's file lies."""
    return (fetch(str(table["dataset"])) if "dataset" in table else folder) / str(table["file"])


def _reading(table: Mapping[str, Any]) -> tuple[str, float, dict[str, str]]:
    """Return the axis of a map's magnet, its angle (rad), and the arrays that the table names."""
    named = {key: str(table[key]) for key in STATED if key in table}
    return table.get("magnet", "d"), check_angle(table.get("angle", 0.0)), named


def _choice(table: Mapping[str, Any]) -> Choice | None:
    """Return cells and smoothness where the file gives them, None for cross-validation."""
    if "cells" not in table and "smooth" not in table:
        return None
    cells, smooth = table.get("cells"), table.get("smooth")
    two = (
        isinstance(cells, list)
        and len(cells) == 2
        and all(type(n) is int and 2 <= n <= 60 for n in cells)
    )
    if not two or not isinstance(smooth, float) or not 0.0 < smooth < 1.0:
        raise BadInput(
            f"[flux_map] cells = {as_toml(cells)}, smooth = {as_toml(smooth)}; give both, cells = "
            "[14, 12] (2 to 60 each) and smooth in (0, 1), or neither"
        )
    return (cells[0], cells[1]), smooth  # type: ignore[index]


def _remembered(
    path: Path, how: tuple[str, float, dict[str, str]], choice: Choice | None
) -> FittedMap:
    """Return the fit of a map, from disk where it has been fitted before."""
    content = given_bytes(
        path,
        max(MOST_BYTES.values()),
        "give a flux map (.npz, .mat, .csv or .xlsx), nothing else in it",
    )
    code = source_key(Path(__file__).resolve()).encode()
    key = hashlib.sha256(code + content + repr((path.name, how, choice)).encode()).hexdigest()[:24]
    place = cache_home() / "maps" / f"{key}.kept"
    stored = read_kept(place)
    if stored is not None:
        try:
            kept = _unpacked(stored)
            if (
                kept.spline.cells.ndim == 4
                and kept.spline.cells.shape[2:] == (DEGREE + 1,) * 2
                and _is_sound(kept)
            ):
                return kept
        except Exception:  # whole, but not what is written below
            pass
        note_damage(place)
    found = _fitted(path, how, choice)
    body = io.BytesIO()
    np.savez(
        body,
        cells=found.spline.cells,
        rest=np.array(found.spline[1:]),
        magnet=found.magnet,
        of=found.choice[0],
        smooth=found.choice[1],
        torque=np.array(found.torque),
        notes=np.array(found.notes, dtype=str),
    )
    write_kept(place, body.getvalue())
    return found


def _unpacked(stored: bytes) -> FittedMap:
    """Return a fit as it was kept."""
    with np.load(io.BytesIO(stored)) as numbers:
        rest, cells = (
            map(float, numbers["rest"]),
            np.ascontiguousarray(numbers["cells"], dtype=np.float64),
        )
        n, m = (int(n) for n in numbers["of"])
        line = TorqueLine(*map(float, numbers["torque"]))
        choice = (n, m), float(numbers["smooth"])
        return FittedMap(
            SplineEnergy(cells, *rest),
            float(numbers["magnet"]),
            choice,
            line,
            tuple(map(str, numbers["notes"])),
        )


def _fitted(path: Path, how: tuple[str, float, dict[str, str]], given: Choice | None) -> FittedMap:
    from model.spline_energy import centred, choose_for_map, fit

    points = read_points(path, *how)
    own = None if given else energy_in(path, points)
    if own is not None:
        return _checked(FittedMap(*own, torque_line(points), ()), path)
    nearest = float(points.i_d[np.argmin(np.abs(points.i_d))])
    one_sided = np.all(points.i_d > 0.0) or np.all(points.i_d < 0.0)
    if one_sided and abs(nearest) > FROM_ZERO * np.ptp(points.i_d):  # i_q is mirrored
        raise BadInput(
            f"{path.name}: the map ends at i_d = {nearest:.4g} A; it must hold i_d = 0, where the "
            "magnet's flux and the inductances are taken: add points up to there"
        )
    check_points(points, *how[:2])
    grid = points.grid()
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a fit without an answer is refused below
            choice = given or (choose_for_points(points) if grid is None else choose_for_map(grid))
            whole = fit(*(points if grid is None else grid).points(), *choice)
            spline, flux = centred(whole)
    except (BadInput, PhysicsError):
        raise
    except (ArithmeticError, np.linalg.LinAlgError, RuntimeError, ValueError) as error:
        raise BadInput(
            f"flux map '{path.name}' cannot be fitted ({error}); check its units (A, "
            "Wb), signs and magnet axis"
        ) from None
    found = _checked(FittedMap(spline, flux, choice, torque_line(points), ()), path)
    crowded = [
        *wild_notes(points, path.name),
        *wild_flux_notes(points, path.name),
        *off_fit_notes(whole, points, path.name),
        *(cell_notes(points, given, path.name) if given else []),
    ]
    return found._replace(notes=(*crowded, *slope_notes(whole, points, path.name)))


def _checked(found: FittedMap, path: Path) -> FittedMap:
    """Return a fit that is sound; BadInput for another."""
    if not _is_sound(found):
        raise BadInput(
            f"flux map '{path.name}' gives no finite energy; check its units (A, Wb), "
            "signs and magnet axis"
        )
    return found


def _is_sound(found: FittedMap) -> bool:
    """Tell whether a fit is finite, its scales positive, and its stiffness at no current what its
    cells say."""
    spline, flux = found.spline, found.magnet
    numbers = np.array([*spline[1:], flux], dtype=np.float64)
    scales = spline.per_d, spline.per_q, spline.gamma_d, spline.gamma_q
    finite = spline.cells.size and np.isfinite(spline.cells).all() and np.isfinite(numbers).all()
    if not finite or min(scales) <= 0:
        return False
    stiff_d, _, stiff_q = hessian(spline, 0.0, 0.0)
    return bool(
        np.allclose((stiff_d, stiff_q), (spline.gamma_d, spline.gamma_q), rtol=1e-6, atol=0.0)
    )


def map_quality(table: Mapping[str, Any], folder: Path) -> Quality:
    """Return how far the map of a [flux_map] table can be believed; folder: in which its file
    lies."""
    path = _path(table, folder)
    return quality(
        read_points(path, *_reading(table)),
        _remembered(path, _reading(table), _choice(table)).choice,
    )


def corrected(motor: MappedMotor, energy: SplineEnergy) -> tuple[MappedMotor, bytes]:
    """Return a motor with another energy in place of its map's, and the file it can be read from,
    which holds the points of its map on that energy; BadInput where the motor was not read from a
    map."""
    if motor.origin is None:
        raise BadInput(
            f"the map of '{motor.name}' was not read from a file; read the motor from one"
        )
    path, table, _ = motor.origin
    points, choice = (
        read_points(path, *_reading(table)),
        _remembered(path, _reading(table), _choice(table)).choice,
    )
    e = with_stiffness(energy)
    body = energy_file(e, motor.magnet_flux, choice, points.i_d, points.i_q)
    stiff = {"inductance_d": 1.0 / e.gamma_d, "inductance_q": 1.0 / e.gamma_q}
    return replace(motor, **stiff, map_hash=hash_of(e), spline=e), body  # type: ignore[arg-type]


def motor_points(motor: MappedMotor) -> MapPoints:
    """Return the points of the map that a motor was read from."""
    assert motor.origin is not None
    return read_points(motor.origin.path, *_reading(motor.origin.table))


def map_left_out(motor: MappedMotor) -> tuple[MapPoints, NDArray[np.float64]]:
    """Return the points of the map that a motor was read from, and the squared flux error (Wb^2,
    (n,)) of each in fits that have not seen it (`map_fit.left_out`)."""
    assert motor.origin is not None
    path, table, _ = motor.origin
    points = motor_points(motor)
    choice = _remembered(path, _reading(table), _choice(table)).choice
    return points, left_out(points, *choice)


def held_by_data(
    motor: Motor, i_d: NDArray[np.float64], i_q: NDArray[np.float64], *, beyond: float = 0.0
) -> NDArray[np.bool_]:
    """Tell which currents (A) lie inside the points of a motor's map, mirrored in i_q as its fit
    is, or so far (A) beyond them; all of them where the motor has no map, or its points lie on one
    line."""
    if not isinstance(motor, MappedMotor) or motor.origin is None:
        return np.ones(np.shape(i_d), dtype=bool)
    points = motor_points(motor)
    scale = float(np.max(np.hypot(points.i_d, points.i_q)))
    both = (
        np.column_stack([np.tile(points.i_d, 2), np.concatenate([points.i_q, -points.i_q])]) / scale
    )
    try:
        edges = ConvexHull(both).equations
    except (QhullError, ValueError):
        return np.ones(np.shape(i_d), dtype=bool)
    place = np.column_stack([np.ravel(i_d), np.ravel(i_q)]) / scale
    inside = np.max(place @ edges[:, :2].T + edges[:, 2], axis=1) <= 1e-9 + beyond / scale
    return np.asarray(inside.reshape(np.shape(i_d)))


def without_map(motor: Motor) -> Motor:
    """Return the motor as its numbers alone say: a mapped one linearised at zero current, another
    as it is."""
    return motor.linear if isinstance(motor, MappedMotor) else motor
