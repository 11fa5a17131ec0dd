"""Seeded damage to files: bytes, TOML text, JSON trees, words of a command line.  The same seed,
the same damage."""

from __future__ import annotations

import copy
import hashlib
import json
import random
import re
from typing import Any

VALUES = (  # as TOML and JSON write them, more or less
    "0",
    "-1",
    "1",
    "1e308",
    "-1e308",
    "1e-320",
    "nan",
    "inf",
    "-inf",
    "true",
    "false",
    '""',
    '"x"',
    "[]",
    "{}",
    "[[]]",
    "9" * 30,
    "9" * 400,
    "-" + "9" * 400,
    "0x" + "f" * 5000,
    "9" * 5000,
    "1_0",
    '"' + "x" * 300 + '"',
    '"../../x"',
    '"/etc/passwd"',
    '"a\\u0000b"',
    '"\\u001b[2J"',
    '"a\\nb"',
    '"\\u202e"',
    "1979-05-27",
    '["d", 1]',
    "[" * 300 + "]" * 300,
    "null",
    '"nan"',
    "0.0",
    "-0.0",
    "2e-8",
    "1e5",
    "1e-5",
    '"<script>"',
    '"\'"',
    '"é"',
    "1e9",
    "[1e999]",
    "'''a\n\nb'''",
)
TREE: tuple[Any, ...] = (
    None,
    True,
    0,
    -1,
    1,
    0.5,
    1e308,
    float("nan"),
    float("inf"),
    10**400,
    "",
    "x",
    "x" * 500,
    "\x1b[2J",
    "a\nb",
    "\0",
    [],
    {},
    [[]],
    [None],
    {"a": 1},
    [1, 2],
    [0.1, 0.2],
    ["dead_time"],
    ["unknown"],
    "dead_time",
    "ambiguous",
    -1e-300,
)


def damaged_bytes(content: bytes, chance: random.Random) -> bytes:
    """Return bytes with one to four injuries: bits turned, pieces cut, doubled, overwritten."""
    for _ in range(chance.choice((1, 1, 2, 4))):
        n = len(content)
        a, b = sorted((chance.randrange(n + 1), chance.randrange(n + 1)))
        b = min(b, a + chance.choice((1, 2, 8, 64, 10_000)))
        piece = chance.choice(
            (
                b"",
                bytes([chance.randrange(256)]),
                chance.randbytes(4),
                b"\xff" * 4,
                b"\0" * 4,
                b"\xff\xff\xff\x7f",
                content[a:b] * 2,
                b"\n",
                b",",
                b"nan",
                b"1e999",
            )
        )
        kind = chance.randrange(5)
        if kind == 0 and n:
            content = (
                content[:a]
                + bytes([content[a % n] ^ (1 << chance.randrange(8))])
                + content[a + 1 :]
            )
        elif kind == 1:
            content = content[:a]
        elif kind == 2:
            content = content[:a] + piece + content[a + len(piece) :]
        elif kind == 3:
            content = content[:a] + content[b:]
        else:
            content = content[:a] + piece + content[a:]
    return content


def damaged_toml(text: str, chance: random.Random) -> bytes:
    """Return a TOML text with one to three changes of values, keys, lines or tables; sometimes of
    bytes."""
    if chance.random() < 0.15:
        return damaged_bytes(text.encode(), chance)
    lines = text.splitlines()
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        k = chance.randrange(len(lines))
        kind = chance.randrange(7)
        if kind <= 3 and "=" in lines[k]:
            key = lines[k].partition("=")[0]
            nested = re.findall(r"(\w+) = ", lines[k].partition("=")[2])
            if nested and chance.random() < 0.7:
                inner = chance.choice(nested)
                value = chance.choice(VALUES)
                pattern = rf"\b{inner} = [^,}}]*"
                lines[k] = (
                    f"{key}={re.sub(pattern, lambda _, i=inner, v=value: f'{i} = {v}', lines[k].partition('=')[2])}"  # noqa: E501
                )
            else:
                lines[k] = f"{key}= {chance.choice(VALUES)}"
        elif kind == 4:
            del lines[k]
        elif kind == 5:
            lines.insert(chance.randrange(len(lines) + 1), lines[k])
        else:
            new = chance.choice(
                (
                    "x = 1",
                    "[x]",
                    "[[recording]]",
                    "[motor]",
                    "name = 5",
                    '"\\u001b" = 1',
                    "a.b.c = 1",
                    "=",
                )
            )
            lines.insert(k, new)
        lines = lines or [""]
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def damaged_json(text: str, chance: random.Random) -> bytes:
    """Return a JSON text with one to three nodes replaced, removed or doubled; sometimes with bytes
    damaged."""
    if chance.random() < 0.15:
        return damaged_bytes(text.encode(), chance)
    tree = json.loads(text)
    for _ in range(chance.choice((1, 1, 2, 3))):
        _damage(tree, chance)
    return json.dumps(tree).encode()


