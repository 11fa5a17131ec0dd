"""Injection 45 degrees beside the estimated d axis: the size of the ripple alone tells the error.

Where other methods ask for the direction of the ripple, one number, |Gamma u| (`beside`), is
compared with the one that the belief expects; so the inductances have to be known to a part of the
saliency: if both are x percent off, the angle is (S^2 + D^2)/(2 S D) x percent of a rad off.  Half
of the injection's power is along q, where it makes torque. The gains of MESC's own loop are an
option of the drive, `[injection] tracking = "mesc"` (`published`).
"""

from __future__ import annotations

from estimators.contract import STEP, Estimator
from estimators.diagonal import SIZE, diagonal_step, init
from model.compiled import kernel_as


@kernel_as(STEP)
def step(state, sample, belief, tuning):
    """Take one sample; see the module's text."""
    return diagonal_step(state, sample, belief, tuning, SIZE)


ESTIMATOR = Estimator(
    "hfi45",
    "pulsating injection 45 degrees beside d, angle of the ripple's size alone",
    init,
    step,
    delay="0.75 N - 0.5 samples of demodulation (N samples an injection period)",
    speeds="0 to where the current loop behind the injection's average holds; torque ripple "
    "from the q injection",
    source="the 45 degree injection of the open firmwares MESC and VESC by its principle; "
    "equations derived here",
)
