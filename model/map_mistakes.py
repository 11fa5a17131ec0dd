"""Mistakes in a flux map that physics shows: single wild points, columns exchanged, counted the
other way or in another unit, the magnet on another axis.

Currents are the gradient of a strictly convex energy, so between any two points the flux rises
along the current's change, (i - i') (psi - psi') > 0; in the magnet's frame psi_q is 0 and psi_d
not negative where no current flows; inductances of both axes are of one size.  Where few points
break the first, those are wild.  Else each mistake of a table is undone, one at a time, and those
are named that leave nothing wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.arrays import TEXTS
from model.errors import BadInput
from model.fluxmap import TURNS
from model.map_points import FEWEST, MapPoints

FALLS = 0.1  # of the span of the fluxes: left to noise, and to a measured map's own wild points
FEW, NAMED = 0.05, 3  # of the points, that may be wild; points in a sentence
OFF_AXIS = 0.2  # of the largest psi_q (psi_d): at no current, left to a rig's asymmetry
SALIENT = 50.0  # L_q over L_d, or the other way: no motor has more
NEAR_AXIS, FAR_OFF = 0.02, 0.2  # of the range of a current: as near as none; too far to tell
TRIED = 400  # points on which mistakes are tried
CHUNK = 500  # points that are compared with all others at a time
Change = Callable[[MapPoints], MapPoints]


def check_points(p: MapPoints, magnet: str = "d", angle: float = 0.0) -> None:
    """Raise BadInput for points that are not of one motor whose magnet lies on +d.

    magnet, angle (rad): with which they were read; mistakes are looked for in the file's own frame.
    """
    wild = wild_points(p)
    if wild is not None and wild.any():
        places = np.flatnonzero(wild)
        shown = "; ".join(f"{p.where(k)}: {_fluxes(p, k)}" for k in places[:NAMED])
        more = f"; and {len(places) - NAMED} more" if len(places) > NAMED else ""
        raise BadInput(
            f"map '{p.name}': wild points: {shown}{more}; from there to others the flux falls "
            "while its current rises: correct them or leave their cells empty"
        )
    said = _falling(p) if wild is None else _off_axis(p)
    if not said:
        return
    turn = TURNS[magnet] * np.exp(1j * angle)
    few = p if len(p.i_d) <= TRIED else p.some(np.arange(0, len(p.i_d), len(p.i_d) // TRIED + 1))
    meant = list(_meant(few, turn))
    asked = f"{', or '.join(meant)}?" if meant else "check the units, signs and axes of its columns"
    raise BadInput(f"map '{p.name}': {said}: {asked}")


def _fluxes(p: MapPoints, k: int) -> str:
    return f"psi_d = {p.psi_d[k]:.4g} Wb, psi_q = {p.psi_q[k]:.4g} Wb"


def wild_points(p: MapPoints) -> NDArray[np.bool_] | None:
    """Return which points (n,) the flux falls from or to, as few as explain all; None where they
    are more than FEW."""
    most = max(1, int(FEW * len(p.i_d)))
    first, second = _falls(p, 2 * most * len(p.i_d))
    wild = np.zeros(len(p.i_d), dtype=bool)
    for _ in range(most + 1):
        if not len(first):
            return wild
        worst = int(np.argmax(np.bincount(np.concatenate([first, second]), minlength=len(wild))))
        wild[worst] = True
        left = (first != worst) & (second != worst)
        first, second = first[left], second[left]
    return None


def _falls(p: MapPoints, most: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return pairs of points between which the flux falls; of more than `most` some."""
    found: list[NDArray[np.int64]] = []
    for begin in range(0, len(p.i_d), CHUNK):
        rise, allowed = _rise(p, slice(begin, begin + CHUNK))
        pairs = np.argwhere(rise < -allowed)
        pairs[:, 0] += begin
        found.append(pairs[pairs[:, 0] < pairs[:, 1]])
        if sum(map(len, found)) > most:
            break
    both = np.concatenate(found)
    return both[:, 0], both[:, 1]


def _rise(p: MapPoints, part: slice) -> tuple[Array, Array]:
    """Return by how much (Wb) the flux rises along the current's change from part of the points to
    all, and how much of a fall is noise."""
    d, q = (x[None, :] - x[part, None] for x in (p.i_d, p.i_q))
    length = np.maximum(np.hypot(d, q), 1e-300)
    d, q = d / length, q / length
    rise = d * (p.psi_d[None, :] - p.psi_d[part, None])
    rise += q * (p.psi_q[None, :] - p.psi_q[part, None])
    return rise, FALLS * (np.abs(d) * _span(p.psi_d) + np.abs(q) * _span(p.psi_q))


def _span(x: Array) -> float:
    """Return the span of values without single wild ones."""
    low, high = np.quantile(x, [0.05, 0.95])
    return float(high - low)


def _falling(p: MapPoints) -> str:
    """Return in words where the flux falls most."""
    worst, at = 0.0, (0, 0)
    for begin in range(0, len(p.i_d), CHUNK):
        rise, _ = _rise(p, slice(begin, begin + CHUNK))
        j, k = np.unravel_index(int(np.argmin(rise)), rise.shape)
        if rise[j, k] < worst:
            worst, at = float(rise[j, k]), (begin + int(j), int(k))
    return (
        f"the flux falls by {-worst:.3g} Wb along the current's change from {p.where(at[0])} to "
        f"{p.where(at[1])}; it must rise"
    )


