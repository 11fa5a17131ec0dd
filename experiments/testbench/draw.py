"""The draw: which drive, which causes, how large, and everything else that is ordinary about a
bench."""

import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from . import effects
from .design import ALPHAS, UNCERTAINTY, Design, nominal_design
from .drives import DRIVES

KINDS = ("one", "several", "many", "outside", "none")
EFFECT_SIZES = (2.0, 1.0, 0.5, 0.25, 0.1, 0.03)  # sizes of a cause alone; 1 is medium
TOGETHER = (1.5, 1.0, 0.7, 0.4, 0.2)  # sizes of causes together


@dataclass
class Truth:
    """All that makes one campaign, and what its report is compared with."""

    kind: str
    seed: int
    index: int
    drive: str
    # name, form, size, parameters, with_background, note
    causes: list[dict[str, Any]] = field(default_factory=list)
    outside: list[dict[str, Any]] = field(default_factory=list)
    deviations: dict[str, float] = field(default_factory=dict)
    background: dict[str, Any] = field(default_factory=dict)
    ordinary: dict[str, float] = field(default_factory=dict)  # noise and its like
    angle: float = 0.0


def generator(seed: int, kind: str, index: int, use: str) -> np.random.Generator:
    """A stream of its own for each use, so that nothing depends on order or jobs."""
    digest = hashlib.sha256(f"testbench {seed} {kind} {index} {use}".encode()).digest()
    return np.random.default_rng(np.frombuffer(digest, np.uint32))


def draw(kind: str, seed: int, index: int = 0, folder: Path | None = None) -> tuple[Truth, Design]:
    """A truth of `kind` (one of KINDS) and the bench that has it; without a folder of maps only
    drives without a map.

    Raises ValueError for an unknown kind.
    """
    if kind not in KINDS:
        raise ValueError(f"kind '{kind}' is not one of {', '.join(KINDS)}")
    rng = generator(seed, kind, index, "draw")
    choice = [d for d in DRIVES if folder is not None or not d.map]
    drive = choice[int(rng.integers(len(choice)))]
    d = nominal_design(drive, folder)
    truth = Truth(kind, seed, index, drive.name)
    _deviate(d, truth, rng)
    names = list(effects.LIBRARY)
    if kind == "one":
        # every name in turn, form in turn: each gets its share whatever the count
        order = generator(seed, kind, 0, "order").permutation(len(names))
        chosen = [names[order[index % len(names)]]]
    elif kind == "several":
        chosen = list(rng.choice(names, int(rng.integers(2, 4)), replace=False))
    elif kind == "many":
        chosen = list(rng.choice(names, int(rng.integers(4, 11)), replace=False))
    elif kind == "outside":
        chosen = list(rng.choice(names, int(rng.integers(0, 2)), replace=False))
    else:
        chosen = []
    if "saturation" in chosen and "cross_saturation" in chosen:
        chosen.remove("cross_saturation")
    for name in chosen:
        _put(d, truth, name, EFFECT_SIZES if kind == "one" else TOGETHER, rng)
    if kind == "outside":
        outside = list(effects.OUTSIDE)
        name = outside[int(rng.integers(len(outside)))]
        size = float(rng.choice([2.0, 1.0, 0.5]))
        _, note = effects.OUTSIDE[name](d, size, True, rng)
        truth.outside.append({"name": name, "size": size, "note": note})
    truth.angle = float(rng.uniform(-np.pi, np.pi))
    return truth, d


def _put(
    d: Design, truth: Truth, name: str, sizes: tuple[float, ...], rng: np.random.Generator
) -> None:
    size = float(rng.choice(sizes))
    own = bool(rng.integers(2)) and name not in effects.ONLY_LIBRARY_FORM
    if d.map is not None and name in ("saturation", "cross_saturation"):
        own = True
    parameters, note = effects.LIBRARY[name](d, size, own, rng)
    form = "own" if own else "library"
    cause = {"name": str(name), "form": form, "size": size, "parameters": parameters, "note": note}
    truth.causes.append(cause | {"with_background": _with_background(d, name, parameters)})


def _with_background(d: Design, name: str, parameters: dict[str, float]) -> dict[str, float]:
    """The same parameters where the bench's ordinary deviation adds to them: what a reading of the
    whole would give."""
    gain, offset = d.sens["gain"], d.sens["offset"]
    whole = {
        "gain_a": gain[0] / gain[2],
        "gain_b": gain[1] / gain[2],
        "offset_a": offset[0],
        "offset_b": offset[1],
        "offset": d.sens["angle_offset"],
    }
    if name == "dead_time":
        whole["time"] = d.inv["dead_time_ideal"] + d.inv["dead_time"]
    return {k: float(whole.get(k, v)) for k, v in parameters.items()}


def _normal(rng: np.random.Generator, sigma: float) -> float:
    """A normal draw within 2.5 sigma: what is stated must hold."""
    return float(sigma * np.clip(rng.standard_normal(), -2.5, 2.5))


def _deviate(d: Design, truth: Truth, rng: np.random.Generator) -> None:
    """Deviations of the size that [uncertainty] and [background] state, and what is ordinary of the
    recordings."""
    for key, sigma in UNCERTAINTY.items():
        if key in d.true and not (d.map is not None and key in ALPHAS):
            d.true[key] = d.nominal[key] * (1 + _normal(rng, sigma))
            truth.deviations[key] = d.true[key] / d.nominal[key] - 1
    b = d.background
    gains = 1 + np.array([_normal(rng, b["current_gain"]) for _ in range(3)])
    offsets = np.array([_normal(rng, b["current_offset"]) for _ in range(2)])
    d.sens["gain"] = gains
    d.sens["offset"] = np.array([*offsets, -offsets.sum()])
    d.sens["offset_drift"] = 0.15 * b["current_offset"] * rng.standard_normal(3)
    d.sens["angle_offset"] = _normal(rng, b["encoder_offset"])
    d.inv["dead_time_ideal"] = _normal(rng, b["dead_time"])
    truth.background = {
        "current_gain": gains.tolist(),
        "current_offset": d.sens["offset"].tolist(),
        "encoder_offset": d.sens["angle_offset"],
        "dead_time": d.inv["dead_time_ideal"],
        "load_torque_offset": _normal(rng, b["load_torque_offset"]),
    }
    truth.ordinary = {
        "noise_over_stated": float(2 ** rng.uniform(-1, 1)),
        "colour": float(rng.choice([0.0, 0.5, 0.8])),
        "jitter": float(rng.uniform(0, 1.5e-3) * d.drive.period),
        "uneven_speed": float(rng.uniform(0.0, 0.006)),
        "begins_under_current": float(rng.uniform(0, 1)),
    }
