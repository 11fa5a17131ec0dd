"""The simple methods answer in the diagnosis' contract, and find what is plain to see."""

import math

import numpy as np
import pytest

from sandbox.campaign import read_campaign, write_campaign
from sandbox.gap.withheld import refit as fit
from sandbox.gap.withheld.baselines import BASELINES
from sandbox.gap.withheld.draw import Case, draw
from sandbox.gap.withheld.judge import judge
from sandbox.gap.withheld.make import campaign_of
from sandbox.gap.withheld.voltage import binned, left_over

SHORT = 0.3


def recorded(folder, *names, sizes=(2.0,), family="ipm_exchanged"):
    """Write a short campaign with effects; return its folder and truth."""
    drawn = draw(Case(0, "one" if names else "none", family, "scored", names, sizes if names else ()), 31)
    return write_campaign(folder / "w000", campaign_of(drawn, SHORT)), drawn.as_json()


CASES = [("refit", "stator_resistance"), ("bic", "encoder_eccentricity"), ("bic", "stator_resistance")]
CASES += [("voltage", "stator_resistance")]


@pytest.mark.parametrize(("method", "effect"), CASES)
def test_a_large_effect_is_found(method, effect, tmp_path):
    folder, truth = recorded(tmp_path, effect)
    found = BASELINES[method](folder, ()).json
    assert sum(h["probability"] for h in found["hypotheses"]) == pytest.approx(1.0)
    j = judge("w000", truth, found)
    print(method, effect, [(h["effects"], round(h["probability"], 3)) for h in found["hypotheses"][:3]], found["gap"])
    assert effect in found["hypotheses"][0]["effects"]
    assert j.subsystem
    if method != "voltage":
        assert j.hit
        assert found["gap"]["after"] < 1.1


@pytest.mark.parametrize("method", ["refit", "bic"])
def test_without_effect_nothing_is_named(method, tmp_path):
    folder, truth = recorded(tmp_path)
    found = BASELINES[method](folder, ()).json
    assert not judge("w000", truth, found).failed
    assert found["verdict"] == "no_gap"
    assert found["gap"]["raw"] > found["gap"]["before"]
    assert found["gap"]["after"] == pytest.approx(1.0, abs=0.04)


def test_an_excluded_effect_is_not_named(tmp_path):
    folder, _ = recorded(tmp_path, "stator_resistance")
    for method in ("refit", "voltage"):
        found = BASELINES[method](folder, ("stator_resistance",)).json
        assert all("stator_resistance" not in h["effects"] for h in found["hypotheses"])


def test_a_step_with_a_prior_is_the_weighted_mean():
    """One parameter, slope 1, measured 10 times with rms 1: the prior of 0.5 counts as much as 4 of them."""
    y = np.arange(10.0)
    n = fit.Normal(("a",), ("a",), np.array([[10.0]]), np.array([y.sum()]), np.array([y @ y]), np.array([10]))
    dx, covariance, left = fit.step(n, {"a": 0.0}, {"a": 1.0}, {"a": 0.5}, ["a"])
    assert dx[0] == pytest.approx((y.sum() + 4.0 * 1.0) / 14.0)
    assert covariance[0, 0] == pytest.approx(1.0 / 14.0)
    assert left == pytest.approx(np.sum((y - dx[0]) ** 2) + 4.0 * (dx[0] - 1.0) ** 2)


def test_priors_are_the_campaigns_own(tmp_path):
    folder, _ = recorded(tmp_path)
    campaign = read_campaign(folder)
    sd = fit.priors(campaign)
    assert sd["magnet_flux.magnet_flux"] == pytest.approx(0.01 * campaign.drive.motor.magnet_flux)
    assert sd["current_offset.offset_a"] == campaign.background["current_offset"]
    assert sd["bench.lock_angle"] == pytest.approx(
        math.tau * 6 / campaign.drive.converter.encoder_counts / math.sqrt(12.0)
    )


def test_ridge_of_the_voltage_regression():
    """Against the closed form of one column, free and with a weight."""
    gram = np.array([[5.0, 3.0], [3.0, 2.0]])
    assert left_over(gram, [1], np.zeros(2)) == pytest.approx(5.0 - 9.0 / 2.0)
    assert left_over(gram, [1], np.array([0.0, 1.0])) == pytest.approx(5.0 - 9.0 / 3.0)
    assert binned(np.arange(35.0) + 0j) == pytest.approx([7.5, 23.5])
