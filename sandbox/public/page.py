"""The page of public Python, what `from sandbox import ...` gives: every name of `__all__`, loaded
when it is first used."""

from __future__ import annotations

import ast
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # where each name of the page is; read below, too
    from estimators.contract import Belief, Estimate, Estimator, Sample, Tuning
    from model.errors import BadInput, PhysicsError
    from sandbox.drive.scenario import Scenario, Segment
    from sandbox.public.authoring import compiled, compiled_step, get_include
    from sandbox.public.campaigns.checked import check, plan
    from sandbox.public.campaigns.diagnosed import diagnose
    from sandbox.public.campaigns.identified import identify
    from sandbox.public.campaigns.replayed import replay
    from sandbox.public.campaigns.settings import check_settings
    from sandbox.public.catalogue import (
        describe,
        list_datasets,
        list_effects,
        list_estimators,
        list_motors,
        list_presets,
        list_scenarios,
        list_tests,
    )
    from sandbox.public.converting import convert_motor
    from sandbox.public.exports.drive import export_drive
    from sandbox.public.exports.estimator import export_estimator
    from sandbox.public.loading import (
        load_estimator,
        load_estimator_library,
        load_motor,
        load_scenario,
        read_campaign,
        use_effects,
    )
    from sandbox.public.motor import audit, maps
    from sandbox.public.protocols import bench, protocol
    from sandbox.public.runs import compare, simulate
    from sandbox.public.showing import show, view
    from sandbox.public.sweeps import sweep, tolerances
    from sandbox.public.verifying import verify

    __version__: str

__all__ = [  # noqa: RUF022 - in the order of the work: load, run, judge, look
    "load_motor",
    "convert_motor",
    "load_scenario",
    "load_estimator",
    "load_estimator_library",
    "read_campaign",
    "list_motors",
    "list_scenarios",
    "list_estimators",
    "list_effects",
    "list_datasets",
    "list_presets",
    "list_tests",
    "describe",
    "use_effects",
    "plan",
    "check",
    "simulate",
    "compare",
    "tolerances",
    "sweep",
    "protocol",
    "bench",
    "audit",
    "maps",
    "identify",
    "diagnose",
    "replay",
    "check_settings",
    "export_estimator",
    "export_drive",
    "verify",
    "show",
    "view",
    "Scenario",
    "Segment",
    "Estimator",
    "Belief",
    "Tuning",
    "Sample",
    "Estimate",
    "compiled",
    "compiled_step",
    "get_include",
    "BadInput",
    "PhysicsError",
]


def _homes() -> dict[str, str]:
    """Return the module of each name of the page, as the imports above have it."""
    tree = ast.parse(Path(__file__).read_text(encoding="utf-8"))
    block = next(node.body for node in tree.body if isinstance(node, ast.If))
    found = [node for node in block if isinstance(node, ast.ImportFrom)]
    return {alias.name: str(node.module) for node in found for alias in node.names}


HOME = _homes()  # the module of each name


class Page(ModuleType):
    """The package `sandbox`: importing its room `sandbox.replay` leaves that name to the
    function."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules["sandbox"].__class__ = Page


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from sandbox.output.provenance import version

        return version()
    if name not in HOME:
        raise AttributeError(f"module 'sandbox' has no attribute '{name}'")
    found = getattr(import_module(HOME[name]), name)
    setattr(sys.modules["sandbox"], name, found)  # the next look costs nothing
    return found


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
