"""An encoder that is off and answers late, on the switched bench."""

from sandbox.gap.diagnose import diagnosis_of
from tests.sandbox.gap.conftest import CASES, TURNING, small_campaign


def test_a_late_encoder_is_no_pair_of_delays():
    """30 mrad, and an angle older than its row by 30 us: 20 mrad at the highest speed.  Voltages
    and currents that are both late by the same read alike, and were named both (another bench: each
    1.0, within 6 % of one another)."""
    put_in = {"encoder_offset.offset": 0.03, "encoder_offset.latency": 3e-5}
    d = diagnosis_of(small_campaign(put_in, CASES + TURNING), workers=1)
    assert d.best.effects == ("encoder_offset",)
    assert d.best.probability > 0.9
    for name, true in put_in.items():
        x = d.parameters[0][name]
        # three standard deviations, 1.53 halves of 95 %
        assert abs(x.value - true) < 1.53 * 0.5 * (x.high - x.low), name


def test_an_encoder_that_errs_twice_a_turn_alone_is_found():
    """A resolver's error: no part of it is of the first order, which the effect's first part is."""
    put_in = {
        "encoder_eccentricity.2.amplitude_mech": 0.004,
        "encoder_eccentricity.2.order_mech": 2.0,
        "encoder_eccentricity.2.phase": 0.5,
    }
    d = diagnosis_of(small_campaign(put_in, TURNING), workers=1)
    assert d.best.effects == ("encoder_eccentricity",)
    assert d.best.probability > 0.9
    x = d.parameters[0]["encoder_eccentricity.2.amplitude_mech"]
    assert abs(x.value - 0.004) < 1.53 * 0.5 * (x.high - x.low)
