"""A motor whose magnetic model is a flux map: the spline energy fitted to it stands where others have the quartic.

Built in are the maps of the data-set registry (`model/motors/mapped/*.toml`); a user's own motor is a TOML file of the
same kind, its [flux_map] naming a file.  Inductances and magnet flux are those of the map at zero current, and of the
linear belief.  A fit is kept on disk under a hash of the map and of what fits it.
"""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from model.compiled import cache_home
from model.energy import AnyEnergy
from model.errors import BadInput, unknown
from model.parameters import Motor, build
from model.spline import SplineEnergy

KEYS = ("dataset", "file", "magnet", "cells", "smooth")
OF_MAP = ("inductance_d", "inductance_q", "magnet_flux", "alpha_30", "alpha_12", "alpha_40", "alpha_22", "alpha_04")
ALPHAS = OF_MAP[3:]


@dataclass(frozen=True)
class MappedMotor(Motor):
    """A motor with a spline energy; `map_hash` tells one map from another (and stands for it in comparisons)."""

    map_hash: str = ""
    spline: SplineEnergy = field(default=None, repr=False, compare=False)  # type: ignore[assignment]

    def __post_init__(self) -> None:
        super().__post_init__()
        given = {"inductance_d": 1.0 / self.spline.gamma_d, "inductance_q": 1.0 / self.spline.gamma_q}
        given |= dict.fromkeys(ALPHAS, 0.0)
        for name, value in given.items():
            if not math.isclose(getattr(self, name), value, rel_tol=1e-9):
                raise BadInput(
                    f"[motor] {name} = {getattr(self, name):.4g} contradicts the flux map of '{self.name}', which "
                    "alone says how it saturates; leave it (and effects on it) away, or use a motor with alphas"
                )

    @property
    def energy(self) -> AnyEnergy:
        """The saturated magnetic model, of the current-induced fluxes."""
        return self.spline

    @property
    def linear(self) -> Motor:
        """The motor linearised at zero current: what a campaign's nominal model can say of it."""
        own = {name: getattr(self, name) for name in Motor.__dataclass_fields__}
        return Motor(**own)


def mapped_motor(values: Mapping[str, Any], table: Mapping[str, Any], folder: Path) -> MappedMotor:
    """Return the motor of a [motor] table and its [flux_map], whose file lies in `folder` or in a data set."""
    for key in OF_MAP:
        if key in values:
            raise BadInput(f"[motor] {key} comes from the flux map; leave it away")
    for key in table:
        if key not in KEYS:
            raise unknown("key in [flux_map]", key, KEYS)
    path = _file(table, folder)
    choice = _choice(table)
    spline, magnet = _remembered(path, str(table.get("magnet", "d")), choice)
    more = {"inductance_d": 1.0 / spline.gamma_d, "inductance_q": 1.0 / spline.gamma_q, "magnet_flux": magnet}
    motor = build(Motor, {**values, **more}, "motor")
    own = {name: getattr(motor, name) for name in Motor.__dataclass_fields__}
    digest = hashlib.sha256(spline.cells.tobytes() + repr(spline[1:]).encode()).hexdigest()[:16]
    return MappedMotor(**own, map_hash=digest, spline=spline)


def _file(table: Mapping[str, Any], folder: Path) -> Path:
    if not isinstance(table.get("file"), str):
        raise BadInput("[flux_map] lacks 'file'; name the map (.npz, .mat or .csv)")
    if "dataset" not in table:
        return folder / table["file"]
    from model.datasets import fetch

    return fetch(str(table["dataset"])) / table["file"]


def _choice(table: Mapping[str, Any]) -> tuple[tuple[int, int], float] | None:
    """Return cells and smoothness where the file gives them, None for cross-validation."""
    if "cells" not in table and "smooth" not in table:
        return None
    cells, smooth = table.get("cells"), table.get("smooth")
    two = isinstance(cells, list) and len(cells) == 2 and all(type(n) is int and 2 <= n <= 60 for n in cells)
    if not two or not isinstance(smooth, float) or not 0.0 < smooth < 1.0:
        raise BadInput(
            f"[flux_map] cells = {cells!r:.40}, smooth = {smooth!r:.40}; give both, cells = [14, 12] (2 to 60 each) "
            "and smooth in (0, 1), or neither"
        )
    return (cells[0], cells[1]), smooth  # type: ignore[index]


def _remembered(path: Path, magnet: str, choice: tuple[tuple[int, int], float] | None) -> tuple[SplineEnergy, float]:
    """Return the centred fit of a map and the magnet flux (Wb), from disk where it has been fitted before."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise BadInput(f"flux map '{path}' cannot be read ({error.strerror}); give a .npz, .mat or .csv file") from None
    here = Path(__file__).parent
    code = b"".join((here / name).read_bytes() for name in ("spline_energy.py", "spline.py", "fluxmap.py"))
    key = hashlib.sha256(code + content + repr((path.suffix, magnet, choice)).encode()).hexdigest()[:24]
    stored = cache_home() / "maps" / f"{key}.npz"
    try:
        with np.load(stored) as kept:
            return SplineEnergy(np.ascontiguousarray(kept["cells"]), *map(float, kept["rest"])), float(kept["magnet"])
    except (OSError, ValueError, KeyError, EOFError):
        pass
    from model.fluxmap import read_map
    from model.spline_energy import centred, fit, fit_map

    data = read_map(path, magnet)
    spline, flux = centred(fit(*data.points(), *choice) if choice else fit_map(data))
    try:
        stored.parent.mkdir(parents=True, exist_ok=True)
        aside = stored.with_suffix(f".{os.getpid()}.npz")
        np.savez(aside, cells=spline.cells, rest=np.array(spline[1:]), magnet=flux)
        aside.replace(stored)
    except OSError:  # no home to write to: fit again next time
        pass
    return spline, flux


def without_map(motor: Motor) -> Motor:
    """Return the motor as its numbers alone say: a mapped one linearised at zero current, another as it is."""
    return motor.linear if isinstance(motor, MappedMotor) else motor
