"""MCAP logs (ROS 2, Foxglove) with JSON messages: numbers of each topic as 'topic.field'; needs
mcap (extra `mcap`)."""

from __future__ import annotations

import json
from array import array
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from model.errors import BadInput, unknown
from model.number_table import Table
from sandbox.recordings.formats.log_table import MOST_VALUES, missing, on_one_raster, too_many

DEEPEST = 5  # objects in objects


def read_mcap(path: Path, wanted: Sequence[str]) -> Table:
    """Return the wanted fields on the raster of the densest topic among them, stamps of publishing
    as 't' (s).

    A field is 'topic.field' (nested: 'topic.a.b', elements of a list 'topic.a.0'; a topic's leading
    '/' is left out). Messages in ROS' or protobuf's own encoding are refused: export them as JSON.
    """
    try:
        from mcap.reader import make_reader
    except ImportError:
        raise missing(path.name, "mcap", "mcap", "MCAP") from None
    signals: dict[str, tuple[array[float], array[float]]] = defaultdict(
        lambda: (array("d"), array("d"))
    )
    asked, other, count = set(wanted), "", 0
    try:
        with path.open("rb") as file:
            for _, channel, message in make_reader(file).iter_messages():
                if channel.message_encoding != "json":
                    other = f"'{channel.topic[:40]}' in '{channel.message_encoding[:20]}'"
                    continue
                for name, value in _numbers(
                    channel.topic.lstrip("/"), json.loads(message.data), DEEPEST
                ):
                    if asked and name not in asked:
                        continue
                    signals[name][0].append(1e-9 * message.publish_time)
                    signals[name][1].append(value)
                    count += 1
                if count > MOST_VALUES // 2:  # each with a stamp of its own
                    raise too_many(path.name)
    except BadInput:
        raise
    except Exception as error:  # whatever a damaged file leads the reader to
        raise BadInput(
            f"{path.name}: cannot be read as MCAP ({error!s:.80}); record it again"
        ) from None
    if not signals:
        if other:
            raise BadInput(
                f"{path.name}: topic {other} is not read; convert the log to JSON "
                "messages, or to CSV"
            )
        raise BadInput(
            f"{path.name}: {unknown('fields', ', '.join(wanted), [])}; a field is "
            "written topic.field"
        )
    start = min(s[0][0] for s in signals.values())
    columns, notes = on_one_raster(
        path.name,
        {n: (np.array(t) - start, np.array(v, dtype=np.float64)) for n, (t, v) in signals.items()},
    )
    return Table(columns, {}, {}, tuple(notes))


def _numbers(name: str, value: Any, deepest: int) -> Iterator[tuple[str, float]]:
    """Yield the numbers in a message, named by their way to it."""
    if isinstance(value, (bool, int, float)):
        yield name, float(value)
    elif deepest and isinstance(value, dict):
        for key, inner in value.items():
            yield from _numbers(f"{name}.{key}", inner, deepest - 1)
    elif deepest and isinstance(value, list):
        for k, inner in enumerate(value):
            yield from _numbers(f"{name}.{k}", inner, deepest - 1)
