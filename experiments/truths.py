"""Campaigns in a folder, and the effects that were put into each of them."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

from sandbox.withheld.making.make import CAMPAIGNS, SEAL


def truths_of(folder: Path) -> dict[str, list[str]]:
    """Return the effects put into every campaign whose truth lies beside it, or in the seal of what
    was made blindly; nothing of campaigns with a cause outside the library."""
    if (folder / SEAL).is_file():
        sealed = json.loads((folder / SEAL).read_text(encoding="utf-8"))["campaigns"]
        return {name: list(c["effects"]) for name, c in sealed.items() if not c["outside"]}
    files = folder.glob("*.truth.toml")
    return {
        p.name.removesuffix(".truth.toml"): list(tomllib.loads(p.read_text())["effects"])
        for p in files
    }


def campaigns_of(folder: Path) -> list[Path]:
    """Return the campaign folders in a folder, or in what `withheld make` wrote there."""
    inside = folder / CAMPAIGNS if (folder / SEAL).is_file() else folder
    return sorted(p for p in inside.glob("*") if (p / "campaign.toml").exists())
