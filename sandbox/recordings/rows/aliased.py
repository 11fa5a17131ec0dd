"""Injection that rows are too slow to show: it stands in them as another frequency, or as none.

What is sampled fewer than twice a period is seen at the difference to the nearest multiple of the
sampling.  Currents then carry what commands do not show, and most of the voltage is unexplained.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from model.parameters import Drive
from sandbox.recordings.campaign import CampaignRecording
from sandbox.recordings.findings import Finding, Refused

ROUNDING = 1.0 + 1e-3  # of a frequency that is stated in round numbers
SLOWEST_PWM = 2000.0  # Hz: drives switch faster, so that slower rows are not each period's


def refuse_aliased(recordings: Sequence[CampaignRecording], drive: Drive) -> None:
    """Raise Refused where a recording has an injection of more than half of the rows' rate."""
    rate, frequency = 1.0 / drive.converter.sampling_period, drive.injection.frequency
    injected = [r.file for r in recordings if r.injection_axis != "none"]
    if not injected or frequency <= 0.5 * rate * ROUNDING:
        return
    seen = abs(frequency - rate * round(frequency / rate))
    text = (
        f"{injected[0]}: injection of {frequency:g} Hz is above half of the {rate:.6g} rows a "
        f"second (rows are {1e3 / rate:.4g} ms apart): they show it as {seen:.4g} Hz, and currents "
        "carry what the commands do not show: log every PWM period while injecting, or record "
        "without injection"
    )
    raise Refused(Finding(injected[0], "t", None, text, tuple(injected)))


def or_injected(finding: Finding, drive: Drive) -> Finding:
    """Return a finding on voltage that is unexplained, with what else may be the cause where rows
    are slower than PWM periods."""
    c = drive.converter
    rate = 1.0 / c.sampling_period
    every = c.periods_a_row == 1 and (c.pwm_frequency is not None or rate >= SLOWEST_PWM)
    if every:
        return finding
    text = (
        f"{finding.text}; or the drive injects: rows are {1e3 / rate:.4g} ms apart, so that an "
        f"injection above {0.5 * rate:.4g} Hz stands in them as another frequency: log every PWM "
        "period, or switch the injection off while recording"
    )
    return replace(finding, text=text)
