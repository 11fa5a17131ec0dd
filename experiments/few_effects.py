"""`python -m experiments.few_effects withheld score DIR`: the command line, with diagnoses of few
effects.

For `faults` and `full_disk`: of others no more is learnt, but a whole diagnosis takes a minute.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

LEFT = ("stator_resistance", "magnet_flux", "dead_time", "current_gain")


def left_out() -> list[str]:
    """Return the effects that are not diagnosed."""
    from model.effects.library import effect_names

    return [e for e in effect_names() if e not in LEFT]


def few(folder: Path, exclude: Sequence[str] = ()) -> Any:
    """Diagnose a campaign as `withheld score` does, with few effects."""
    from sandbox.withheld.scoring import blind

    return getattr(blind, "whole", blind.standard)(folder, (*exclude, *left_out()))


def scoring(run: Callable[..., None], *given: Any, **named: Any) -> None:
    """Run `withheld score` with diagnoses of few effects; imported here, where a signal is
    heard."""
    from experiments.few_effects import few
    from sandbox.withheld.scoring import blind

    blind.whole, blind.standard = blind.standard, few  # type: ignore[attr-defined]
    run(*given, **named)


def main() -> int:
    """Run the command line."""
    from sandbox.cli import main as whole
    from sandbox.cli import withholding

    run = withholding.score
    withholding.score = functools.wraps(run)(functools.partial(scoring, run))  # type: ignore[assignment]
    return whole()


if __name__ == "__main__":
    raise SystemExit(main())
