"""Estimators in C for a motor: its constants, a short run's samples, what the Python twins make of
them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from estimators.c.counting import Operations
from estimators.c.generate import HEADER, HERE, NAMES, counted, slots
from estimators.c.golden import WINDOW, Golden
from estimators.c.target import HEAD_WORDS, check_program, motor_header
from estimators.contract import Belief, Estimator, Sample, Tuning
from estimators.registry import load_estimator
from model.energy import Energy
from model.errors import BadInput, unknown
from model.frames import stationary
from model.parameters import Drive
from sandbox.drive.design import belief_of, design
from sandbox.drive.recording import Recording
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate
from sandbox.output.tables import print_prose
from sandbox.public.calls import records_call
from sandbox.public.loading import load_motor
from sandbox.public.result import Result
from sandbox.recordings.injection import carrier

MOST_WINDOWS = 6
LOADED = Scenario(
    "golden", (Segment(0.06, 1.0, 0.05, ramp=0.03),), "driven", start_up=False, start_angle=0.4
)


@dataclass(frozen=True, repr=False)
class Export(Result):
    """Files (name and text) of an estimator with a motor's constants, and what a step costs."""

    command: ClassVar[str] = "export-estimator"
    kinds: ClassVar[tuple[str, ...]] = ()
    name: str
    motor: str
    belief: str
    files: dict[str, str]
    state_bytes: int  # float
    operations: Operations  # of a step, on the golden vectors

    def summary(self) -> str:
        """Return what it is for, and its files."""
        return f"{self.name} for {self.motor}, {', '.join(self.files)}"

    def as_json(self) -> dict[str, Any]:
        """Return what `export-estimator.json` holds beyond its header."""
        kept = {
            "estimator": self.name,
            "motor": self.motor,
            "belief": self.belief,
            "state_bytes": self.state_bytes,
        }
        return {**kept, "operations": asdict(self.operations), "files": list(self.files)}

    def report(self) -> None:
        """Print what a step costs, and how the files are checked."""
        print_prose(
            f"{self.name} for {self.motor}: {self.operations.said()}; {self.state_bytes} "
            "bytes of state"
        )
        print_prose(f"files: {', '.join(self.files)}")
        print_prose("check them: cc -std=c99 -O2 *.c -lm && ./a.out")

    def _write_more(self, out: Path) -> dict[str, Any]:
        """Write every file."""
        for name, text in self.files.items():
            (out / name).write_text(text, encoding="utf-8")
        return {}


def samples_of(drive: Drive, recording: Recording) -> np.ndarray:
    """Return what an estimator was given in a run, (n, 5): i_alpha, i_beta (A), u_alpha, u_beta
    (V), carrier (s)."""
    read = np.column_stack(stationary.py_func(recording.i_a, recording.i_b, recording.i_c))
    commanded = np.column_stack([recording.u_alpha, recording.u_beta])
    primitive = np.resize(carrier(drive.injection, drive.converter).primitive, len(read))
    return np.column_stack([read, np.vstack([[0.0, 0.0], commanded[:-1]]), primitive])


def golden_of(drive: Drive, names: Iterable[str], belief: str = "saturated") -> Golden:
    """Return golden vectors of a motor that turns and takes up its load, in windows all along; a
    float holds them."""
    run = simulate(drive, LOADED, load_estimator("qnull"), belief)
    every = samples_of(drive, run.recording).astype(np.float32).astype(float)
    whole = len(every) // WINDOW
    starts = WINDOW * np.unique(np.linspace(0, whole - 1, MOST_WINDOWS).astype(int))
    samples = np.vstack([every[k : k + WINDOW] for k in starts])
    own = {name: load_estimator(name) for name in names}
    tuning = design(drive, published=all(one.takes_published for one in own.values())).tuning
    believed = belief_of(drive, belief)
    angles = tuple(float(f"{angle:.6g}") for angle in run.recording.theta[starts])
    bare = Golden(drive.name, believed, tuning, angles, samples, {})
    return replace(bare, estimates={name: in_windows(one, bare) for name, one in own.items()})


def in_windows(estimator: Estimator, golden: Golden) -> np.ndarray:
    """Return what an estimator tells for golden samples, begun anew in each window."""
    parts = np.split(golden.samples, range(WINDOW, len(golden.samples), WINDOW))
    begun = zip(parts, golden.angles, strict=True)
    return np.vstack(
        [
            in_one_window(estimator, golden.belief, golden.tuning, part, angle)
            for part, angle in begun
        ]
    )


def in_one_window(
    estimator: Estimator, belief: Belief, tuning: Tuning, samples: np.ndarray, angle: float | None
) -> np.ndarray:
    """Return what an estimator tells for samples (n, 5): theta (rad), omega (rad/s), axis (rad),
    (n, 3)."""
    state, step = estimator.init(belief, tuning, angle), estimator.step_for(belief)
    return np.array([step(state, Sample(*row), belief, tuning)[:3] for row in samples.tolist()])


@records_call
def export_estimator(
    estimator: str = "ekf", motor: str | Path | Drive = "ipm_exchanged", belief: str = "saturated"
) -> Export:
    """Return an estimator as plain C99 with float numbers, with a motor's constants, for a
    firmware.

    Parameters
    ----------
    estimator : str
        'qnull', 'inversion' or 'ekf'.
    motor : str, Path or Drive
        See `load_motor`; one with alphas (a flux map has no polynomial to print).
    belief : {'saturated', 'linear'}
        Which model of the motor the constants are of.

    Returns
    -------
    Export
        `.files` (name and text: the estimator, the header, `motor.h`, `check.c` with golden
        vectors), `.operations` of a step, `.state_bytes`, `.save(folder)`.

    Raises
    ------
    BadInput
        For an estimator that is not translated, a motor with a flux map, or a name that is not
        known.

    Examples
    --------
    >>> from sandbox import export_estimator
    >>> list(export_estimator("qnull", "ipm_exchanged").files)
    ['sensorless_estimator.h', 'qnull.c', 'motor.h', 'check.c']
    """
    return exported(estimator, load_motor(motor), belief)


def exported(name: str, drive: Drive, belief: str) -> Export:
    """Return an estimator's files for a motor; BadInput where it or the motor has none."""
    if name not in NAMES:
        raise unknown("estimator in C", name, NAMES)
    if belief not in ("saturated", "linear"):
        raise BadInput(f"belief '{belief}' is neither 'saturated' nor 'linear'")
    if not isinstance(belief_of(drive, belief).energy, Energy):
        raise BadInput(
            f"'{drive.name}' has a flux map, and an estimator in C takes the quartic energy; "
            "export its linear belief or a motor with alphas"
        )
    golden = golden_of(drive, (name,), belief)
    files = {
        HEADER.name: HEADER.read_text(encoding="utf-8"),
        f"{name}.c": HERE.joinpath(f"{name}.c").read_text(encoding="utf-8"),
        "motor.h": motor_header(golden, name, belief),
        "check.c": check_program(golden, name),
    }
    words = slots(name) + HEAD_WORDS
    return Export(name, drive.name, belief, files, 4 * words, counted(name, golden))