def damaged_lines(text: str, chance: random.Random) -> bytes:
    """Return a journal with the content of one of its lines damaged, half of the time as if it had
    been written so."""
    lines = [line for line in text.splitlines() if line]
    k = chance.randrange(len(lines))
    stated, _, body = lines[k].partition(" ")
    new = damaged_json(body, chance)
    if chance.random() < 0.5:
        stated = hashlib.sha256(new).hexdigest()
    whole = [line.encode() for line in lines]
    whole[k] = stated.encode() + b" " + new
    return b"\n".join(whole)


def _damage(tree: Any, chance: random.Random) -> None:
    node = tree
    while True:
        keys = list(node) if isinstance(node, dict) else list(range(len(node)))
        if not keys:
            return
        key = chance.choice(keys)
        if isinstance(node[key], (dict, list)) and node[key] and chance.random() < 0.8:
            node = node[key]
            continue
        kind = chance.randrange(4)
        if kind <= 1:
            node[key] = copy.deepcopy(chance.choice(TREE))
        elif kind == 2:
            del node[key]
        elif isinstance(node, dict):
            node[chance.choice(("", "x", "effects", "failed", "\x1b"))] = node.pop(key)
        else:
            node.insert(0, copy.deepcopy(chance.choice(TREE)))
        return


WORDS = (
    "",
    "-",
    "--",
    "x",
    "\x1b[2J",
    "a\nb",
    "\0",
    "..",
    "/",
    "../../x",
    "x" * 3000,
    "nan",
    "-1",
    "0",
    "1e308",
    "9" * 5000,
    "\u0663",
    "é",
    "\udc80",
    ",",
    ",,",
    "a=b",
    "dead_time.time=",
    "dead_time.time=nan",
    "dead_time.time=1e400",
    "=.=",
    "dead_time.time=2e-6,dead_time.time=3e-6",
    "ipm",
    "spm",
    "ipm_exchange",
    "qnull,",
    "qnull,qnull",
    "--help=1",
    "--out",
    "--jobs",
    "--seed",
    "--quiet",
    "--motor",
    "--scenario",
    "--effects",
    "--record",
    "[bold]",
    "'",
    '"',
    "%s",
    "{0}",
    "~",
    "nowhere.toml",
    "nowhere.npz",
    "nowhere.rrd",
    "m.toml",
    "m.npz",
    "m.csv",
    "s.toml",
    "campaign",
    "check",
    "1_0",
    "1e-3",
)
CALLS = (
    (
        "compare",
        "--motor",
        "m.toml",
        "--scenario",
        "s.toml",
        "--estimators",
        "qnull,ekf",
        "--effects",
        "dead_time.time=2e-6",
    ),
    (
        "simulate",
        "--motor",
        "ipm",
        "--scenario",
        "staircase",
        "--estimator",
        "qnull",
        "--belief",
        "linear",
        "--duration",
        "0.1",
        "--plant",
        "averaged",
        "--record",
        "new",
        "--effects",
        "dead_time.time=2e-6",
    ),
    ("audit", "m.toml", "--radius", "2.0"),
    ("maps", "ipm_exchanged", "--radius", "1.0"),
    ("identify", "campaign", "--columns", "columns.toml"),
    ("replay", "campaign", "--motor", "m.toml", "--effects", "e.toml"),
    ("check", "campaign", "--mistakes-only"),
    (
        "plan",
        "--motor",
        "m.toml",
        "--current",
        "1.0",
        "--speed",
        "500",
        "--voltage",
        "300",
        "--can",
        "locked",
    ),
    ("diagnose", "campaign", "--continue", "check/diagnoses/w000.json", "--preset", "odrive"),
    (
        "diagnose",
        "campaign",
        "--nominal",
        "linear",
        "--exclude",
        "dead_time",
        "--columns",
        "columns.toml",
    ),
    (
        "withheld",
        "make",
        "check",
        "--count",
        "3",
        "--seed",
        "1",
        "--kind",
        "mixed",
        "--cycles",
        "scored",
        "--jobs",
        "1",
    ),
    ("withheld", "score", "check", "--limit", "1", "--leave-out", "0.5", "--finished"),
    (
        "protocol",
        "--motors",
        "ipm,m.toml",
        "--estimators",
        "qnull",
        "--tests",
        "start,cost",
        "--jobs",
        "1",
    ),
    ("bench", "--peer", "--anchors", "anchors", "--peer-python", "nowhere"),
    ("list", "effects", "dead_time"),
    ("list", "motors"),
    ("list", "datasets"),
    ("view", "nowhere.rrd"),
    ("show", "result"),
    ("sweep", "sweep.toml", "--jobs", "1", "--again", "--yes"),
    ("verify", "result", "--tolerance", "1e-6"),
    ("export-estimator", "ekf", "--motor", "m.toml", "--belief", "linear"),
)


def damaged_call(chance: random.Random) -> list[str]:
    """Return a call of the command line with one to three words replaced, removed or added."""
    words = [
        *chance.choice(CALLS),
        *chance.choice(((), (), ("--out", "out"), ("--seed", "3"), ("--offline",))),
    ]
    for _ in range(chance.choice((1, 1, 2, 3))):
        k, kind = chance.randrange(len(words)), chance.randrange(5)
        if kind <= 2:
            words[k] = chance.choice(WORDS)
        elif kind == 3 and len(words) > 1:
            del words[k]
        else:
            words.insert(k, chance.choice(WORDS))
    return words
