"""What lies between runs: entries of the cache in each other's place or forged, and the arguments
that results hold.

An entry in another's place must never be believed: the reader here compares with what was computed.
"""

from __future__ import annotations

import contextlib
import inspect
import json
import os
import shutil
import tempfile
from copy import deepcopy
from dataclasses import astuple
from functools import cache
from pathlib import Path
from unittest import mock

import numpy as np

import sandbox
from model.drive_files import load_drive
from model.energy import flux_from_current
from model.errors import PhysicsError
from model.fluxmap import FluxMap, write_map
from model.kernels import kept
from sandbox.drive.design import design
from sandbox.output.files import write_json
from sandbox.output.provenance import made_by
from sandbox.public.calls import EFFECTS, LEFT_OUT
from sandbox.public.verifying import functions, verify
from tests.fuzz.arrays import forged_arrays
from tests.fuzz.doors import Door
from tests.fuzz.mutations import TREE, damaged_json

MOTORS = ("ipm", "spm")
MAPPED = """
[motor]
pole_pairs = 6
resistance = 12.15
inertia = 0.0011
rated_current = 1.2
rated_torque = 1.06
rated_speed_rpm = 1800.0
[flux_map]
file = "{}.csv"
magnet = "d"
cells = [4, 4]
smooth = 1e-3
"""
ODD_WORDS = (
    "out",
    "/dev/null",
    "../x",
    "ipm",
    "spm",
    "-1",
    "nan",
    "a" * 5000,
    "a\0b",
    "\x1b[2J",
    "qnull",
)


@contextlib.contextmanager
def cached(folder):
    """Let the cache stand in a folder, as it was made; yield its entries."""
    place = folder / "cache"
    with mock.patch.dict(os.environ, {"SENSORLESS_CACHE": str(place)}):
        if (folder / "whole").is_dir():
            shutil.copytree(folder / "whole", place)
        try:
            yield lambda: sorted(place.glob("*/*.kept"))
        finally:
            shutil.rmtree(place)


def numbers_of(folder):
    """Return what the cache remembers: two designs and two fitted maps, as numbers."""
    loops = [
        [astuple(loop) for loop in design(load_drive(motor)).loops.values()] for motor in MOTORS
    ]
    maps = [load_drive(folder / f"{name}.toml").motor for name in "ab"]
    fluxes = [[m.magnet_flux, *map(float, flux_from_current(m.energy, 0.7, 0.4))] for m in maps]
    return json.loads(json.dumps([loops, fluxes]))


@cache
def whole_cache():
    """Return all files of `make_cache`, which takes seconds, by their names."""
    with tempfile.TemporaryDirectory() as place:
        make_first_cache(Path(place))
        return {
            path.relative_to(place): path.read_bytes()
            for path in Path(place).rglob("*")
            if path.is_file()
        }


def make_cache(folder):
    """Keep designs and maps; `places.json` says which entry is put in whose place, `body.*` what an
    entry holds."""
    for name, content in whole_cache().items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)


def make_first_cache(folder):
    """Make them where there are none."""
    motor, i = load_drive("ipm_exchanged").motor, np.linspace(-2.4, 2.4, 7)
    d, q = flux_from_current(motor.energy, *np.meshgrid(i, i, indexing="ij"))
    for name, scale in (("a", 1.0), ("b", 1.1)):
        write_map(
            folder / f"{name}.csv", FluxMap(name, i, i, scale * d + motor.magnet_flux, scale * q)
        )
        (folder / f"{name}.toml").write_text(MAPPED.format(name))
    with cached(folder) as entries:
        (folder / "numbers.json").write_text(json.dumps(numbers_of(folder)))
        shutil.copytree(folder / "cache", folder / "aside")
        (folder / "places.json").write_text(json.dumps(list(range(len(entries())))))
        bodies = {path.parent.name: path.read_bytes().partition(b"\n")[2] for path in entries()}
    (folder / "aside").rename(folder / "whole")
    (folder / "body.json").write_bytes(bodies["designs"])
    (folder / "body.npz").write_bytes(bodies["maps"])


def exchanged(content, chance):
    """Return which entry stands in whose place; an entry that is -1 is cut short."""
    places = json.loads(content)
    for k in chance.sample(range(len(places)), 2):
        places[k] = chance.choice([-1, *range(len(places))])
    return json.dumps(places).encode()


def read_exchanged(folder):
    """Put entries into others' places; what is computed then is what it was."""
    with cached(folder) as entries:
        whole = [path.read_bytes() for path in entries()]
        for path, k in zip(
            entries(), json.loads((folder / "places.json").read_text()), strict=True
        ):
            path.write_bytes(whole[k] if k >= 0 else path.read_bytes()[:-20])
        assert numbers_of(folder) == json.loads((folder / "numbers.json").read_text())


def read_forged(folder):
    """Give each entry of a kind the content of `body.*`, under a right seal; nobody can tell, but
    it may not escape."""
    with cached(folder) as entries:
        for path in entries():
            body = folder / ("body.json" if path.parent.name == "designs" else "body.npz")
            kept.write(path, body.read_bytes())
        numbers_of(folder)


def make_calls(folder):
    """Write what a result says of its making, as every function would have said it with its own
    defaults."""
    made = made_by()
    made["call"] = {"function": "audit", "arguments": {"motor": "ipm"}, "objects": [], "inputs": {}}
    write_json(folder, "audit", {"motor": "ipm"}, made=made)


@cache
def calls():
    """Return the arguments of every function that results name: what has no default is 'ipm'."""
    found = {}
    for name in functions():
        known = inspect.signature(getattr(sandbox, name)).parameters.values()
        own = [
            p
            for p in known
            if p.name not in LEFT_OUT and p.kind is not inspect.Parameter.VAR_KEYWORD
        ]
        found[name] = {
            p.name: "ipm" if p.default is inspect.Parameter.empty else p.default for p in own
        }
        found[name] = {
            k: v for k, v in found[name].items() if isinstance(v, (str, int, float, type(None)))
        }
    return found


def odd_call(content, chance):
    """Return a result with another call in it: another function, odd or foreign arguments."""
    if chance.random() < 0.2:
        return damaged_json(content.decode(), chance)
    whole = json.loads(content)
    function = chance.choice([*functions(), "withheld score", "use_effects", "__import__"])
    arguments = deepcopy(calls().get(function, {"motor": "ipm"}))
    for _ in range(chance.choice((0, 1, 1, 2, 3))):
        names = (
            list(arguments)
            if arguments and chance.random() < 0.7
            else ["x", EFFECTS, *LEFT_OUT, "record", "out"]
        )
        arguments[chance.choice(names)] = deepcopy(
            chance.choice([*TREE, *ODD_WORDS, ["ipm", 5], ["a.py"]])
        )
    whole["made_by"]["call"] |= {"function": function, "arguments": arguments}
    return json.dumps(whole).encode()


def read_call(folder):
    """Verify the result up to where the function is called, in its own folder: what it would write
    is seen."""
    reached = mock.patch(
        "sandbox.public.verifying._called", side_effect=PhysicsError("the physics begins here")
    )
    with contextlib.chdir(folder), reached, contextlib.suppress(PhysicsError):
        verify(Path("audit.json"))


KEPT_DOORS = (
    Door("exchanged", make_cache, ("places.json",), exchanged, read_exchanged),
    Door(
        "forged_design",
        make_cache,
        ("body.json",),
        lambda c, chance: damaged_json(c.decode(), chance),
        read_forged,
    ),
    Door("forged_map", make_cache, ("body.npz",), forged_arrays, read_forged),
    Door("call", make_calls, ("audit.json",), odd_call, read_call),
)
