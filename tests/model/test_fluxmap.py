"""What a flux map is refused for."""

import numpy as np
import pytest

from model.errors import BadInput
from model.fluxmap import check_size


def test_how_many_numbers_of_a_map_are_missing_is_told():
    values = np.array([1.0 + 1.0j, np.nan, 2.0, np.nan, 1.0j])
    with pytest.raises(BadInput, match=r"mine.csv: 2 of 5 currents are not finite"):
        check_size("mine.csv", "currents", values, (1e-3, 1e5), "A")
