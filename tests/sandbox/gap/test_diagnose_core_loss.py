"""Core loss in its three parts, planted on the switched bench, is found with all sizes from a fit
that begins without any."""

import numpy as np
import pytest

from model.effects.iron_loss import USUAL
from sandbox.gap.evidence.algebra import algebra, prior_of
from sandbox.gap.evidence.fit import fit
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.posterior.estimates import unbounded
from sandbox.gap.posterior.holdout import weights_of
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.replay.replay import prepare
from sandbox.switched.advance import replay as switched
from sandbox.switched.bench_numbers import bench, quiet
from tests.sandbox.replay.benches import DRIVE

SAMPLES, HOLD = 2000, 20  # periods; of the square wave on d
EDDY = {"core_resistance": 2000.0, "time_constant": 1.5e-4}
OWN = USUAL * DRIVE.motor.rated_current
PLANTED = {
    "eddy currents alone": EDDY,
    "all three": EDDY
    | {"excess_current": OWN, "hysteresis_current": OWN, "hysteresis_reach": 0.15},
}


def driven(effects):
    """Return a campaign of a rotor driven from standstill up to rated speed, a square wave of the
    current on d, without noise."""
    motor, c = DRIVE.motor, DRIVE.converter
    k = np.arange(SAMPLES)
    speed = motor.rated_omega * k / SAMPLES
    angle = 0.3 + np.cumsum(speed) * c.sampling_period
    wave = motor.resistance * motor.rated_current * np.where(k // HOLD % 2, 0.8, -0.8)
    u = (wave + 1j * speed * motor.magnet_flux) * np.exp(1j * angle)
    b, link = quiet(bench(motor, c, effects)), np.full(SAMPLES, c.dc_bus_voltage)
    r = switched(
        b, "driven", u.real, u.imag, c.dc_bus_voltage, theta=angle, speed=speed / motor.pole_pairs
    )
    columns = {"t": k * c.sampling_period, "u_alpha": u.real, "u_beta": u.imag}
    columns |= {"theta": r["theta"], "u_dc": link}
    columns |= {name: r[name] for name in ("i_a", "i_b", "i_c")}
    return Campaign(
        "driven",
        DRIVE,
        (CampaignRecording("driven.parquet", "driven", "d", columns),),
        {},
        {},
        False,
    )


@pytest.mark.parametrize("name", PLANTED)
def test_every_part_is_fitted(name):
    """Without noise every size lies within one of the fit's own deviations of what the bench has,
    and a part that is there stands out by ten of its own."""
    planted = PLANTED[name]
    recorded = driven({f"iron_loss.{n}": x for n, x in planted.items()})
    begun = ParameterPoint(prepare(recorded), complete(DRIVE.motor, DRIVE.converter))
    found = fit(begun, ("iron_loss",), weights_of(1))
    free = unbounded(prior_of(found.coordinates))
    deviations = np.sqrt(np.diag(algebra(found.normal).covariance(free)))
    true = {"excess_current": 0.0, "hysteresis_current": 0.0} | planted
    for k, c in enumerate(found.coordinates):
        effect, _, own = c.label.partition(".")
        if effect == "iron_loss" and own in true:
            here, there = c.value(found.point.values), c.value({c.label: true[own]})
            print(f"{own}: {here:.5g}, planted {there:.5g}, deviation {deviations[k]:.2g}")
            assert abs(here - there) <= deviations[k]
            assert not true[own] or "log" in c.form or deviations[k] < 0.1 * there
