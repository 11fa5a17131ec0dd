"""Dry friction with Stribeck's hump, planted on the switched bench, is found with its four
sizes."""

import numpy as np
import pytest

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

FASTEST, SAMPLES = 40.0, 6000  # rad/s, mechanical: eight times the hump's 5 rad/s


def turned(effects):
    """Return a campaign of a free rotor that a turning voltage takes from rest to FASTEST and back,
    without noise."""
    motor, c = DRIVE.motor, DRIVE.converter
    k = np.arange(SAMPLES)
    speed = FASTEST * motor.pole_pairs * np.sin(np.pi * k / SAMPLES) ** 2
    angle = 0.3 + np.cumsum(speed) * c.sampling_period
    u = (motor.resistance * motor.rated_current + 1j * speed * motor.magnet_flux) * np.exp(
        1j * angle
    )
    b, link = quiet(bench(motor, c, effects)), np.full(SAMPLES, c.dc_bus_voltage)
    r = switched(
        b, "free", u.real, u.imag, c.dc_bus_voltage, theta=0.3, load_torque=np.zeros(SAMPLES)
    )
    columns = {
        "t": k * c.sampling_period,
        "u_alpha": u.real,
        "u_beta": u.imag,
        "theta": r["theta"],
        "u_dc": link,
    }
    columns |= {name: r[name] for name in ("i_a", "i_b", "i_c")} | {
        "load_torque": np.zeros(SAMPLES)
    }
    return Campaign(
        "turned", DRIVE, (CampaignRecording("turned.parquet", "free", "d", columns),), {}, {}, False
    )


def fitted(recorded, **begun):
    """Return each size of the effect that a fit has: its value, the coordinate and the fit's own
    deviation."""
    start = complete(
        DRIVE.motor, DRIVE.converter, {f"coulomb_friction.{n}": x for n, x in begun.items()}
    )
    found = fit(
        ParameterPoint(prepare(recorded, start), start), ("coulomb_friction",), weights_of(1)
    )
    free = unbounded(prior_of(found.coordinates))
    deviations = np.sqrt(np.diag(algebra(found.normal).covariance(free)))
    return {
        c.label.removeprefix("coulomb_friction."): (c.value(found.point.values), c, sd)
        for c, sd in zip(found.coordinates, deviations, strict=True)
        if c.label.startswith("coulomb_friction.")
    }


@pytest.mark.parametrize("hump", [0.012, 0.0])
def test_the_hump_is_fitted_with_the_friction_it_sits_on(hump):
    """Without noise every size lies within one of the fit's own deviations of what the bench has
    (measured: a fifth), and a hump of 0.012 N m would stand out by ten of its own."""
    planted = {"torque": 0.03, "width": 1.6, "stribeck_torque": hump}
    planted |= {"stribeck_speed": 5.0} if hump else {}
    recorded = turned({f"coulomb_friction.{n}": x for n, x in planted.items()})
    found = fitted(recorded)
    for name, true in planted.items():
        value, c, deviation = found[name]
        assert abs(value - c.value({c.label: true})) <= deviation
        assert name != "stribeck_torque" or not hump or deviation < 0.1 * hump


def test_bristles_are_fitted_with_the_friction_they_carry():
    """A shaft that breaks away once, without noise, begun at half the bend: every size within two
    of the fit's own deviations; the bend is told to 2 %."""
    planted = {"torque": 0.03, "stribeck_torque": 0.01, "stribeck_speed": 5.0, "presliding": 0.02}
    recorded = turned({f"coulomb_friction.{n}": x for n, x in planted.items()})
    found = fitted(recorded, presliding=0.01)
    assert "width" not in found
    for name, true in planted.items():
        value, c, deviation = found[name]
        print(name, value, c.value({c.label: true}), deviation)
        assert abs(value - c.value({c.label: true})) <= 2.0 * deviation
    assert found["presliding"][2] < 0.02
