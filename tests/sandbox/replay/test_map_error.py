"""How readings answer to a map that is off: against replays of the plant with the energy added,
which step through every pulse; and stretch by stretch against all at once."""

import dataclasses

import numpy as np
import pytest

from model.drive_files import load_drive
from model.mapped import MappedMotor
from model.spline_correction import Basis, MapError, refined
from sandbox.gap.evidence.normal import ParameterPoint, normal
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign
from sandbox.replay.map_error import Answers, rotor_currents, with_map_error
from sandbox.replay.replay import prepare, replay
from sandbox.replay.stretches import Stretch
from tests.sandbox.replay.benches import record
from tests.sandbox.switched.one_cell import one_cell

IPM = load_drive("ipm")
NUMBERS = {
    n: getattr(IPM.motor, n)
    for n in type(IPM.motor).__dataclass_fields__
    if not n.startswith("alpha_")
}
MAPPED = dataclasses.replace(
    IPM,
    motor=MappedMotor(
        **NUMBERS, map_hash="of the quartic", spline=one_cell(IPM.motor.energy, -0.4, 0.4)
    ),
)
SIZE = 1e-3  # J of an energy
# The plant answers within a period and holds each pulse; the columns go from sample to sample, a
# drop from the mean of both ends: of what a period's share of L/R (0.25 ms of 8.5 ms) moves, a few
# per cent.
FEW = 0.05


@pytest.fixture(
    scope="module", params=[("locked", 0.0), ("driven", 20.0), ("driven", 100.0)], ids=str
)
def prepared(request):
    recorded = (record({}, *request.param),)
    p = prepare(Campaign("own", MAPPED, recorded, {}, {}, False), steps=1)
    basis = Basis(refined(MAPPED.motor.spline, 8, 8))
    (found,) = replay(p, [{}]).currents
    path = rotor_currents(found[:, :, 0], p.recordings[0].motion.angle)
    psi = np.column_stack(
        [path[:, 0] * NUMBERS["inductance_d"], path[:, 1] * NUMBERS["inductance_q"]]
    )
    there = basis.there(psi)  # of these the four that move the current most
    chosen = there[np.argsort(np.sum(basis.gradients(psi, there) ** 2, axis=(0, 2)))[-4:]]
    sizes = SIZE * np.eye(basis.size)[chosen]
    return with_map_error(p, MapError(basis.of, basis.cells(sizes), np.zeros(4)))


def test_columns_are_what_replays_of_a_moved_map_differ_by(prepared):
    point = ParameterPoint(prepared, complete(MAPPED.motor, MAPPED.converter))
    n = normal(point, ())
    own = [k for k, c in enumerate(n.coordinates) if c.form == "map"]
    assert [n.coordinates[k].label for k in own] == ["map:1", "map:2", "map:3", "map:4"]
    (segment,), (rows,) = zip(
        *((s, r) for s, r in zip(n.segments, n.rows, strict=True) if s.channel == "current"),
        strict=True,
    )
    (base,) = replay(prepared, [{}]).currents
    for k in own:
        moved = point.moved(n.coordinates, np.where(np.arange(len(n.x)) == k, 1.0, 0.0))
        (there,) = replay(moved.prepared, [{}]).currents
        exact = ((there - base) / prepared.noise_std)[:, :, 0].ravel()
        found = np.asarray(rows)[:, segment.places.tolist().index(k)]
        assert np.sqrt(np.mean((found - exact) ** 2)) < FEW * np.sqrt(np.mean(exact**2)), k
        assert np.sqrt(np.mean(exact**2)) * prepared.noise_std > 1e-4  # A: a move, not rounding


@pytest.mark.parametrize("settling", [0, 100])
def test_columns_where_current_flows_at_the_start(prepared, settling):
    """A part from mid-recording starts from the current read there, or so many samples before,
    whatever the map is."""
    (whole,) = replay(prepared, [{}]).currents
    r = dataclasses.replace(prepared.recordings[0], read=np.ascontiguousarray(whole[:, :, 0]))
    own = r.cut(300, 500)
    if settling:
        own = dataclasses.replace(own, settling=r.cut(300 - settling, 300))
    part = dataclasses.replace(prepared, recordings=(own,))
    point = ParameterPoint(part, complete(MAPPED.motor, MAPPED.converter))
    n = normal(point, ())
    (base,) = replay(part, [{}]).currents
    k = len(n.x) - 1
    moved = point.moved(n.coordinates, np.where(np.arange(len(n.x)) == k, 1.0, 0.0))
    (there,) = replay(moved.prepared, [{}]).currents
    exact = ((there - base) / part.noise_std)[:, :, 0].ravel()
    found = np.asarray(n.rows[0])[:, n.segments[0].places.tolist().index(k)]
    assert np.sqrt(np.mean((found - exact) ** 2)) < FEW * np.sqrt(np.mean(exact**2))
    if not settling:  # the current read there, with either map
        assert abs(exact[:3]).max() < 1e-3 * abs(exact).max()


def test_a_moved_map_is_the_points_own(prepared):
    point = ParameterPoint(prepared, complete(MAPPED.motor, MAPPED.converter))
    n = normal(point, ())
    x = np.where([c.form == "map" for c in n.coordinates], 0.3, n.x)
    there = point.moved(n.coordinates, x)
    assert there.prepared.map_error.x == pytest.approx(0.3)
    np.testing.assert_array_equal(n.at(there).x, x)
    assert not np.array_equal(
        there.prepared.campaign.drive.motor.spline.cells, MAPPED.motor.spline.cells
    )
    back = there.moved(n.coordinates, n.x)
    (a,), (b,) = replay(back.prepared, [{}]).currents, replay(point.prepared, [{}]).currents
    np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-12 * MAPPED.motor.rated_current)


def test_a_stretch_goes_on_from_the_one_before(prepared):
    n, values, parts = prepared.samples, complete(MAPPED.motor, MAPPED.converter), []
    answers, whole = Answers(prepared, values), Answers(prepared, values).over(Stretch(0, 0, n, n))
    for first, last in ((0, 200), (200, 201), (201, n)):
        parts.append(answers.over(Stretch(0, first, last, n)))
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    assert not answers.states  # nothing is kept of a recording that is through


# what an encoder may read beside the angle: of 20 degrees electrical, and older by three periods
MISREAD = {
    "encoder_offset.offset": 0.35,
    "encoder_offset.latency": 7.5e-4,
    "encoder_eccentricity.amplitude_mech": 0.35 / NUMBERS["pole_pairs"],
    "encoder_eccentricity.phase": 0.4,
}


def test_columns_stand_at_the_rotors_angle_whatever_the_encoder_reads(prepared):
    """With the energy added as above, at a set whose encoder errs: at the angle as it is read they
    would be off by a sixth to two fifths."""
    point = ParameterPoint(prepared, complete(MAPPED.motor, MAPPED.converter, MISREAD))
    n = normal(point, ())
    (base,) = replay(prepared, [MISREAD]).currents
    k = len(n.x) - 1
    moved = point.moved(n.coordinates, np.where(np.arange(len(n.x)) == k, 1.0, 0.0))
    (there,) = replay(moved.prepared, [MISREAD]).currents
    exact = ((there - base) / prepared.noise_std)[:, :, 0].ravel()
    found = np.asarray(n.rows[0])[:, n.segments[0].places.tolist().index(k)]
    assert np.sqrt(np.mean((found - exact) ** 2)) < FEW * np.sqrt(np.mean(exact**2))
