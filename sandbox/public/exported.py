"""An estimator as C99 for a target: its file, the header, a motor's constants, golden vectors to check it by."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from model.parameters import Drive
from sandbox.public.calls import told
from sandbox.public.loading import load_motor

if TYPE_CHECKING:
    from sandbox.public.exporting import Export


@told
def export_estimator(
    estimator: str = "ekf", motor: str | Path | Drive = "ipm_exchanged", belief: str = "saturated"
) -> Export:
    """Return an estimator as plain C99 with float numbers, with a motor's constants, for a firmware.

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
        `.files` (name and text: the estimator, the header, `motor.h`, `check.c` with golden vectors),
        `.operations` of a step, `.state_bytes`, `.save(folder)`.

    Raises
    ------
    BadInput
        For an estimator that is not translated, a motor with a flux map, or a name that is not known.

    Examples
    --------
    >>> from sandbox import export_estimator
    >>> list(export_estimator("qnull", "ipm_exchanged").files)
    ['sensorless_estimator.h', 'qnull.c', 'motor.h', 'check.c']
    """
    from sandbox.public.exporting import exported

    return exported(estimator, load_motor(motor), belief)
