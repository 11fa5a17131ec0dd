"""The readings themselves: residuals over time, currents as measured and as simulated."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from model.array_types import Array
from sandbox.gap.diagnose import Diagnosis
from sandbox.gap.location.decompose import Decomposition
from sandbox.gap.report.answers import Answers
from sandbox.gap.words import amperes
from sandbox.output import looks
from sandbox.output.document import figure, pairs, prose
from sandbox.output.vector import Line, lines_svg
from sandbox.replay.replay import Residual

POINTS = 1200  # drawn of a line
WINDOW = 0.04  # s of currents shown sample by sample


def waves(
    a: Answers, part: Decomposition, before: Sequence[Residual], after: Sequence[Residual]
) -> Iterator[str]:
    """Yield the residual of the recording that holds most of the gap, over time, and its currents
    where it is worst."""
    files = [r.file for r in a.diagnosis.start.prepared.recordings]
    k = max(range(len(files)), key=lambda k: part.recordings[files[k]])
    r = a.diagnosis.start.prepared.recordings[k]
    period = a.diagnosis.campaign.drive.converter.sampling_period
    width = max(1, r.samples // POINTS)
    t = ((r.first + np.arange(r.samples // width) * width) * period).tolist()

    both = {"before": before[k], "after": after[k]}
    noise_std = a.diagnosis.start.prepared.noise_std
    current = {name: noise_std * x.current[:, :, 0] for name, x in both.items()}  # A
    panels = [
        (f"i_{p} (A)", {name: (t, peaks(x[:, j], width)) for name, x in current.items()})
        for j, p in enumerate("abc")
    ]
    own, rest = before[k].motion, after[k].motion
    if own is not None and rest is not None:
        panels.append(
            (
                "motion\n(noise floors)",
                {"before": (t, peaks(own[:, 0], width)), "after": (t, peaks(rest[:, 0], width))},
            )
        )
    yield f"<h2>Residuals in {prose(r.file)}</h2>"
    spectra = {name: looks.spectrum(x, period) for name, x in current.items()}
    lines = {name: (f.tolist(), size.tolist()) for name, (f, size) in spectra.items()}
    first, last = worst_stretch(before[k].current[:, :, 0], max(2, round(WINDOW / period)))
    yield from pairs(
        [
            figure(
                lines_svg(panels, "t (s)", bands=[noise_std] * 3 + [1.0]),
                "Residual over time: measured minus simulated. Grey: one noise floor "
                f"either way ({amperes(noise_std)}, rms of "
                "the noise). Of each short interval the largest value is drawn.",
            ),
            figure(
                lines_svg(
                    _currents(a.diagnosis, k, before[k], after[k], slice(first, last), period),
                    "t (s)",
                ),
                "Currents where the gap is largest, sample by sample, "
                f"{1e3 * (last - first) * period:.0f} ms. The noise floor is {amperes(noise_std)}.",
            ),
            figure(
                lines_svg([("amplitude (A)", lines)], "frequency (Hz)", log="y"),
                "Spectrum of the same residuals of the currents, all phases together, "
                "without their means: the height of a "
                f"line, in A. White noise alone is flat; its rms is {amperes(noise_std)}.",
            ),
        ]
    )


def phases_of(d: Diagnosis, k: int) -> tuple[Array, Array, Array]:
    """Return the three readings (n,) of a recording in A, with offsets that are named as an
    effect."""
    own = d.campaign[d.start.prepared.recordings[k].file]
    taken = d.drifting.differs(own.origin) if d.drifting and d.offsets_named else (0.0, 0.0, 0.0)
    a, b, c = (own.columns[f"i_{p}"] + x for p, x in zip("abc", taken, strict=True))
    return a, b, c


def peaks(x: Array, width: int) -> list[float]:
    """Return of each interval (width samples) of x (n,) the largest value, with its sign; what is
    left at the end is no interval."""
    own = np.asarray(x)[: len(x) // width * width].reshape(-1, width)
    return list(own[np.arange(len(own)), np.argmax(np.abs(own), axis=1)].tolist())


def worst_stretch(residual: Array, width: int) -> tuple[int, int]:
    """Return first and last sample of the interval (width samples) whose residuals (n, 3) are
    largest."""
    sums = np.concatenate([[0.0], np.cumsum(np.sum(residual**2, axis=1))])
    width = min(width, len(residual))
    first = int(np.argmax(sums[width:] - sums[:-width]))
    return first, first + width


def _currents(
    d: Diagnosis, k: int, before: Residual, after: Residual, own: slice, period: float
) -> list[tuple[str, dict[str, Line]]]:
    """Return three panels of currents (A): simulated before and after, and measured."""
    prepared = d.start.prepared
    first = prepared.recordings[k].first
    t = (period * np.arange(first + own.start, first + own.stop)).tolist()
    out = []
    for j, read in enumerate(phases_of(d, k)):
        simulated = {
            name: (t, (read[own] - prepared.noise_std * x.current[own, j, 0]).tolist())
            for name, x in (("before", before), ("after", after))
        }
        out.append((f"i_{'abc'[j]} (A)", {**simulated, "measured": (t, read[own].tolist())}))
    return out
