"""The bench in software, and its page of public Python: every name of `__all__`, loaded when it is first used.

from sandbox import simulate, compare, load_motor
run = simulate("ipm_exchanged", "staircase", "inversion", belief="linear")
run.plot(); run.to_dataframe(); run.save("results")
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

from sandbox.shadowing import share_names

if TYPE_CHECKING:
    from estimators.contract import Belief as Belief
    from estimators.contract import Estimate as Estimate
    from estimators.contract import Estimator as Estimator
    from estimators.contract import Sample as Sample
    from estimators.contract import Tuning as Tuning
    from model.errors import BadInput as BadInput
    from model.errors import PhysicsError as PhysicsError
    from sandbox.drive.scenario import Scenario as Scenario
    from sandbox.drive.scenario import Segment as Segment
    from sandbox.public.campaigns.checked import check as check
    from sandbox.public.campaigns.checked import plan as plan
    from sandbox.public.campaigns.diagnosed import diagnose as diagnose
    from sandbox.public.campaigns.identified import identify as identify
    from sandbox.public.campaigns.replayed import replay as replay
    from sandbox.public.catalogue import describe as describe
    from sandbox.public.catalogue import list_datasets as list_datasets
    from sandbox.public.catalogue import list_effects as list_effects
    from sandbox.public.catalogue import list_estimators as list_estimators
    from sandbox.public.catalogue import list_motors as list_motors
    from sandbox.public.catalogue import list_presets as list_presets
    from sandbox.public.catalogue import list_scenarios as list_scenarios
    from sandbox.public.catalogue import list_tests as list_tests
    from sandbox.public.converting import convert_motor as convert_motor
    from sandbox.public.exporting import export_estimator as export_estimator
    from sandbox.public.loading import load_estimator as load_estimator
    from sandbox.public.loading import load_estimator_library as load_estimator_library
    from sandbox.public.loading import load_motor as load_motor
    from sandbox.public.loading import load_scenario as load_scenario
    from sandbox.public.loading import read_campaign as read_campaign
    from sandbox.public.loading import use_effects as use_effects
    from sandbox.public.motor import audit as audit
    from sandbox.public.motor import maps as maps
    from sandbox.public.protocols import bench as bench
    from sandbox.public.protocols import protocol as protocol
    from sandbox.public.runs import compare as compare
    from sandbox.public.runs import simulate as simulate
    from sandbox.public.showing import show as show
    from sandbox.public.showing import view as view
    from sandbox.public.sweeps import sweep as sweep
    from sandbox.public.sweeps import tolerances as tolerances
    from sandbox.public.verifying import verify as verify

__all__ = [  # noqa: RUF022 - in the order of the work: load, run, judge, look
    "load_motor", "convert_motor", "load_scenario", "load_estimator", "load_estimator_library", "read_campaign",
    "list_motors", "list_scenarios", "list_estimators", "list_effects", "list_datasets", "list_presets", "list_tests",
    "describe", "use_effects", "plan", "check",
    "simulate", "compare", "tolerances", "sweep", "protocol", "bench", "audit", "maps", "identify", "diagnose",
    "replay", "export_estimator", "verify", "show", "view",
    "Scenario", "Segment", "Estimator", "Belief", "Tuning", "Sample", "Estimate", "BadInput", "PhysicsError",
]  # fmt: skip

_HOMES = {
    "estimators.contract": ("Estimator", "Belief", "Tuning", "Sample", "Estimate"),
    "model.errors": ("BadInput", "PhysicsError"),
    "sandbox.drive.scenario": ("Scenario", "Segment"),
    "sandbox.public.loading": (
        "load_motor", "load_scenario", "load_estimator", "load_estimator_library", "read_campaign", "use_effects",
    ),
    "sandbox.public.exporting": ("export_estimator",),
    "sandbox.public.converting": ("convert_motor",),
    "sandbox.public.catalogue": (
        "list_motors", "list_scenarios", "list_estimators", "list_effects", "list_datasets", "list_presets",
        "list_tests", "describe",
    ),
    "sandbox.public.campaigns.checked": ("plan", "check"),
    "sandbox.public.runs": ("simulate", "compare"),
    "sandbox.public.protocols": ("protocol", "bench"),
    "sandbox.public.sweeps": ("sweep", "tolerances"),
    "sandbox.public.motor": ("audit", "maps"),
    "sandbox.public.campaigns.diagnosed": ("diagnose",),
    "sandbox.public.campaigns.identified": ("identify",),
    "sandbox.public.campaigns.replayed": ("replay",),
    "sandbox.public.showing": ("show", "view"),
    "sandbox.public.verifying": ("verify",),
}  # fmt: skip
_HOME = {name: home for home, names in _HOMES.items() for name in names}


share_names()


class _Page(ModuleType):
    """This package: importing the rooms `sandbox.sweep` and `sandbox.replay` leaves those names to functions."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Page


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'sandbox' has no attribute '{name}'")
    found = getattr(import_module(_HOME[name]), name)
    globals()[name] = found  # the next look costs nothing
    return found


def __dir__() -> list[str]:
    return sorted(__all__)
