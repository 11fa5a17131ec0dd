"""Injection in rows that are too slow for it is named as the cause, stated or not."""

import dataclasses

import numpy as np
import pytest

from model.drive_files import load_drive
from sandbox.public.campaigns.checked import check
from sandbox.recordings.findings import Finding
from sandbox.recordings.importing import read_recordings
from sandbox.recordings.rows.aliased import or_injected

# V at 500 Hz on a locked rotor of 1 ohm and 10 mH beside a slow wave: with 8 periods of 0.25 ms a
# row they stand still
SLOW, FAST, R, L, FINE = 2.0, 20.0, 1.0, 1e-2, 1e-5


def log(folder, rows, stated):
    """Write a log of a locked rotor under injection, its rows so many s apart."""
    t = np.arange(0.0, 0.8, FINE)
    u = SLOW * np.sin(3.0 * t) + FAST * np.where((t * 500.0 + 0.07) % 1.0 < 0.5, 1.0, -1.0)
    i = np.zeros(len(t))
    for k in range(len(t) - 1):
        i[k + 1] = i[k] + FINE * (u[k] - R * i[k]) / L
    own = slice(None, None, round(rows / FINE))
    columns = np.column_stack(
        [t[own], i[own], -0.5 * i[own], -0.5 * i[own], u[own], 0 * t[own], 0.3 + 0 * t[own]]
    )
    head = "t,i_a,i_b,i_c,u_alpha,u_beta,theta"
    np.savetxt(folder / "log.csv", columns, delimiter=",", header=head, comments="", fmt="%.8g")
    injection = '[injection]\nfrequency = 500.0\namplitude = 20.0\nwaveform = "square"\n'
    (folder / "campaign.toml").write_text(
        f"[drive]\nsampling_period = {rows}\ndc_bus_voltage = 48.0\ncurrent_noise = 0.01\n[motor]\n"
        f"pole_pairs = 4\nresistance = {R}\nmagnet_flux = 0.02\ninductance_d = {L}\ninductance_q = "
        f"{L}\nrated_current = 5.0\n{injection if stated else ''}"
        '[[recording]]\nfile = "log.csv"\nrotor = "locked"\n'
        + ('injection_axis = "d"\n' if stated else ""),
    )
    return folder


@pytest.mark.parametrize(("rows", "seen"), [(1.25e-3, 300.0), (2e-3, 0.0), (3e-3, 166.7)])
def test_a_stated_injection_above_half_of_the_rows_is_refused(tmp_path, rows, seen):
    """Seen at the difference to the nearest multiple of the rows' rate; by `check` and by what a
    diagnosis reads alike."""
    found = check(log(tmp_path, rows, True), effects=False)
    (text,) = [n.finding.text for n in found.noticed if n.level == "refused"]
    assert text.startswith("log.csv: injection of 500 Hz is above half of the ")
    assert f"they show it as {seen:g} Hz" in text
    with pytest.raises(Exception, match="log every PWM period while injecting"):
        read_recordings(tmp_path)


def test_an_injection_that_nobody_states_is_named_where_much_is_unexplained(tmp_path):
    found = check(log(tmp_path, 2e-3, False), effects=False)
    texts = [n.finding.text for n in found.noticed if "unexplained" in n.finding.text]
    assert texts
    assert all("an injection above 250 Hz stands in them as another frequency" in x for x in texts)


def test_rows_of_every_period_hide_no_injection():
    """Stated so, or as fast as a PWM is; a log of every tenth period may hide one."""
    drive = load_drive("ipm")
    finding = Finding("log.csv", "u_alpha", 3, "much is unexplained")

    def said(**converter):
        own = dataclasses.replace(drive.converter, **converter)
        return or_injected(finding, dataclasses.replace(drive, converter=own)).text

    assert said() == finding.text
    assert said(sampling_period=1e-3, pwm_frequency=1e3) == finding.text
    assert said(sampling_period=1e-4, pwm_frequency=None) == finding.text
    assert "above 50 Hz" in said(sampling_period=1e-2, pwm_frequency=None)
    assert "above 500 Hz" in said(sampling_period=1e-3, pwm_frequency=1e4)
