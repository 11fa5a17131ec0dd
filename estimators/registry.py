"""Every estimator by name; a module is imported only when asked for."""

from __future__ import annotations

from importlib import import_module

from estimators.contract import Estimator
from model.errors import unknown

MODULES = {
    "qnull": "estimators.qnull",
    "inversion": "estimators.inversion",
    "rotating": "estimators.rotating",
    "table": "estimators.table",
    "arbitrary": "estimators.arbitrary",
    "pwm_ripple": "estimators.pwm_ripple",
    "fluxdemod": "estimators.fluxdemod",
    "pll3": "estimators.pll3",
    "mechanical": "estimators.mechanical",
    "monitor": "estimators.monitor",
    "active_flux": "estimators.active_flux",
    "hybrid": "estimators.hybrid",
    "ekf": "estimators.kalman",
    "ukf": "estimators.unscented",
    "ekf_filterpy": "estimators.kalman_filterpy",
    "ukf_filterpy": "estimators.unscented_filterpy",
}


def estimator_names() -> list[str]:
    """Return the known names, the usual one first."""
    return list(MODULES)


def load_estimator(name: str) -> Estimator:
    """Return an estimator by name; BadInput with the nearest name for an unknown one."""
    if name not in MODULES:
        raise unknown("estimator", name, MODULES)
    estimator: Estimator = import_module(MODULES[name]).ESTIMATOR
    return estimator
