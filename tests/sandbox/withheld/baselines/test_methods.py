"""The simple methods answer in the form of a diagnosis, and find what is plain to see."""

import math
from functools import cache

import numpy as np
import pytest

from model.effects.library import effect_names
from model.errors import BadInput
from sandbox.gap.evidence.algebra import Prior
from sandbox.gap.evidence.normal import turns
from sandbox.gap.evidence.priors import ordinary
from sandbox.recordings.campaign import read_folder
from sandbox.recordings.writing import write_campaign
from sandbox.withheld.baselines import refit as fit
from sandbox.withheld.baselines.methods import BASELINES, REFINED
from sandbox.withheld.baselines.voltage_regression import background, binned, left_over
from sandbox.withheld.making.case_list import Case
from sandbox.withheld.making.draw import draw
from sandbox.withheld.making.make import campaign_of
from sandbox.withheld.scoring.judge import judge

# of the usual length; `susie`, which goes by slopes alone, takes the shorter ones for ambiguous
SHORT, LONGER = 0.1, 0.3
RIVALS = {
    "encoder_offset",
    "dead_time",
    "device_drop",
    "magnet_flux",
    "skin_effect",
    "current_gain",
}
PLAIN = {"encoder_eccentricity", "stator_resistance"}
# candidates: what acts on the encoder or the voltage
LEFT_OUT = tuple(sorted(set(effect_names()) - RIVALS - PLAIN))


USUAL, KNOWN = fit.nuisances, {}  # fits without an effect, by the campaign's readings


@pytest.fixture(autouse=True)
def each_null_once(monkeypatch):
    """Several tests have the same campaign: it is fitted without an effect once."""

    def nuisances(campaign):
        readings = tuple(r.columns["i_a"].tobytes() for r in campaign.recordings)
        if readings not in KNOWN:
            KNOWN[readings] = USUAL(campaign)
        return KNOWN[readings]

    monkeypatch.setattr(fit, "nuisances", nuisances)


@cache
def made(names, sizes, family, length):
    """Return a short campaign with effects, and its truth: recorded once for all tests."""
    drawn = draw(
        Case(0, "one" if names else "none", family, "scored", names, sizes if names else ()), 31
    )
    return campaign_of(drawn, length), drawn.as_json()


def recorded(folder, *names, sizes=(2.0,), family="ipm_exchanged", method=""):
    """Write such a campaign; return its folder and truth."""
    campaign, truth = made(names, sizes, family, LONGER if method == "susie" else SHORT)
    return write_campaign(folder / "w000", campaign), truth


CASES = [
    ("bic", "stator_resistance", ()),
    ("susie", "encoder_eccentricity", ()),
    ("voltage", "stator_resistance", ()),
    ("stepwise", "encoder_eccentricity", LEFT_OUT),
]  # gp, refit: below


@pytest.mark.parametrize(("method", "effect", "left_out"), CASES)
def test_a_large_effect_is_found(method, effect, left_out, tmp_path):
    folder, truth = recorded(tmp_path, effect, method=method)
    found = BASELINES[method](folder, left_out).json
    assert sum(h["probability"] for h in found["hypotheses"]) == pytest.approx(1.0)
    j = judge("w000", truth, found)
    assert effect in found["hypotheses"][0]["effects"]
    assert j.subsystem
    if method == "susie":  # slopes alone: names of other effects stand beside a large one
        assert found["gap"]["after"] < 1.1
    elif method != "voltage":
        assert j.hit
        assert found["gap"]["after"] < 1.1


def test_two_effects_at_once_are_found_beside_a_discrepancy(tmp_path):
    """Both names, the whole gap closed, and each of three parameters within its 95 % interval or
    twice as far."""
    names = ("encoder_eccentricity", "stator_resistance")
    folder, truth = recorded(tmp_path, *names, sizes=(2.0, 2.0))
    found = BASELINES["gp"](folder, LEFT_OUT).json
    j = judge("w000", truth, found)
    assert j.top == names
    assert found["gap"]["after"] == pytest.approx(1.0, abs=0.04)
    assert j.parts[1] == 3
    best = found["hypotheses"][0]["parameters"]
    for name, value in truth["parameters"].items():
        low, high = best[name]["ci95"]
        away = (
            (best[name]["value"] - value + math.pi) % math.tau - math.pi
            if name.endswith("phase")
            else (best[name]["value"] - value)
        )
        assert abs(away) < high - low


