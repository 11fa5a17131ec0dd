"""What injection costs, each figure against its closed form: ripples of known size on a linear
motor, a real run."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from model.drive_files import load_drive
from model.energy import flux_from_current, hessian
from model.errors import BadInput
from sandbox.drive.recording import CHANNELS, Recording
from sandbox.drive.scenario import Scenario, Segment
from sandbox.evaluation import choice
from sandbox.evaluation.compare import single
from sandbox.evaluation.injection_cost import REFERENCE, branch_current, injection_cost
from sandbox.evaluation.pages.cost_figure import cost_figure, cost_table
from sandbox.evaluation.sound import a_weight
from sandbox.evaluation.step_cost import pwm_ripple

DRIVE = load_drive("ipm_exchanged")
ALPHAS = dict.fromkeys(("alpha_30", "alpha_12", "alpha_40", "alpha_22", "alpha_04"), 0.0)
LINEAR = dataclasses.replace(DRIVE, motor=dataclasses.replace(DRIVE.motor, **ALPHAS))
MOTOR, H, N = LINEAR.motor, DRIVE.converter.sampling_period, 8
SEEN = np.arange(1000)
WAVE = np.cos(2.0 * np.pi * SEEN / N)  # at the injection's frequency, 500 Hz
# mean square of straight lines between a sine's samples, over it
STRAIGHT = (2.0 + math.cos(2.0 * math.pi / N)) / 3.0


def recorded(**channels):
    """Return a recording at standstill of what is given, all else zero."""
    table = np.zeros((SEEN.size, len(CHANNELS)))
    for name, values in {"t": SEEN * H, "u_dc": 560.0, **channels}.items():
        table[:, CHANNELS.index(name)] = values
    return Recording(table)


def cost_of(**channels):
    return injection_cost(LINEAR, recorded(**channels), MOTOR)


def test_nothing_injected_costs_nothing():
    # the PWM's own ripple is in what it is compared with
    cost = cost_of(i_d=0.1, i_q=1.0, u_alpha=5.0)
    assert (cost.copper_w, cost.torque_nm, cost.link_a, cost.injected_v) == pytest.approx(
        (0.0, 0.0, 0.0, 0.0), abs=1e-9
    )
    assert cost.sound_db == pytest.approx(-120.0)
    assert cost.iron_w is None


@pytest.mark.parametrize("axis", ["i_d", "i_q"])
def test_copper_loss_of_a_sine(axis):
    """3/2 R I^2/2, of the straight lines between samples; a mean current beside it changes
    nothing."""
    size = 0.05
    cost = cost_of(**{"i_q": 1.0, axis: (axis == "i_q") + size * WAVE})
    expected = 1.5 * MOTOR.resistance * 0.5 * size**2 * STRAIGHT
    # instants in a period, as RATE asks for: the mean of x^2 over k/12 is 1/3 + 1/(6 12^2)
    points = 12
    assert cost.copper_w == pytest.approx(expected, rel=1.0 / points**2)
    assert cost.loss_share == pytest.approx(
        cost.copper_w / (1.5 * MOTOR.resistance * MOTOR.rated_current**2)
    )


def test_torque_ripple_of_a_current_ripple():
    """3/2 p (psi_m + (L_d - L_q) i_d) I / sqrt 2, i_d constant."""
    i_d, size = 0.3, 0.05
    cost = cost_of(i_d=i_d, i_q=1.0 + size * WAVE)
    flux = MOTOR.magnet_flux + (MOTOR.inductance_d - MOTOR.inductance_q) * i_d
    expected = 1.5 * MOTOR.pole_pairs * flux * size * math.sqrt(0.5 * STRAIGHT)
    assert cost.torque_nm == pytest.approx(expected, rel=1.0 / 12**2)
    assert cost.torque_ripple == pytest.approx(cost.torque_nm / MOTOR.rated_torque)


def test_sound_of_known_forces():
    """q ripple at 500 Hz: its torque; d ripple: the radial force 2 psi_m L_d i_d over that at rated
    i_q."""
    weight, size = float(a_weight(500.0)), 1e-3
    rms = size * math.sqrt(0.5 * STRAIGHT)
    torque = 1.5 * MOTOR.pole_pairs * MOTOR.magnet_flux * rms / MOTOR.rated_torque
    expected = 20.0 * math.log10(weight * torque / REFERENCE)
    # lines bend at the samples: harmonics at 3.5 kHz and on, 1/49 in size, louder by 4 dB; instants
    # as above
    assert cost_of(i_q=size * WAVE).sound_db == pytest.approx(expected, abs=0.05)
    rated = MOTOR.magnet_flux**2 + (MOTOR.inductance_q * MOTOR.rated_current) ** 2
    radial = 2.0 * MOTOR.magnet_flux * MOTOR.inductance_d * rms / rated
    assert cost_of(i_d=size * WAVE).sound_db == pytest.approx(
        20.0 * math.log10(weight * radial / REFERENCE), abs=0.05
    )


def test_link_ripple_and_volts_of_a_voltage():
    """3/2 U I / u_dc of a voltage U cos along a current I; pulses change the current by far
    less."""
    size, current = 20.0, 1.0
    cost = cost_of(i_q=current, u_beta=size * WAVE)
    assert cost.injected_v == pytest.approx(size)
    assert cost.link_a == pytest.approx(1.5 * size * current / 560.0 / math.sqrt(2.0), rel=0.01)


def test_core_loss_of_a_turning_flux():
    """i_c = j w psi / R_c / (1 + j w tau), so 3/2 R_c |i_c|^2 = 3/2 (w psi)^2 / R_c / (1 + (w
    tau)^2)."""
    step, w, flux, resistance, lag = 1e-6, 2.0 * math.pi * 500.0, 0.02, 5000.0, 2e-4
    psi = flux * np.exp(1j * w * step * np.arange(20_000))
    found = branch_current(psi, step, resistance, lag)[10_000:]  # 50 time constants on
    assert np.abs(found) == pytest.approx(
        w * flux / resistance / math.hypot(1.0, w * lag), rel=(w * step) ** 2
    )


def test_core_loss_of_an_injection():
    """A sine of the flux along d of a linear motor is two half ones that turn either way."""
    size, effects = 0.05, {"iron_loss.core_resistance": 5000.0, "iron_loss.time_constant": 2e-4}
    cost = injection_cost(LINEAR, recorded(i_d=size * WAVE), MOTOR, effects)
    w, flux = 2.0 * math.pi * 500.0, MOTOR.inductance_d * size
    expected = 1.5 * 0.5 * (w * flux) ** 2 / 5000.0 / (1.0 + (w * 2e-4) ** 2)
    # the fundamental of straight lines between samples
    bent = (math.sin(math.pi / N) / (math.pi / N)) ** 2
    # less lagged
    harmonics = sum(1.0 / (N * k + s) ** 4 * (N * k + s) ** 2 for k in (1, 2, 3) for s in (-1, 1))
    assert expected * bent**2 < cost.iron_w < expected * bent**2 * (1.0 + harmonics)


def test_a_run_costs_what_its_square_wave_does():
    """At standstill the current is a triangle of peak U Gamma N h/4, beside the PWM's ripple
    at +-U."""
    loaded = Scenario("cost", (Segment(0.6, 1.0, ramp=0.1, settle=0.3),), start_up=False)
    comparison, _ = single(DRIVE, loaded, "qnull")
    (row,) = comparison.rows
    d, q = (float(x) for x in flux_from_current(DRIVE.motor.energy, 0.0, DRIVE.motor.rated_current))
    gamma = hessian(DRIVE.motor.energy, d, q)
    peak = 30.0 * math.hypot(*gamma[:2]) * N * H / 4.0
    theta, held = 0.0, 1j * DRIVE.motor.resistance * DRIVE.motor.rated_current
    pulses = (
        pwm_ripple(DRIVE, 30.0 + held, theta, gamma, 0.0) ** 2
        - pwm_ripple(DRIVE, held, theta, gamma, 0.0) ** 2
    )
    expected = 1.5 * DRIVE.motor.resistance * (peak**2 / 3.0 + pulses)
    # of it R Gamma T / 2 pi = 0.1 squared, and noise
    assert row.cost.copper_w == pytest.approx(expected, rel=0.05)
    # and what the loop answers to noise
    assert row.cost.injected_v == pytest.approx(30.0, rel=0.02)


def test_too_short_or_thinned_a_stretch_tells_nothing():
    whole = recorded(i_q=WAVE)
    assert injection_cost(LINEAR, Recording(whole.table[:96]), MOTOR) is None
    assert injection_cost(LINEAR, Recording(whole.table[::2]), MOTOR) is None


def test_the_figure_names_each_estimator_and_marks_the_limits():
    def standing(name, belief, p95, sound, loss):
        return choice.Standing(
            name, belief, True, 1, 0, 0, 0.1, p95, None, loss_w=loss, sound_db=sound
        )

    found = [standing("a", "saturated", 2.0, 40.0, 0.5), standing("b", "linear", 1.0, -20.0, 1e-6)]
    drawing = cost_figure(found, "motor", limits=choice.limits_of(30.0, 1.0))
    error, loss, sound = drawing.axes
    assert [t.get_text() for t in error.get_yticklabels()] == ["b", "a"]  # the smaller error first
    assert loss.lines[-1].get_xdata()[0] == 1.0
    assert sound.lines[-1].get_xdata()[0] == 30.0
    # what is not heard stands at the edge
    assert min(line.get_xdata()[0] for line in sound.lines) == 0.0
    heads, lines = cost_table(found)
    assert len(heads) == len(lines[0]) == len(lines[1]) == 9


@pytest.mark.parametrize(
    ("given", "said"), [((math.nan, None), "not finite"), ((None, -1.0), "at least 0")]
)
def test_limits_that_are_none_are_refused(given, said):
    with pytest.raises(BadInput, match=said):
        choice.limits_of(*given)


def test_limits_leave_out_what_is_louder_or_dearer():
    def standing(name, p95, sound, loss):
        return choice.Standing(
            name, "saturated", True, 1, 0, 0, 0.1, p95, None, loss_w=loss, sound_db=sound
        )

    found = [
        standing("loud", 0.3, 40.0, 0.5),
        standing("dear", 0.3, 20.0, 2.0),
        standing("fit", 2.0, 20.0, 0.5),
    ]
    assert [s.estimator for s in choice.best(found)] == ["loud", "dear"]
    limits = choice.limits_of(30.0, 1.0)
    assert [s.estimator for s in choice.best(found, limits)] == ["fit"]
    said = choice.which(found, limits)
    assert said.startswith("fit with the saturated belief")
    assert "loud with the saturated belief is louder (40 dB) than 30 dB" in said
    assert "dear with the saturated belief adds 2 W, more than 1 W" in said
    assert choice.which(found, choice.limits_of(10.0, None)).startswith(
        "None of these within the limits. Out: loud"
    )