def _off_axis(p: MapPoints) -> str:
    """Return in words that the magnet does not lie on +d, or that the axes' inductances are of two
    sizes; nothing where neither is so."""
    for name, i, psi, side in (("q", p.i_q, p.psi_q, abs), ("d", p.i_d, p.psi_d, _below)):
        near = _near_zero(i)
        flux, largest = float(np.mean(psi[near])) if near.any() else 0.0, float(np.max(np.abs(psi)))
        if side(flux) > OFF_AXIS * largest:
            return (
                f"psi_{name} is {flux:.3g} Wb at i_{name} = 0 (largest {largest:.3g} Wb), so the "
                "magnet is not on the d axis"
            )
    l_d, l_q = (float(np.polyfit(i, psi, 1)[0]) for i, psi in ((p.i_d, p.psi_d), (p.i_q, p.psi_q)))
    if not 1.0 / SALIENT <= l_q / l_d <= SALIENT:
        return (
            f"along i_d psi_d rises by {l_d:.3g} H, along i_q psi_q by {l_q:.3g} H, so one column "
            "is in another unit"
        )
    return ""


def _near_zero(i: Array) -> NDArray[np.bool_]:
    """Return which points are nearest to where a current is 0, on both sides of it where there are
    some; none where it is far."""
    size, near = np.abs(i), NEAR_AXIS * float(np.ptp(i))
    if np.min(i) < 0.0 < np.max(i):
        near = max(near, float(np.min(size[i >= 0.0])), float(np.min(size[i <= 0.0])))
    return np.asarray(size <= min(near, FAR_OFF * float(np.ptp(i))))


def _below(x: float) -> float:
    return -x


def _meant(p: MapPoints, turn: complex) -> Iterator[str]:
    """Yield the mistakes, in words, that alone explain what is wrong; turn: from the file's frame
    to the magnet's."""
    file = p.turned(-float(np.angle(turn)))
    names = {} if p.source is None or p.source.polar else dict(p.source.names)
    back = float(np.angle(turn))
    said, other = _without_fill(file)
    if said and len(other.i_d) >= FEWEST and _is_sound(other.turned(back)):
        yield said
        return
    for said, change in _mistakes(file, names):
        if _is_sound(change(file).turned(back)):
            yield said
    for axis, own in TURNS.items():
        other = file.turned(float(np.angle(own)))
        if _is_sound(other):
            yield f'does the magnet lie on another axis (magnet = "{axis}" in [flux_map])'


def _is_sound(p: MapPoints) -> bool:
    with np.errstate(all="ignore"):
        wild = wild_points(p)
        return wild is not None and not wild.any() and not _off_axis(p)


def _mistakes(p: MapPoints, names: dict[str, str]) -> Iterator[tuple[str, Change]]:
    """Yield single mistakes in words, and what undoes each."""
    i_d, i_q, psi_d, psi_q = (names.get(n, n) for n in ("i_d", "i_q", "psi_d", "psi_q"))
    for a, b, named in (("psi_d", "psi_q", (psi_d, psi_q)), ("i_d", "i_q", (i_d, i_q))):
        then = f' ({a} = "{named[1]}" and {b} = "{named[0]}" in [flux_map] then)' if names else ""
        yield (
            f"are {named[0]} and {named[1]} exchanged{then}",
            lambda m, a=a, b=b: replace(m, **{a: getattr(m, b), b: getattr(m, a)}),  # type: ignore[misc]
        )
    turn = "counted the other way (turn it round then)"
    yield f"is {i_q} or {psi_q} {turn}", lambda m: replace(m, i_q=-m.i_q)
    yield f"is {i_d} {turn}", lambda m: replace(m, i_d=-m.i_d)
    yield f"is {psi_d} {turn}", lambda m: replace(m, psi_d=-m.psi_d)
    if p.source is not None and p.source.polar:
        yield (
            "is the currents' angle counted from d, not from q towards -d (give i_d and i_q then)",
            lambda m: replace(m, i_d=m.i_q, i_q=-m.i_d),
        )
    in_text = p.source is not None and p.source.path.suffix.lower() in (*TEXTS, ".xlsx")
    for name, said, unit in (
        ("i_d", i_d, "mA"),
        ("i_q", i_q, "mA"),
        ("psi_d", psi_d, "mWb"),
        ("psi_q", psi_q, "mWb"),
    ):
        then = (
            f"write the unit into the header: {said} [{unit}]" if in_text else "divide it by 1000"
        )
        yield (
            f"is {said} in {unit} ({then})",
            lambda m, n=name: replace(m, **{n: 1e-3 * getattr(m, n)}),  # type: ignore[misc]
        )


def _without_fill(p: MapPoints) -> tuple[str, MapPoints]:
    """Return in words that the pair of fluxes which stands most often is no value, and the points
    without it; nothing, and all, where none stands more than twice."""
    both = np.round(p.psi_d + 1j * p.psi_q, 12)
    values, of, count = np.unique(both, return_inverse=True, return_counts=True)
    most = int(np.argmax(count))
    if count[most] <= 2:
        return "", p
    value = values[most]
    said = (
        f"do the points whose fluxes are {value.real:.4g} and {value.imag:.4g} Wb hold no value "
        "(leave their cells empty then)"
    )
    return said, p.some(of.ravel() != most)
