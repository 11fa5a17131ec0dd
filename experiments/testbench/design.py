"""A bench before it is built: nominal values that deviations and effects change, then the compiled
containers."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from . import maps
from .drives import Drive, alphas
from .magnetics import neutral
from .types import Inverter, Losses, Magnetics, Mechanics, Sensors

ALPHAS = ("alpha_30", "alpha_12", "alpha_40", "alpha_22", "alpha_04")
UNCERTAINTY = {
    "resistance": 0.01,
    "magnet_flux": 0.01,
    "inductance_d": 0.015,
    "inductance_q": 0.015,
    "alpha_30": 0.03,
    "alpha_12": 0.04,
    "alpha_40": 0.04,
    "alpha_22": 0.05,
    "alpha_04": 0.04,
    "inertia": 0.03,
    "viscous_friction": 0.15,
}


@dataclass
class Design:
    """One bench: what is stated of it, and what it is."""

    drive: Drive
    nominal: dict[str, float]  # as [motor] states it (alphas only where the motor is an energy)
    true: dict[str, float]  # the same, as it is
    background: dict[str, float]  # standard deviations
    map: maps.FluxMap | None = None  # true map before deviations
    sooner: float = 0.0
    crossed: float = 0.0
    mag: dict[str, Any] = field(default_factory=dict)
    loss: dict[str, Any] = field(default_factory=dict)
    inv: dict[str, Any] = field(default_factory=dict)
    mech: dict[str, Any] = field(default_factory=dict)
    sens: dict[str, Any] = field(default_factory=dict)

    @property
    def torque(self) -> float:
        """Torque at rated current and bias (N m)."""
        i_d, i_q = self.drive.bias * self.drive.current, self.drive.current
        l_d, l_q = self.nominal["inductance_d"], self.nominal["inductance_q"]
        if self.map is not None:
            psi_d, psi_q, _ = maps.flux(self.map, np.array(i_d), np.array(i_q))
            return float(1.5 * self.drive.pole_pairs * (psi_d * i_q - psi_q * i_d))
        return 1.5 * self.drive.pole_pairs * (self.nominal["magnet_flux"] + (l_d - l_q) * i_d) * i_q

    @property
    def noise(self) -> float:
        """Current noise (A rms) of this class of sensors."""
        return 0.0017 * self.drive.current


def nominal_design(drive: Drive, folder: Path | None) -> Design:
    """The bench as stated, without deviations; a map drive needs the folder of maps."""
    flux_map = None
    l_d, l_q, magnet = *drive.inductance, drive.magnet
    if drive.map:
        if folder is None:
            raise FileNotFoundError(
                f"drive '{drive.name}' needs the published map {drive.map}: give the folder of maps"
            )
        flux_map = maps.crop(maps.read_map(folder, drive.map), 2.1 * drive.current)
        psi_d, _, jac = maps.flux(flux_map, np.array(0.0), np.array(0.0))
        l_d, l_q, magnet = float(jac[0, 0]), float(jac[1, 1]), float(psi_d)
    values = {
        "pole_pairs": float(drive.pole_pairs),
        "resistance": drive.resistance,
        "magnet_flux": magnet,
        "inductance_d": l_d,
        "inductance_q": l_q,
    }
    if not drive.map:
        values |= dict(zip(ALPHAS, alphas(drive).tolist(), strict=True))
    values |= {"inertia": drive.inertia, "viscous_friction": 0.0}
    d = Design(drive, values, dict(values), {}, flux_map)
    values["viscous_friction"] = float(f"{0.01 * d.torque / drive.speed:.3g}")
    d.true = dict(values)
    d.background = {
        "current_gain": 0.0015,
        "current_offset": 0.0008 * drive.current,
        "encoder_offset": 0.002,
        "dead_time": 3.2e-4 * drive.period,
        "load_torque_gain": 0.01,
        "load_torque_offset": 0.0015 * d.torque,
    }
    _neutral_parts(d)
    return d


def _neutral_parts(d: Design) -> None:
    i, zeros = d.drive.current, np.zeros
    d.mag = {"power": zeros(7), "harmonics": zeros((0, 5)), "saliency": zeros(3)}
    d.loss = {
        "added": zeros(3),
        "contact": np.array([0.0, 0.0, 1.0]),
        "skin": np.tile([0.0, 1.0], (4, 1)),
        "eddy": np.tile([0.0, 1.0], (3, 1)),
        "excess": 0.0,
        "hysteresis": zeros(2),
        "drift": 0.0,
    }
    d.inv = {
        "dead_time_ideal": 0.0,
        "zone": 0.015 * i,
        "dead_time": 0.0,
        "capacitance": 1.0,
        "drop_ideal": zeros(2),
        "switch": np.array([0.0, i, 0.0]),
        "diode": np.array([0.0, i, 0.0]),
        "delay": zeros(3),
        "counts": round(d.drive.counter * d.drive.period / 2),
        "link_gain": 0.0,
        "ripple": zeros(3),
        "source": np.array([0.0, 0.01, 1e-3, 1e-3, 0.0, 50.0]),
    }
    d.mech = {
        "load_inertia": 0.0,
        "shaft": zeros(3),
        "coulomb": np.array([0.0, 2.0]),
        "lugre": zeros(5),
        "cogging": zeros((0, 3)),
        "fan": 0.0,
        "periodic": np.array([0.0, 1.0, 0.0]),
    }
    d.sens = {
        "gain": np.ones(3),
        "cubic": 0.0,
        "offset": zeros(3),
        "offset_drift": zeros(3),
        "filter": zeros(3) + 1.0,
        "delay": zeros(3),
        "hysteresis": 0.0,
        "clip": 0.0,
        "angle_offset": 0.0,
        "angle_latency": 0.0,
        "eccentricity": zeros(4),
        "slip": 0.0,
    }
    d.sens["filter"][0] = 0.0


def fixed(x: Any) -> Any:
    """Arrays as nested tuples of floats."""
    return tuple(fixed(v) for v in x) if np.ndim(x) else float(x)


def _rows(x: np.ndarray, n: int) -> tuple:
    """Rows filled up with zeros to n."""
    return fixed(np.vstack([x, np.zeros((n - len(x), x.shape[1]))]))


def magnetics(d: Design) -> Magnetics:
    """The true magnetic model of a design."""
    t = d.true
    m = neutral()._replace(
        magnet=float(t["magnet_flux"]),
        power=fixed(d.mag["power"]),
        saliency=fixed(d.mag["saliency"]),
        harmonics=_rows(d.mag["harmonics"], 3),
    )
    if d.map is None:
        energy = (1 / t["inductance_d"], 1 / t["inductance_q"], *(t[a] for a in ALPHAS))
        return m._replace(energy=fixed(energy))
    grid, table_d, table_q = maps.invert(true_map(d))
    return m._replace(grid=fixed(grid), table_d=table_d, table_q=table_q, use_table=1)


def true_map(d: Design) -> maps.FluxMap:
    """The map with the deviations and effects of a design: W(c_d i_d, c_q i_q) has L = c^2 L_0, so
    stays reciprocal."""
    assert d.map is not None
    t, n = d.true, d.nominal
    m = maps.sooner(d.map, d.sooner) if d.sooner else d.map
    m = maps.crossed(m, d.crossed) if d.crossed else m
    c_d = np.sqrt(t["inductance_d"] / n["inductance_d"])
    c_q = np.sqrt(t["inductance_q"] / n["inductance_q"])
    a, b = np.meshgrid(m.i_d, m.i_q, indexing="ij")
    psi_d, psi_q, _ = maps.flux(m, c_d * a, c_q * b)
    return maps.FluxMap(
        m.i_d, m.i_q, t["magnet_flux"] + c_d * (psi_d - n["magnet_flux"]), c_q * psi_q
    )


def losses(d: Design) -> Losses:
    """Resistances and losses."""
    part = {k: fixed(v) for k, v in d.loss.items() if k != "added"}
    return Losses(
        phases=fixed(d.true["resistance"] + d.loss["added"]),
        core=bool(d.loss["excess"] or d.loss["hysteresis"][0] or d.loss["eddy"][:, 0].any()),
        rise=bool(d.loss["skin"][:, 0].any()),
        **part,
    )


def inverter(d: Design) -> Inverter:
    """Legs and link."""
    return Inverter(
        period=d.drive.period, link=d.drive.link, **{k: fixed(v) for k, v in d.inv.items()}
    )


def mechanics(d: Design) -> Mechanics:
    """Rotor and load; a soft shaft takes the load's inertia out of the total."""
    rotor = d.true["inertia"] - d.mech["load_inertia"]
    part = {k: fixed(v) for k, v in d.mech.items() if k != "cogging"}
    return Mechanics(
        pole_pairs=float(d.drive.pole_pairs),
        inertia=float(rotor),
        viscous=float(d.true["viscous_friction"]),
        cogging=_rows(d.mech["cogging"], 4),
        **part,
    )


def sensors(d: Design) -> Sensors:
    """Current sensors and encoder."""
    i = d.drive.current
    return Sensors(
        full_scale=2.5 * i,
        resolution=0.002 * i,
        lines=float(d.drive.lines),
        **{k: fixed(v) for k, v in d.sens.items()},
    )


def shortest(d: Design) -> float:
    """Longest step (s) of the integrator: a sixth of the period, 0.7 of the shortest time constant
    that is at work."""
    taus = [t for g, t in [*d.loss["skin"], *d.loss["eddy"]] if g > 0]
    if d.sens["filter"][0] > 0:
        taus.append(d.sens["filter"][1])
    return min([d.drive.period / 6, *(0.7 * t for t in taus)])
