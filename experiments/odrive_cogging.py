"""What does `sensorless diagnose` say of a hobby drive's runs without voltages, and do the author's
own maps agree?

An ODrive with a brushless motor (data set by G. Chen, MIT): slow turns and spin-ups, polled over
USB with uneven stamps, and, as an answer that no fit of ours has seen, maps of the current that
holds the rotor at each angle. The drive filters the current that it reports
(`I_measured_report_filter_k = 0.001` among the author's commands, 125 ms at 8 kHz).

Run: python -m experiments.odrive_cogging (half a minute; needs SENSORLESS_DATA or the shared
folder)
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from experiments.drawing import COLOURS, RESULTS, new_figure, save, shared
from sandbox import diagnose

CONSTANT = 8.269933431 / 150.0  # N m per A, as the author's spin-up analysis has it
INERTIA = 2.5e-4  # kg m^2, the author's note ("~0.00025")
COUNTS = 8192
ORDERS = (7, 28, 14, 36, 12, 84, 21, 56)  # the largest of the author's maps
MAPS = ("a_16", "b_16", "d_16")  # same direction, neighbour's rotor at the same place
MAP = f"""[columns]
t = "time"
theta = {{column = "position", scale = {math.tau / COUNTS}, mechanical = true}}
i_q = "current"
[log]
matrix = {{data = ["time", "position", "current"]}}
[motor]
torque_constant = {CONSTANT}
inertia = {INERTIA}
[uncertainty]
inertia = 0.5
[drive]
encoder_counts = {COUNTS}
"""


BELIEVE = """Friction by the maps, half of forward less reverse: {friction:.3f} A (the rotor held, not moving).

Inertia by the author's way, parabolas through compensated spin-ups over the current that was *set*:
{inertia:.2f}e-4 kg m² (his note: about 2.5e-4). The current that was *measured*, which the fits use, is 0.6 to
0.7 of it in the fastest runs.

Slow turns stray from an even motion by {ripple_without:.2f}° rms without compensation, by {ripple_with:.2f}°
with it.

