"""A diagnosis as one rerun recording: recorded, simulated before and after, residuals in time and
by order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.location.decompose import MECHANICAL, ORDERS, Decomposition, decompose
from sandbox.gap.pages.listed import waterfall
from sandbox.gap.report import answers
from sandbox.gap.report.answers import Answers
from sandbox.gap.words import amperes
from sandbox.output import looks
from sandbox.output.sheets import COLOURS, GREY, Plot
from sandbox.output.trace import write_series
from sandbox.replay.inputs import LEGS, Inputs
from sandbox.replay.replay import Prediction, Residual, replay, residuals

BEFORE, AFTER = COLOURS["linear"], COLOURS["saturated"]
RECORDED = GREY
FINEST = 1e-3  # noise floors: 0 dB of a spectrum's bars
# samples of a recording that are shown, evenly chosen: more is a file that no viewer opens
MAX_SAMPLES = 400_000
HALF = 0.5  # a bar of width 1 is drawn from its place on


def write_traces(path: Path, a: Answers) -> None:
    """Write the trace of a diagnosis."""
    d = a.diagnosis
    points = {"before": d.before.point, "after": d.after.point}
    seen = {name: _seen(p) for name, p in points.items()}
    parts = {name: decompose(p, seen[name][1]) for name, p in points.items()}
    tabs = {"Overview": dict(whole_gap(a, parts))}
    for k, r in enumerate(d.start.prepared.recordings):
        held = ", held out" if k in d.held_out else ""
        shown = {
            name: (p.prepared.recordings[k], seen[name][0], seen[name][1][k])
            for name, p in points.items()
        }
        tabs[f"{Path(r.file).stem}{held}"] = dict(
            _recording(k, d.campaign.drive.converter.sampling_period, shown)
        )
    write_series(path, f"diagnosis {d.campaign.name}", _text(a), tabs)


def _seen(point: ParameterPoint) -> tuple[Prediction, list[Residual]]:
    prepared = point.turned()
    prediction = replay(prepared, [point.values])
    return prediction, residuals(prepared, prediction)


def whole_gap(a: Answers, parts: dict[str, Decomposition]) -> Iterator[tuple[str, Plot]]:
    """Yield the plots of the whole gap: recordings before and after, where it lies."""
    rows = a.diagnosis.size.recordings
    place = np.arange(1.0, len(rows) + 1.0) - HALF
    columns = {
        "before": np.array([r.before for r in rows]),
        "after": np.array([r.after for r in rows]),
    }
    yield (
        "recordings",
        Plot(
            "Residual over floor, by recording (in the summary's order)",
            place,
            columns,
            [BEFORE, AFTER],
            bars=True,
        ),
    )
    labels, levels = waterfall(a)
    if labels:
        yield (
            "waterfall",
            Plot(
                "Residual over floor as effects are added (legend: steps from left to right)",
                np.arange(1.0, len(levels) + 1.0) - HALF,
                _steps(labels, levels),
                [BEFORE, *[AFTER] * (len(levels) - 2), RECORDED],
                bars=True,
            ),
        )
    scale = {"before": 1.0, "after": parts["after"].excess / parts["before"].excess}
    for title, field, orders in (
        ("Electrical orders of the currents, rotor frame (% of the gap)", "electrical", ORDERS),
        ("Mechanical orders of the free rotor's motion (% of the gap)", "mechanical", MECHANICAL),
    ):
        lines = {
            name: 100.0 * scale[name] * np.array([getattr(part, field).get(n, 0.0) for n in orders])
            for name, part in parts.items()
        }
        yield field, Plot(title, np.array(orders, float) - HALF, lines, [BEFORE, AFTER], bars=True)


def _steps(labels: Sequence[str], levels: Sequence[float]) -> dict[str, Array]:
    """Return a bar for each step of the waterfall, numbered and named as a path can be: elsewhere
    without height."""
    bars = np.diag(np.array(levels, dtype=np.float64))
    plain = [label.removeprefix("+ ").replace(" ", "_") for label in labels]
    return {f"{k}_{label}": bar for k, (label, bar) in enumerate(zip(plain, bars, strict=True), 1)}


def _recording(
    k: int, period: float, shown: dict[str, tuple[Inputs, Prediction, Residual]]
) -> Iterator[tuple[str, Plot]]:
    """Yield currents and their residuals in the rotor's frame, motion or angle over its floor, of
    one recording."""
    r = shown["before"][0]
    few = slice(None, None, -(-r.samples // MAX_SAMPLES))
    t: Array = period * np.arange(r.first, r.first + r.samples, dtype=np.float64)[few]
    turned = np.exp(-1j * r.motion.angle[few])
    currents = {"recorded": _complex(r.read[few]) * turned}
    simulated = {name: p.currents[k][few, :, 0] for name, (_, p, _) in shown.items()}
    currents |= {f"simulated {name}": _complex(i) * turned for name, i in simulated.items()}
    colours = [RECORDED, BEFORE, AFTER]
    yield (
        "current_d",
        Plot("Current i_d (A)", t, {n: _real(z) for n, z in currents.items()}, colours),
    )
    yield (
        "current_q",
        Plot("Current i_q (A)", t, {n: _imaginary(z) for n, z in currents.items()}, colours),
    )
    rest = {
        name: _complex(own.read[few]) * turned - currents[f"simulated {name}"]
        for name, (own, _, _) in shown.items()
    }
    yield (
        "residual_d",
        Plot("Residual of i_d (A)", t, {n: _real(z) for n, z in rest.items()}, colours[1:]),
    )
    yield (
        "residual_q",
        Plot("Residual of i_q (A)", t, {n: _imaginary(z) for n, z in rest.items()}, colours[1:]),
    )
    yield (
        "spectrum",
        _spectrum(period, {name: x.current[:, :, 0] for name, (_, _, x) in shown.items()}),
    )
    for field, title in (
        ("motion", "Innovation of the rotor's motion"),
        ("angle", "Residual of the encoder's angle"),
    ):
        own = {name: getattr(x, field) for name, (_, _, x) in shown.items()}
        if all(v is not None for v in own.values()):
            yield (
                field,
                Plot(
                    f"{title} (noise floors)",
                    t,
                    {n: v[few, 0] for n, v in own.items()},
                    colours[1:],
                ),
            )


def _spectrum(period: float, rest: dict[str, Array]) -> Plot:
    """Return bars of the residuals' spectrum, all phases together, side by side before and
    after."""
    found = {
        name: looks.bars(*looks.spectrum(values, period), FINEST) for name, values in rest.items()
    }
    f = found["after"][0]
    width = float(f[1] - f[0]) if f.size > 1 else 1.0
    lines = {name: levels for name, (_, levels) in found.items()}
    title = f"Spectrum of the residuals (Hz; dB over {FINEST:g} noise floors)"
    return Plot(title, f - 0.5 * width, lines, [BEFORE, AFTER], bars=True, width=width)


def _real(z: NDArray[np.complex128]) -> Array:
    return np.asarray(z.real, dtype=np.float64)


def _imaginary(z: NDArray[np.complex128]) -> Array:
    return np.asarray(z.imag, dtype=np.float64)


def _complex(phases: Array) -> NDArray[np.complex128]:
    z = (2.0 / 3.0) * phases @ LEGS
    return np.asarray(z[:, 0] + 1j * z[:, 1])


def _text(a: Answers) -> str:
    d = a.diagnosis
    lines = [
        f"# {d.campaign.name}",
        f"**Where?** {answers.where_text(a)}",
        f"**Which?** {answers.which_text(a)}",
    ]
    lines += [f"**How far?** {answers.far_text(a)}", f"**Next?** {answers.next_text(a)}"]
    noise_std = amperes(d.start.prepared.noise_std)
    lines.append(
        "Grey: recorded. Orange: simulated before. Blue: simulated after. One noise "
        f"floor is {noise_std}."
    )
    rows = [
        f"| {k} | {file}{' (held out)' if held else ''} | {before:.2f} | {after:.2f} |"
        for k, (file, before, after, held) in enumerate(d.size.recordings, 1)
    ]
    lines.append("\n".join(["| | recording | before | after |", "|---|---|--:|--:|", *rows]))
    return "\n\n".join(lines)