@pytest.mark.parametrize(
    ("method", "left_out"),
    [("refit", ()), ("susie", ()), *((m, LEFT_OUT) for m in ("bic", "stepwise", "gp"))],
)
def test_without_effect_nothing_is_named(method, left_out, tmp_path):
    folder, truth = recorded(tmp_path, method=method)
    found = BASELINES[method](folder, left_out).json
    assert not judge("w000", truth, found).failed
    assert found["verdict"] == "no_gap"
    assert found["gap"]["raw"] > found["gap"]["before"]
    assert found["gap"]["after"] == pytest.approx(1.0, abs=0.04)


def test_an_excluded_effect_is_not_named(tmp_path):
    folder, _ = recorded(tmp_path, "stator_resistance")
    for method in ("refit", "voltage"):
        found = BASELINES[method](folder, (*LEFT_OUT, "stator_resistance")).json
        assert all("stator_resistance" not in h["effects"] for h in found["hypotheses"])


def test_an_effect_that_cannot_be_fitted_is_skipped(tmp_path, monkeypatch):
    folder, truth = recorded(tmp_path, "encoder_eccentricity")
    usual, failing = fit.refit, []

    def refit(point, coordinates, rounds):
        if any(c.effect == "encoder_eccentricity" for c in coordinates):
            failing.append(rounds)
            raise np.linalg.LinAlgError
        return usual(point, coordinates, rounds)

    monkeypatch.setattr(fit, "refit", refit)
    found = BASELINES["bic"](folder, LEFT_OUT).json
    assert failing
    assert not judge("w000", truth, found).failed
    named = {e for h in found["hypotheses"] for e in h["effects"]}
    assert "encoder_eccentricity" not in named
    assert len(named - {"unknown"}) == REFINED - 1


class Bent:
    """Normal equations of one reading, arctan x: from x = 2 a whole step overshoots, half a step
    gains."""

    coordinates = ("x",)

    def __init__(self, x, spoiled=()):
        self.x, self.spoiled = np.array([x]), spoiled

    def summed(self, weights=None):
        r, slope = -np.arctan(self.x), 1.0 / (1.0 + self.x**2)
        return np.outer(slope, slope), slope * r, float(r @ r)

    def moved(self, coordinates, x):
        return Bent(float(x[0]), self.spoiled)

    def at(self, trial):
        for spoiled, error in self.spoiled:
            if abs(trial.x[0] - spoiled) < 0.01:
                raise error
        return trial


def test_a_step_is_shortened_until_it_lowers_the_cost():
    """Steps from 2 lead to 2 - (1 + 4) arctan(2) s; s = 1 raises the cost, 0.5 does not."""
    whole = 5.0 * math.atan(2.0)
    prior = Prior(*(np.array([x]) for x in (0.0, 1e9, -math.inf, math.inf)))
    point, n, cost, tries = fit.stepped(Bent(2.0), Bent(2.0), prior, math.atan(2.0) ** 2)
    assert (point.x[0], tries) == (pytest.approx(2.0 - 0.5 * whole), 2)
    assert cost == pytest.approx(math.atan(2.0 - 0.5 * whole) ** 2)
    refusing = Bent(
        2.0, ((2.0 - 0.5 * whole, BadInput("no")), (2.0 - 0.25 * whole, np.linalg.LinAlgError()))
    )
    point, n, _, tries = fit.stepped(refusing, refusing, prior, math.atan(2.0) ** 2)
    assert (point.x[0], tries) == (pytest.approx(2.0 - 0.1 * whole), 4)
    stuck = fit.stepped(Bent(2.0), n, prior, 0.0)  # nothing is lower: all stays as it was
    assert stuck[1] is n
    assert stuck[2:] == (0.0, 4)


