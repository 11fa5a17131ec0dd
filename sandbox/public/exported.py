"""An estimator as C99 for a target: its file, the header, a motor's constants, golden vectors to check it by."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from model.parameters import Drive
from sandbox.output.files import results, write_json
from sandbox.public.loading import load_motor

if TYPE_CHECKING:
    from estimators.c.counting import Operations

COMMAND = "export-estimator"


@dataclass(frozen=True)
class Export:
    """Files (name and text) of an estimator with a motor's constants, and what a step costs."""

    name: str
    motor: str
    belief: str
    files: dict[str, str]
    state_bytes: int  # float
    operations: Operations  # of a step, on the golden vectors

    def __repr__(self) -> str:
        return f"<Export: {self.name} for {self.motor}, {', '.join(self.files)}>"

    def as_json(self) -> dict[str, Any]:
        """Return what `export-estimator.json` holds beyond its header."""
        kept = {"estimator": self.name, "motor": self.motor, "belief": self.belief, "state_bytes": self.state_bytes}
        return {**kept, "operations": asdict(self.operations), "files": list(self.files)}

    def save(self, folder: str | Path) -> Path:
        """Write every file and export-estimator.json into a folder, together; return it."""
        with results(Path(folder), COMMAND) as out:
            for name, text in self.files.items():
                (out / name).write_text(text, encoding="utf-8")
            write_json(out, COMMAND, self.as_json())
        return Path(folder)


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
