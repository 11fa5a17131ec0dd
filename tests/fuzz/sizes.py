"""Well-formed files that are large: what a file claims to hold must be bounded before it is read.

Sizes are drawn evenly by their logarithm, so that every decade up to the largest is met.
"""

from __future__ import annotations

import io
import json
import zipfile

import numpy as np


def size(chance, largest):
    """Return a number from 10 to 10^largest."""
    return round(10.0 ** chance.uniform(1.0, largest))


def odd_toml(chance):
    """Return lines of TOML that are long, deep or many."""
    n = size(chance, 5.5)
    return chance.choice(
        (
            lambda: "x = " + "[" * n + "]" * n,
            lambda: "x = " + "{a = " * n + "1" + "}" * n,
            lambda: "x = [" + "1.0," * n + "]",
            lambda: 'x = "' + "a" * n + '"',
            lambda: "x = " + "9" * n,
            lambda: "x = 0." + "1" * n,
            lambda: ".".join("a" * n) + " = 1",
            lambda: "".join(f"x{k} = 1.0\n" for k in range(n)),
            lambda: "a" * n + " = 1",
            lambda: "[" + ".".join("b" * n) + "]",
            lambda: "# a comment\n" * n,
        )
    )()


def grown_toml(content, chance):
    """Return a TOML text with something large in it: above, below, in place of a value, or one of
    its tables often."""
    text = content.decode()
    lines = text.split("\n")
    where = chance.random()
    if where < 0.3:
        return f"{odd_toml(chance)}\n{text}".encode()
    if where < 0.6:
        return f"{text}\n{odd_toml(chance)}\n".encode()
    if where < 0.8:
        heads = [k for k, line in enumerate(lines) if line.startswith("[[")] or [0]
        first = chance.choice(heads)
        last = next(
            (k for k in range(first + 1, len(lines)) if lines[k].startswith("[")), len(lines)
        )
        return "\n".join(
            [*lines[:first], *lines[first:last] * min(size(chance, 4.0), 4000), *lines[last:]]
        ).encode()
    k = chance.choice([k for k, line in enumerate(lines) if " = " in line])
    value = odd_toml(chance).split("\n", 1)[0].partition(" = ")[2] or "1"
    lines[k] = lines[k].partition(" = ")[0] + " = " + value
    return "\n".join(lines).encode()


def grown_json(content, chance):
    """Return a JSON document one of whose values is long or deep."""
    n = size(chance, 6.0)
    new = chance.choice(
        (
            lambda: "[" * n + "]" * n,
            lambda: '{"a":' * n + "1" + "}" * n,
            lambda: json.dumps([0.0] * n),
            lambda: json.dumps("a" * n),
            lambda: "9" * n,
            lambda: "0." + "1" * n,
            lambda: json.dumps({str(k): 1.0 for k in range(n)}),
        )
    )()
    whole = json.loads(content)
    place = whole
    while True:
        key = chance.choice(list(place) if isinstance(place, dict) else range(len(place)))
        if isinstance(place[key], (dict, list)) and place[key] and chance.random() < 0.7:
            place = place[key]
            continue
        place[key] = "HERE"
        return json.dumps(whole).replace('"HERE"', new, 1).encode()


def claimed_npz(content, chance):
    """Return an .npz whose arrays are zeros of drawn shapes; a few bytes each, once packed."""
    with np.load(io.BytesIO(content)) as whole:
        names = list(whole)
    rows, columns = size(chance, 6.5), chance.choice((1, 1, 8, size(chance, 4.0)))
    body = io.BytesIO()
    with zipfile.ZipFile(body, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name in names if rows * columns < 1e7 else names[:1]:
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                shape = (rows, columns) if columns > 1 else (rows,)
                np.lib.format.write_array_header_1_0(
                    file, {"descr": "<f8", "fortran_order": False, "shape": shape}
                )
                # the rest is missing
                left = min(8 * rows * columns, round(10.0 ** chance.uniform(6.0, 8.7)))
                while left > 0:
                    left -= file.write(bytes(min(left, 1_000_000)))
    return body.getvalue()


def long_mat(_, chance):
    """Return a MATLAB file of long columns or a wide matrix."""
    from scipy.io import savemat

    rows = size(chance, 6.0)
    names = ("Time", "Ua", "Ub", "Ia", "Ib", "Ic", "Pos", "Link", "i_d", "i_q", "psi_d", "psi_q")
    arrays = {n: np.zeros(rows) for n in names}
    if chance.random() < 0.4:
        arrays = {"log": np.zeros((10, rows))}
    body = io.BytesIO()
    savemat(body, arrays, do_compression=True)
    return body.getvalue()


def long_parquet(content, chance):
    """Return a Parquet table of as many columns, or a great many, and rows of zeros."""
    import pyarrow
    from pyarrow import parquet

    names = parquet.read_schema(io.BytesIO(content)).names
    if chance.random() < 0.3:
        names = [f"c{k}" for k in range(size(chance, 4.0))]
    rows = min(size(chance, 7.0), round(3e8 / len(names)))
    zeros = pyarrow.array(np.zeros(rows))
    body = io.BytesIO()
    parquet.write_table(pyarrow.table(dict.fromkeys(names, zeros)), body)
    return body.getvalue()


def long_csv(content, chance):
    """Return a text table of many rows, wide rows, long cells or one long line."""
    n, lines = size(chance, 5.5), content.split(b"\n")
    row = lines[1] if len(lines) > 1 else b"0"
    return chance.choice(
        (
            lambda: b"\n".join([lines[0], *[row] * n]),
            lambda: b"\n".join(
                [lines[0], *(b"%d%s" % (k, row[row.find(b",") :]) for k in range(n))]
            ),
            lambda: b",".join(b"c%d" % k for k in range(n)) + b"\n" + b",".join([b"0"] * n) + b"\n",
            lambda: content + b"," * n,
            lambda: content + b"\n" * n,
            lambda: content + b"9" * n,
            lambda: lines[0] + b"a" * n + b"\n" + b"\n".join(lines[1:]),
            lambda: b"# above\n" * n + content,
            lambda: b'"' + b"a" * n + content,
        )
    )()
