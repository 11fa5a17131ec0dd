"""What the scripts share: where results go, JSON with date and origin, figures of one look."""

from __future__ import annotations

import datetime
import json
import math
import os
from pathlib import Path
from typing import Any

import numpy as np

RESULTS = Path(__file__).parent / "results"
COLOURS = {
    "model": "#1f4e79",
    "data": "#c0392b",
    "first": "#e08e0b",
    "linear": "#7f8c8d",
    "other": "#2e8b57",
}


def new_figure(
    rows: int = 1, columns: int = 1, width: float = 5.0, height: float = 3.6
) -> tuple[Any, Any]:
    """Return a figure and its axes (rows, columns), grids drawn, no upper and right frame."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width * columns, height * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    for a in axes.flat:
        a.grid(color="0.9", linewidth=0.6)
        a.spines[["top", "right"]].set_visible(False)
        a.axhline(0.0, color="0.6", linewidth=0.7, zorder=0)
    return figure, axes


def save(name: str, numbers: dict[str, Any], figure: Any = None) -> None:
    """Write results/<name>.json (and .png), each whole or not at all; numbers undefined become
    null."""
    RESULTS.mkdir(exist_ok=True)
    if figure is not None:
        partial = RESULTS / f".{name}.png"
        figure.savefig(partial, format="png", dpi=110)
        os.replace(partial, RESULTS / f"{name}.png")
    body = {"experiment": name, "date": datetime.date.today().isoformat(), **numbers}
    partial = RESULTS / f".{name}.json"
    partial.write_text(json.dumps(plain(body), indent=1) + "\n", encoding="utf-8")
    os.replace(partial, RESULTS / f"{name}.json")
    print(f"{name}: written")


def plain(x: Any) -> Any:
    """Return a value made of JSON's own types, floats to 7 digits."""
    if isinstance(x, dict):
        return {str(k): plain(v) for k, v in x.items()}
    if isinstance(x, (list, tuple, np.ndarray)):
        return [plain(v) for v in x]
    if isinstance(x, (bool, np.bool_)):
        return bool(x)
    if isinstance(x, (int, np.integer)):
        return int(x)
    if isinstance(x, (float, np.floating)):
        return float(f"{x:.7g}") if math.isfinite(x) else None
    return x


def shared(variable: str, name: str) -> Path:
    """Return a folder of data that are not part of the repository: an environment variable or
    beside the checkout."""
    path = Path(os.environ.get(variable) or Path(__file__).resolve().parents[2] / "shared" / name)
    if not path.is_dir():
        raise SystemExit(f"no folder '{path}': set {variable} to the data")
    return path