**Believe it?** Orders, phases and the late current: yes. The maps were measured with the rotor held, the runs
with it turning; they share neither code nor moment, and the fit was not told of the filter among the author's
commands (125 ms if his current loop runs at 8 kHz; that it was set in these runs is inferred). Slow turns and
spin-ups agree in phase although the late reading turns only the slow ones. Amplitudes in A are as good as the
drive's current; in N m they depend on the author's torque constant, which is not measured. Inertia: four sets of
runs agree to 7 %; their intervals are narrower than that, they count scatter, not what is left unexplained, and
the author's figure is another. Friction: the slow turns stand a fifth below and above the maps, the spin-ups
say twice as much, as dry friction, viscous friction and an offset of the current trade: do not
believe it beyond a factor of two. Whatever is electrical is not on file and not judged.
"""  # noqa: E501


def cases(data: Path, folder: Path) -> dict[str, dict[str, Any]]:
    """Return the diagnosis of slow turns and of spin-ups, each without and with the drive's
    compensation."""
    found = {}
    for name, word, tests in (("without", "nocomp", (4, 5)), ("with", "comp", (3, 7))):
        slow = [
            *(data / "slow2" / f"{word}_{k}.npy" for k in range(3)),
            data / "slow2_slower" / f"{word}_0.npy",
        ]
        spins = []
        for test in tests:
            runs = np.load(data / "accel_tests" / f"spinup_{test}_{word}.npy", allow_pickle=True)
            for k in range(20, runs.shape[1]):
                # 1 A and more, forth and back: below, the rotor may not start
                path = folder / f"spin_{word}_{test}_{k}.npy"
                np.save(path, np.array([runs[1][k], runs[2][k], runs[3][k]], dtype=float))
                spins.append(path)
        found[f"slow, {name} compensation"] = diagnosed(
            [np.load(p) for p in slow], folder / f"slow_{word}"
        )
        found[f"spin-ups, {name} compensation"] = diagnosed(
            [np.load(p) for p in spins], folder / f"spin_{word}"
        )
    return found


def diagnosed(runs: list[np.ndarray], folder: Path) -> dict[str, Any]:
    """Return the diagnosis of runs (3, n), written into a folder as filed: stamps, counts, A."""
    folder.mkdir()
    text = MAP
    for k, run in enumerate(runs):
        np.save(folder / f"run{k}.npy", run)
        text += f'[[recording]]\nfile = "run{k}.npy"\nrotor = "free"\n'
    (folder / "map.toml").write_text(text)
    return diagnose(folder, columns=folder / "map.toml").as_json()


def holding_map(path: Path) -> tuple[dict[int, complex], float]:
    """Return the torque on the rotor by a map of holding currents, each order (A; phase of a sine),
    and its mean."""
    values = np.load(path)
    at = np.flatnonzero(values)
    angle, current = math.tau * at / COUNTS, values[at]
    parts = {n: -2.0 * np.mean(current * np.exp(-1j * n * angle)) for n in ORDERS}
    return {n: complex(np.conj(-1j * np.conj(c))) for n, c in parts.items()}, float(
        np.mean(current)
    )


def spin_up_inertia(data: Path) -> float:
    """Return the inertia (kg m^2) by the author's method: parabolas through compensated spin-ups,
    acceleration over current beyond 1 A."""
    points = []
    for test in (3, 7, 8):
        setting, t, position, _ = np.load(
            data / "accel_tests" / f"spinup_{test}_comp.npy", allow_pickle=True
        )
        for k in range(20, len(t)):
            parabola = np.polyfit(t[k], np.array(position[k]) * math.tau / COUNTS, 2)
            points.append((float(setting[k]), abs(2.0 * parabola[0])))
    return CONSTANT / float(np.polyfit(*np.array(points).T, 1)[0])


def ripple(runs: list[np.ndarray]) -> float:
    """Return how far slow turns stray from an even motion, degrees mechanical rms."""
    out = []
    for t, position, _ in runs:
        good = (t > 1.0) & (t < t[-1] - 1.0)
        line = np.polyval(np.polyfit(t[good], position[good], 1), t[good])
        out.append(np.std(position[good] - line) * 360.0 / COUNTS)
    return float(np.mean(out))


def compared(found: dict[str, dict[str, Any]], maps: dict[str, Any]) -> list[dict[str, Any]]:
    """Return, order by order, the maps' torque (A) and phase and what the two kinds of runs say."""
    rows = []
    for n in ORDERS:
        every = [maps[m][0][n] for m in MAPS]
        mean = complex(np.mean(every))
        row: dict[str, Any] = {
            "order": n,
            "map": abs(mean),
            "map_spread": float(np.std(np.abs(every), ddof=1)),
            "map_phase": float(np.angle(mean)),
        }
        for key, case in (
            ("slow", "slow, without compensation"),
            ("spin", "spin-ups, without compensation"),
        ):
            own = next((o for o in found[case]["motion"]["orders"] if o["order"] == n), None)
            if own is not None:
                off = math.remainder(own["phase"]["value"] - row["map_phase"], math.tau)
                row |= {key: own["current"]["value"], f"{key}_phase_off": off}
        rows.append(row)
    return rows


def value(case: dict[str, Any], name: str, scale: float = 1.0) -> str:
    """Return a parameter of the best set with its interval."""
    own = case["hypotheses"][0]["parameters"].get(name)
    if own is None:
        return "–"
    return (
        f"{scale * own['value']:.3g} [{scale * own['ci95'][0]:.3g}, {scale * own['ci95'][1]:.3g}]"
    )


