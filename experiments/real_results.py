"""Write a figure and its numbers to `experiments/results`: both appear whole or not at all."""

from __future__ import annotations

import datetime
import json
import os
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from experiments.real_drives.fitted import Fitted
from model.datasets import dataset

RESULTS = Path(os.environ.get("SENSORLESS_RESULTS") or Path(__file__).parent / "results")
BLUE, ORANGE, GREY = "#1f5fa8", "#d9730d", "0.45"
plt.rcParams.update(
    {
        "font.size": 10,
        "axes.grid": True,
        "grid.alpha": 0.3,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.titlesize": 10.5,
        "axes.titleweight": "bold",
        "legend.frameon": False,
        "legend.fontsize": 9,
        "figure.dpi": 150,
    }
)


def keep(
    figure: Any,
    name: str,
    data: str,
    values: dict[str, Fitted],
    checks: dict[str, Any],
    limits: str,
) -> None:
    """Write NAME.png and NAME.json: fitted values, held-out checks, and what the data cannot
    show."""
    entry = dataset(data)
    record = {
        "schema": 1,
        "experiment": name,
        "date": datetime.date.today().isoformat(),
        "data": {
            "name": data,
            "measured": entry.measured,
            "citation": entry.citation,
            "licence": entry.licence,
        },
        "values": {key: value.record() for key, value in values.items()},
        "checks": checks,
        "limits": limits,
    }
    RESULTS.mkdir(parents=True, exist_ok=True)
    aside = RESULTS / f".{name}.{os.getpid()}"
    figure.savefig(aside, format="png", dpi=150)
    aside.replace(RESULTS / f"{name}.png")
    aside.write_text(json.dumps(record, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    aside.replace(RESULTS / f"{name}.json")
    for key, value in values.items():
        print(f"{key:32s} {value.value: .4g}  [{value.low:.4g}, {value.high:.4g}] {value.unit}")
    for key, check in checks.items():
        print(f"{key:32s} {check}")
    print(f"limits: {limits}\nwrote {RESULTS / name}.png, .json")
