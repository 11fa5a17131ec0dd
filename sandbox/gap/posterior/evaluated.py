"""A fitted set of effects, weighed with traces of all other effects beside it."""

from __future__ import annotations

from dataclasses import dataclass

from sandbox.gap.evidence.algebra import Algebra, Prior
from sandbox.gap.evidence.fit import Fit
from sandbox.gap.evidence.normal import Normal
from sandbox.gap.posterior.linear_model import LinearModel


@dataclass(frozen=True)
class EvaluatedModel:
    """A set of effects fitted and weighed: its fit, the equations of all effects there, prior and log evidence;
    impossible: no drive can have it."""

    fit: Fit
    model: LinearModel
    prior: Prior
    log_evidence: float
    impossible: bool = False

    @property
    def effects(self) -> tuple[str, ...]:
        """The effects of the set."""
        return self.fit.effects

    @property
    def normal(self) -> Normal:
        """Normal equations of all effects at its point."""
        return self.model.normal

    @property
    def equations(self) -> Algebra:
        """The same summed."""
        return self.model.equations
