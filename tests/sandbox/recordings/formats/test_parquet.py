"""Parquet columns as numbers: what is no number there is NaN, whatever the kind."""

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from sandbox.recordings.formats.parquet import read_parquet

KINDS = (
    pa.timestamp("us"),
    pa.duration("us"),
    pa.time64("us"),
    pa.date32(),
    pa.int64(),
    pa.float64(),
    pa.bool_(),
)


@pytest.mark.parametrize("kind", KINDS, ids=str)
def test_a_missing_number_is_nan(tmp_path, kind):
    """NumPy keeps a missing instant as -2^63; read as a number it would be one."""
    values = [False, None, True] if kind == pa.bool_() else [0, None, 1]
    parquet.write_table(pa.table({"x": pa.array(values, kind)}), tmp_path / "n.parquet")
    assert np.array_equal(
        read_parquet(tmp_path / "n.parquet")["x"], [0.0, np.nan, 1.0], equal_nan=True
    )
