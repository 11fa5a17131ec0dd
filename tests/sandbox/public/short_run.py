"""A short scenario, and what a command writes of it."""

from __future__ import annotations

import json

from model.drive_files import MOTORS

SHORT_TOML = """
[scenario]
settle = 0.1
[[segment]]
duration = 0.2
[[segment]]
duration = 0.3
load = 1.0
ramp = 0.05
settle = 0.2
"""


def content(folder, command):
    document = json.loads((folder / f"{command}.json").read_text())
    assert (document["schema"], document["command"]) == (1, command)
    assert document["version"]
    return document


def motor_file(tmp_path, old, new):
    path = tmp_path / "m.toml"
    path.write_text((MOTORS / "ipm_exchanged.toml").read_text().replace(old, new))
    return str(path)