def test_priors_are_the_campaigns_own(tmp_path):
    """Means, deviations and bounds of the diagnosis' ordinary deviations, but for where the zone of
    a current's sign lies, and one angle for each recording."""
    folder, _ = recorded(tmp_path)
    campaign = read_folder(folder)
    null, _ = fit.nuisances(campaign)
    moved = [c for c in ordinary(campaign) if c.label != "bench.soft_center"]
    own = [*moved, *turns(null.point.prepared)]
    assert null.normal.coordinates == tuple(own)
    assert [c.names[0] for c in own if c.form == "turn"] == [r.file for r in campaign.recordings]
    stated = {
        c.label: (p, low, high)
        for c, p, low, high in zip(
            own, null.prior.deviation, null.prior.low, null.prior.high, strict=True
        )
    }
    flux = campaign.drive.motor.magnet_flux
    deviation, low, high = stated["magnet_flux.magnet_flux"]
    # of the true value, seen from the stated one
    assert deviation == pytest.approx(0.01 * flux, rel=0.05)
    assert (low, high) == (
        pytest.approx(flux - 4.0 * deviation),
        pytest.approx(flux + 4.0 * deviation),
    )
    assert stated["current_gain.gain_a"][0] == campaign.background["current_gain"]
    sizes = {c.label: c.deviation for c in own}
    places = {
        n: [k + 1]
        for k, n in enumerate(("stator_resistance", "magnet_flux", "encoder_offset", "dead_time"))
    }
    places |= {
        "inertia": [5],
        "viscous_friction": [6],
        "inductance": [7, 8],
        "saturation": [9, 10, 11, 12, 13],
    }
    places |= {"current_gain": [14, 15], "current_offset": [16, 17]}
    _, weight = background(campaign, places)
    assert weight[2] == pytest.approx(sizes["magnet_flux.magnet_flux"] ** -2)
    assert weight[7] == pytest.approx(sizes["inductance.scale_d"] ** -2)


def test_no_bound_holds_the_deviation_that_is_named(tmp_path):
    """36 % off, where ordinary ends at 4 %: `refit` follows, what it counts the gap from does
    not."""
    folder, truth = recorded(tmp_path, "stator_resistance")
    found = BASELINES["refit"](folder, LEFT_OUT).json
    j = judge("w000", truth, found)
    assert j.hit
    assert j.subsystem
    assert found["gap"]["after"] < 1.1
    low, high = found["hypotheses"][0]["parameters"]["stator_resistance.resistance"]["ci95"]
    assert 0.5 * (low + high) == pytest.approx(
        truth["parameters"]["stator_resistance.resistance"], rel=5e-3
    )
    assert found["gap"]["before"] > 20.0


def test_ridge_of_the_voltage_regression():
    """Against the closed form of one column, free and with a weight."""
    gram = np.array([[5.0, 3.0], [3.0, 2.0]])
    assert left_over(gram, [1], np.zeros(2)) == pytest.approx(5.0 - 9.0 / 2.0)
    assert left_over(gram, [1], np.array([0.0, 1.0])) == pytest.approx(5.0 - 9.0 / 3.0)
    assert binned(np.arange(35.0) + 0j) == pytest.approx([7.5, 23.5])


def test_the_voltage_regression_answers_without_a_free_rotor(tmp_path):
    """A narrow campaign: no motion to regress, so no mechanical effect; a device drop twice the
    medium one shows."""
    drawn = draw(
        Case(0, "one", "ipm_exchanged", "scored", ("device_drop",), (2.0,), None, "one_link"), 31
    )
    folder = write_campaign(tmp_path / "w000", campaign_of(drawn))
    named = {e for h in BASELINES["voltage"](folder, ()).json["hypotheses"] for e in h["effects"]}
    assert "device_drop" in named
    assert not named & {"inertia", "coulomb_friction", "cogging_torque"}
