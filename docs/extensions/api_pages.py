"""The page of Python: every public name, by what one does with it."""

from __future__ import annotations

import inspect
from typing import Any

from repository_pages import PAGES

import sandbox

GROUPS = {
    "Load": (
        "load_motor",
        "load_scenario",
        "load_estimator",
        "load_estimator_library",
        "read_campaign",
        "use_effects",
    ),
    "Look up": (
        "list_motors",
        "list_scenarios",
        "list_estimators",
        "list_effects",
        "list_datasets",
        "list_presets",
        "list_tests",
        "describe",
    ),
    "Run": ("simulate", "compare", "tolerances", "sweep", "protocol", "bench"),
    "Without a run": ("audit", "maps", "convert_motor", "export_estimator", "export_drive"),
    "Recordings": ("plan", "check", "identify", "diagnose", "replay", "check_settings"),
    "Look at results": ("show", "view", "verify"),
}
RESULTS = {
    "sandbox.public.result.Result": "to_table, to_dataframe, plot, to_rerun, save, as_json, columns, summary",
    "sandbox.public.runs.SimulationResult": "run, recording, rows, lost_lock, error_deg",
    "sandbox.public.runs.ComparisonResult": "runs, rows",
    "sandbox.public.sweeps.SweepResult": "groups, traces",
    "sandbox.public.sweeps.ToleranceResult": "",
    "sandbox.public.protocols.ProtocolResult": "",
    "sandbox.public.protocols.BenchResult": "",
    "sandbox.public.motor.AuditResult": "passed",
    "sandbox.public.motor.MapsResult": "",
    "sandbox.public.campaigns.checked.PlanResult": "",
    "sandbox.public.campaigns.checked.CheckResult": "ok, mistakes",
    "sandbox.public.campaigns.identified.IdentificationResult": "",
    "sandbox.public.campaigns.diagnosed.DiagnosisResult": "verdict",
    "sandbox.public.campaigns.moved.MotionResult": "verdict",
    "sandbox.public.campaigns.replayed.ReplayResult": "",
    "sandbox.public.exports.estimator.Export": "save",
    "sandbox.public.verifying.Verification": "same, summary, save",
}
HEAD = """# Python

Every command but `withheld` has its function in the module `sandbox`. A function takes names, files or objects, and
returns a result that becomes a table, a figure, a trace or a folder of files. Importing `sandbox` is quick: what a
function needs is loaded when it is first called.

```python
from sandbox import compare, load_motor, simulate
```

What you build or are handed (`Scenario`, `Segment`, `Estimator`, `Sample`, `Belief`, `Tuning`, `Estimate`, and the
`motor` of a drive) stands on a page of its own: [objects and their fields](fields.md).

"""

RESULTS_HEAD = """## Results

Every result can do what the first class lists. `.plot()` returns a figure of matplotlib, whose panels are its `.axes`;
`.plot(ax=...)` draws in axes of your own, as many as the figure has panels:

```python
import matplotlib.pyplot as plt
from sandbox import simulate

figure, axes = plt.subplots(4, 2, sharex="col")
simulate(belief="linear").plot(ax=axes[:, 0])
simulate(belief="saturated").plot(ax=axes[:, 1])
```

"""


def linked(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Turn files of the repository that a docstring names into links to their pages
    (`autodoc-process-docstring`)."""
    for page_, path in PAGES.items():
        lines[:] = [line.replace(path, f":doc:`/{page_}`") for line in lines]


def block(lines: list[str]) -> str:
    """Return directives as MyST takes them."""
    return "```{eval-rst}\n" + "\n".join(lines) + "\n```\n\n"


def page() -> str:
    """Return the whole page; a new public function that no group names stands under `More`."""
    named = {name for names in GROUPS.values() for name in names}
    rest = tuple(
        n for n in sandbox.__all__ if inspect.isfunction(getattr(sandbox, n)) and n not in named
    )
    text = HEAD
    for title, names in (GROUPS | ({"More": rest} if rest else {})).items():
        text += f"## {title}\n\n" + block([f".. autofunction:: sandbox.{name}" for name in names])
    text += RESULTS_HEAD
    lines = []
    for name, members in RESULTS.items():
        lines += [f".. autoclass:: {name}", *([f"   :members: {members}"] if members else [])]
    text += block(lines)
    return (
        text
        + "## Errors\n\n"
        + block([f".. autoexception:: sandbox.{n}" for n in ("BadInput", "PhysicsError")])
    )
