"""What a run leaves behind: one row a recorded sample, the columns by name."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.frames import wrapped

if TYPE_CHECKING:
    import pandas

# Units in NOMENCLATURE.md.
CHANNELS = (
    "t",
    "i_a",
    "i_b",
    "i_c",
    "u_alpha",
    "u_beta",
    "theta",
    "theta_hat",
    "omega",
    "omega_hat",
    "i_d",
    "i_q",
    "ripple_d",
    "ripple_q",
    "load",
    "load_torque",
    "omega_ref",
    "i_q_ref",
    "tracking",
    "theta_read",
    "u_dc",
)
UNITS = dict(
    zip(
        CHANNELS,
        (
            "s",
            "A",
            "A",
            "A",
            "V",
            "V",
            "rad",
            "rad",
            "rad/s",
            "rad/s",
            "A",
            "A",
            "A",
            "A",
            "of rated current",
            "N m",
            "rad/s",
            "A",
            "",
            "rad",
            "V",
        ),
        strict=True,
    )
)
# what a loop writes of a sample
ROW = np.dtype([(name, np.float64) for name in CHANNELS], align=True)


@dataclass(frozen=True, repr=False)
class Recording:
    """Samples of one run; every channel of CHANNELS is an attribute, shape (n,).

    Measured: i_a, i_b, i_c (A), commanded for the interval that starts there: u_alpha, u_beta (V);
    theta_read: angle as the encoder reads it (rad); u_dc: link as the controller reads it (V).
    True: theta (rad, electrical, unwrapped), omega (rad/s), i_d, i_q (A).  Estimated: theta_hat,
    omega_hat, ripple_d, ripple_q (A).  load is in fractions of rated current, load_torque in N m.
    """

    table: Array

    @classmethod
    def of(cls, rows: NDArray[np.void]) -> Recording:
        """Return the recording that a loop wrote into rows (n,) of ROW."""
        return cls(rows.view(np.float64).reshape(len(rows), len(CHANNELS)))

    def __getattr__(self, name: str) -> Array:
        if name in CHANNELS:
            return self.table[:, CHANNELS.index(name)]
        raise AttributeError(f"a recording has no channel '{name}'; it has {', '.join(CHANNELS)}")

    def __getitem__(self, name: str) -> Array:
        if name in CHANNELS:
            return self.table[:, CHANNELS.index(name)]
        raise KeyError(f"a recording has no channel '{name}'; it has {', '.join(CHANNELS)}")

    def __iter__(self) -> Iterator[str]:
        return iter(CHANNELS)

    def __len__(self) -> int:
        return len(self.table)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *CHANNELS})

    def __repr__(self) -> str:
        t = self.table[:, 0]
        return (
            f"<Recording: {t.size} samples, {t[0] if t.size else 0:g} to "
            f"{t[-1] if t.size else 0:g} s>"
        )

    def to_pandas(self) -> pandas.DataFrame:
        """Return all channels as a data frame, units in `.attrs["units"]`; BadInput where pandas is
        missing."""
        from sandbox.output.columns import Column, frame_of, table_of

        return frame_of(table_of({name: Column(self[name], UNITS[name]) for name in CHANNELS}))

    @property
    def error(self) -> Array:
        """Position error theta - theta_hat, rad, in [-pi, pi)."""
        return wrapped(self.theta - self.theta_hat)

    def between(self, start: float, end: float) -> Recording:
        """Return the samples with start <= t < end (s)."""
        t = self.t
        return Recording(self.table[(t >= start - 1e-9) & (t < end - 1e-9)])
