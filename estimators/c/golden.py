"""Golden vectors: a setup, samples, and what the Python estimators tell for them (`golden.json`:
`ipm_exchanged`)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from estimators.contract import Belief, Tuning
from model.energy import Energy

FILE = Path(__file__).with_name("golden.json")
WINDOW = 40  # samples
COLUMNS = ("i_alpha_A", "i_beta_A", "u_alpha_V", "u_beta_V", "carrier_s")
ESTIMATED = ("theta_rad", "omega_rad_s", "axis_rad")


@dataclass(frozen=True)
class Golden:
    """A motor's setup, samples (n, 5), what each estimator tells (n, 3), both in windows of WINDOW
    samples.

    An estimator begins each window anew, told one of `angles` (rad): where L_d > L_q an angle error
    grows while it looks at samples that others have made, by kp |L_q / (L_q - L_d)|, and so would
    the last digit in a long run.
    """

    motor: str
    belief: Belief
    tuning: Tuning
    angles: tuple[float, ...]
    samples: np.ndarray
    estimates: dict[str, np.ndarray]

    def text(self) -> str:
        """Return the file: numbers of nine digits, a sample a line."""
        belief = {
            **self.belief.energy._asdict(),
            **dict(zip(Belief._fields[1:], self.belief[1:], strict=True)),
        }
        head: dict[str, Any] = {
            "motor": self.motor,
            "belief": belief,
            "tuning": self.tuning._asdict(),
            "angles": self.angles,
        }
        lines = [f'"{key}": {json.dumps(value)}' for key, value in head.items()]
        for key, table in {"samples": self.samples, **self.estimates}.items():
            rows = ",\n".join(f"[{', '.join(f'{v:.9g}' for v in row)}]" for row in table)
            lines.append(f'"{key}": [\n{rows}]')
        return (
            "{" + ",\n".join([*lines, f'"columns": {json.dumps([*COLUMNS, *ESTIMATED])}']) + "}\n"
        )


def read_golden(path: Path = FILE) -> Golden:
    """Return golden vectors from a file."""
    found = json.loads(path.read_text(encoding="utf-8"))
    belief = found["belief"]
    energy = Energy(*(belief.pop(name) for name in Energy._fields))
    estimates = {
        k: np.array(v)
        for k, v in found.items()
        if k not in ("motor", "belief", "tuning", "angles", "samples", "columns")
    }
    return Golden(
        found["motor"],
        Belief(energy, **belief),
        Tuning(**found["tuning"]),
        tuple(found["angles"]),
        np.array(found["samples"]),
        estimates,
    )
