"""Injection 45 degrees beside the estimated d axis, the ripple along the injection: VESC's second
and third HFI.

The ripple along the injection is G = S + D sin 2e at an error e (`beside`).  The firmware therefore
takes
  e = (G - S) / (1/L_d - 1/L_q)
for the error, with inductances that its configuration states: one current difference between two
samples, one division. Here S and the slope are what a belief expects; with a linear belief that is
the firmware's equation.  As with `hfi45` inductances have to be known to a part of the saliency:
both x percent off turn the angle by S/(2 D) x percent of a rad.

What of the family is elsewhere: its first version turns the injection and reads the second harmonic
of the answers over a turn (`rotating`); its fourth and fifth inject along d and read the q ripple
(`qnull`, at half the sampling rate).
Saturation: the firmware injects more volts with more current and keeps both inductances; its
saturation compensation (foc_sat_comp) scales the one inductance of its flux observer by the
current, or by the flux estimated, and is not in the HFI.  Here a saturated belief takes its place.
Left out: limits by another observer's speed, the change of the axis' side with the sign of the
current.  Its own loop's gains are an option of the drive, `[injection] tracking = "vesc"`
(`published`).
"""

from __future__ import annotations

from estimators.contract import STEP, Estimator
from estimators.diagonal import ALONG, diagonal_step, init
from model.compiled import kernel_as


@kernel_as(STEP)
def step(state, sample, belief, tuning):
    """Take one sample; see the module's text."""
    return diagonal_step(state, sample, belief, tuning, ALONG)


ESTIMATOR = Estimator(
    "vesc_hfi",
    "pulsating injection 45 degrees beside d, angle of the ripple along it",
    init,
    step,
    delay="0.75 N - 0.5 samples of demodulation (N samples an injection period)",
    speeds="0 to where the current loop behind the injection's average holds; torque ripple "
    "from the q injection",
    source="VESC firmware (Vedder), sensor modes HFI V2 and V3, by their equation "
    "(precalculated values of foc_math.c: half the sum of 1/L_d and 1/L_q, and 1/L_q - 1/L_d); "
    "belief, resistance and speed derived here",
)
