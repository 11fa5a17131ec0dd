"""A table's columns as variables over its coordinates."""

import numpy as np

from sandbox.output.columns import Column, table_of
from sandbox.output.labelled import dataset_of


def test_one_coordinate_stays_in_its_rows_order():
    """As measured: neither sorted nor without the value that stands there twice."""
    x, y = np.array([3.0, 1.0, 3.0]), np.array([10.0, 20.0, 30.0])
    found = dataset_of(table_of({"x": Column(x, "A"), "y": Column(y, "V")}), ["x"], {"of": "me"})
    assert found["x"].values.tolist() == [3.0, 1.0, 3.0]
    assert found["y"].values.tolist() == [10.0, 20.0, 30.0]
    assert (found["x"].attrs["units"], found["y"].attrs["units"]) == ("A", "V")
    assert found.attrs == {"of": "me"}


def test_several_span_a_grid_and_none_the_rows():
    a, b = np.meshgrid([1.0, 2.0], [5.0, 6.0, 7.0], indexing="ij")
    table = table_of({n: Column(x.ravel(), "") for n, x in (("a", a), ("b", b), ("s", a + b))})
    grid = dataset_of(table, ["a", "b"], {})
    assert dict(grid.sizes) == {"a": 2, "b": 3}
    assert float(grid["s"].sel(a=2.0, b=7.0)) == 9.0
    assert dict(dataset_of(table, [], {}).sizes) == {"row": 6}