def page(found: dict[str, Any], rows: list[dict[str, Any]], values: dict[str, float]) -> str:
    """Return the results as a page."""
    lines = ["An ODrive's runs without voltages, by `python -m experiments.odrive_cogging`.", ""]
    lines += [
        (
            "| case | verdict | effects | J before → after | dry friction (A) | current late "
            "(ms) | inertia (1e-4 kg m²) |"
        )
    ]
    lines += ["|---|---|---|---|---|---|---|"]
    for name, case in found.items():
        effects = ", ".join(case["hypotheses"][0]["effects"])
        gap, inertia = case["gap"], case["motion"]["inertia"]
        j = (
            f"{1e4 * inertia['value']:.2f} [{1e4 * inertia['ci95'][0]:.2f}, "
            f"{1e4 * inertia['ci95'][1]:.2f}]"
        )
        lines.append(
            f"| {name} | {case['verdict']} | {effects} | {gap['before']:.1f} → {gap['after']:.2f} "
            f"| {value(case, 'coulomb_friction.torque', 1.0 / CONSTANT)} | "
            f"{value(case, 'current_filter.time_constant', 1e3)} | {j} |"
        )
    lines += [
        "",
        (
            "Cogging, torque on the rotor in A of i_q; phases (rad) beside the author's maps "
            "of holding current, the"
        ),
    ]
    lines += [f"mean of {len(MAPS)}:", ""]
    lines += ["| order | map | slow turns | spin-ups | phase off, slow | phase off, spin-ups |"]
    lines += ["|--:|--:|--:|--:|--:|--:|"]
    for r in rows:
        cells = [
            f"{r[k]:{form}}" if k in r else "–"
            for k, form in (
                ("slow", ".3f"),
                ("spin", ".3f"),
                ("slow_phase_off", "+.2f"),
                ("spin_phase_off", "+.2f"),
            )
        ]
        lines.append(
            f"| {r['order']} | {r['map']:.3f} ± {r['map_spread']:.3f} | {' | '.join(cells)} |"
        )
    return "\n".join([*lines, "", BELIEVE.format(**{**values, "inertia": 1e4 * values["inertia"]})])


def main() -> None:
    """Diagnose, compare with the author's maps, write the page, the numbers and the figure."""
    data = shared("SENSORLESS_DATA", "realdata") / "odrive_cogging"
    with tempfile.TemporaryDirectory() as folder:
        found = cases(data, Path(folder))
    names = (*MAPS, "e_16r", "rev_16")
    maps = {m: holding_map(data / "coggingmap_0" / f"cogging_measure_final_{m}.npy") for m in names}
    rows = compared(found, maps)
    runs = {
        w: [np.load(data / "slow2" / f"{w}_{k}.npy") for k in range(3)] for w in ("nocomp", "comp")
    }
    forward, back = (
        np.mean([maps[m][1] for m in MAPS]),
        np.mean([maps[m][1] for m in ("e_16r", "rev_16")]),
    )
    values = {
        "friction": float(forward - back) / 2.0,
        "inertia": spin_up_inertia(data),
        "ripple_without": ripple(runs["nocomp"]),
        "ripple_with": ripple(runs["comp"]),
    }
    drawn, axes = new_figure(1, 2, 4.6, 3.4)
    place = np.arange(len(rows))
    for k, (key, colour) in enumerate(
        (("map", "0.5"), ("slow", COLOURS["model"]), ("spin", COLOURS["first"]))
    ):
        axes[0, 0].bar(
            place + 0.27 * (k - 1), [r.get(key, 0.0) for r in rows], 0.27, color=colour, label=key
        )
        if key != "map":
            axes[0, 1].plot(
                place,
                [r.get(f"{key}_phase_off", np.nan) for r in rows],
                "o",
                color=colour,
                label=key,
            )
    for a, title in ((axes[0, 0], "amplitude (A)"), (axes[0, 1], "phase beside the maps (rad)")):
        a.set_xticks(place, [str(r["order"]) for r in rows])
        a.set(title=title, xlabel="order per turn")
        a.legend(fontsize=8)
    axes[0, 1].axhline(0.0, color="0.3", linewidth=0.8)
    keep = {
        name: {
            "verdict": case["verdict"],
            "before": case["gap"]["before"],
            "after": case["gap"]["after"],
            "hypothesis": case["hypotheses"][0],
            "orders": case["motion"]["orders"],
            "inertia": case["motion"]["inertia"],
            "cannot": case["motion"]["cannot"],
            "cost": case["cost"],
        }
        for name, case in found.items()
    }
    save("odrive_cogging", {"cases": keep, "orders": rows, "told": values}, drawn)
    text = page(found, rows, values)
    (RESULTS / "odrive_cogging.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
