"""What a reading of a log leaves: one by one, at many zeros, of many paces, and as it is written
out."""

import dataclasses
import math

import numpy as np
import pytest

from sandbox.recordings.campaign import read_folder
from sandbox.recordings.checks.changes import ANGLE, Change, changes, source_of
from sandbox.recordings.checks.readings import ZEROS, Products, terms_of
from sandbox.recordings.checks.search import readings_of, together
from tests.data import recordings_folder

# sums of some 1e4 products, of which no more than 1e3 times what is left cancel: 1e-16 x 1e7
ROUNDING = 1e-9


@pytest.fixture(scope="module", params=["stationary", "rotor"])
def part(request):
    """The products of one recording, as it is or with its vectors in the rotor's frame."""
    campaign = read_folder(recordings_folder() / "practice" / "p06")
    r = campaign["run_fast"]
    names = ("u_d", "u_q", "i_d", "i_q") if request.param == "rotor" else ()
    # what a log in the rotor's frame is known by: its columns' names
    r = dataclasses.replace(
        r, source={n: n for n in ("t", "theta", "u_dc", *names)} if names else r.source
    )
    return Products(r, campaign.drive, 0.5, 1e-3)


def written_out(part, change, zero):
    """The balance of the module's docstring, term by term."""
    read = terms_of(change, part.drive.motor)
    own = part.factors(read, zero)
    products = part.products(read)[:5, :5]
    left = np.conj(own) @ products @ own
    return left.real / (read.scale**2 * products[0, 0].real)


def test_shares_are_those_of_the_balance_written_out(part):
    table = changes(part.drive, source_of(part.recording))
    pairs = [(a, b) for a in table[:12] for b in table[12:24] if together(a, b)]
    assert len(pairs) > 20
    for change in ((), *((c,) for c in table), *pairs):
        shares = part.shares(change, ZEROS[::90])
        for zero, share in zip(ZEROS[::90], shares, strict=True):
            assert share == pytest.approx(written_out(part, change, zero), rel=ROUNDING)
        for x in readings_of([part], [change], float(ZEROS[90])):
            assert x.shares[0] == pytest.approx(shares[1], rel=ROUNDING)


def test_the_least_of_many_paces_is_that_of_each(part):
    turns = np.array([-3.0, -1.0, 0.0, 0.4, 1.0, 1.01, 7.5])
    one_by_one = [
        part.shares((Change(ANGLE, "theta", "", "", turn=float(x)),), ZEROS).min() for x in turns
    ]
    assert part.least(turns) == pytest.approx(one_by_one, rel=ROUNDING)


def test_a_zero_is_a_turn_of_the_angle(part):
    """A whole turn is none; half a turn neither, where all vectors were made with the angle: all of
    them are turned round."""
    none, half, whole = part.shares((), np.array([0.0, math.pi, math.tau]))
    assert whole == pytest.approx(none, rel=ROUNDING)
    assert (half == pytest.approx(none, rel=ROUNDING)) == part.turns_u
