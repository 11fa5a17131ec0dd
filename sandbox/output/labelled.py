"""A table as an xarray Dataset: labelled dimensions, every variable with its unit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from model.errors import BadInput
from sandbox.output.columns import unit_of

if TYPE_CHECKING:
    import pyarrow
    import xarray


def dataset_of(
    table: pyarrow.Table, coordinates: Sequence[str], attributes: Mapping[str, str]
) -> xarray.Dataset:
    """Return a table as a Dataset; BadInput where xarray is missing.

    coordinates: columns that become dimensions.  One is the rows' own; several span a grid, whose
    rows run as those of `numpy.meshgrid(..., indexing="ij")`.  None: the dimension is `row`.
    """
    try:
        import xarray
    except ImportError:
        raise BadInput(
            "a Dataset needs xarray; install it with `pip install xarray`, or take .to_table()"
        ) from None
    columns = {name: table[name].to_numpy(zero_copy_only=False) for name in table.column_names}
    axes = {
        name: np.unique(columns[name]) if len(coordinates) > 1 else columns[name]
        for name in coordinates
    }
    shape = tuple(map(len, axes.values())) or (table.num_rows,)
    units = {f.name: {"units": unit} if (unit := unit_of(f)) else {} for f in table.schema}
    dimensions = tuple(axes) or ("row",)
    return xarray.Dataset(
        {n: (dimensions, x.reshape(shape), units[n]) for n, x in columns.items() if n not in axes},
        {n: (n, x, units[n]) for n, x in axes.items()},
        dict(attributes),
    )
