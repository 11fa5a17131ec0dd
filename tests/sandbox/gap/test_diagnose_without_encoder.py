"""A diagnosis of a log that holds a speed in place of the angle."""

import numpy as np

from sandbox.gap.diagnose import diagnosis_of, out_of_sight, verdict
from sandbox.gap.report.which import which_text
from sandbox.recordings.importing import read_recordings
from sandbox.recordings.writing import write_campaign
from tests.sandbox.gap.conftest import DRIVE, small_campaign

FLUX = 0.8 * DRIVE.motor.magnet_flux
CASES = (
    ("driven_slow", "driven", 10.0, 20.0),
    ("driven_middle", "driven", 30.0, 22.0),
    ("driven_fast", "driven", 60.0, 25.0),
)


def without_angle(folder, seed=3):
    """Write the recordings with erpm in whole numbers and no angle; return the campaign as it is
    read."""
    own = small_campaign({"magnet_flux.magnet_flux": FLUX}, CASES)
    write_campaign(folder, own)
    text = (folder / "campaign.toml").read_text().replace(".parquet", ".csv")
    rng = np.random.default_rng(seed)
    for r in own.recordings:
        columns = {n: x for n, x in r.columns.items() if n != "theta"}
        speed = np.full(len(r.t), np.ptp(r.theta) / np.ptp(r.t)) * 30.0 / np.pi
        columns["erpm"] = np.round(speed + rng.normal(0.0, 3.0, len(r.t)))
        rows = np.column_stack(list(columns.values()))
        name = r.file.replace(".parquet", ".csv")
        np.savetxt(
            folder / name, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.9g"
        )
    (folder / "campaign.toml").write_text(text)
    (folder / "m.toml").write_text('[columns]\nspeed = {column = "erpm", unit = "rpm"}\n')
    return read_recordings(folder, folder / "m.toml")


def test_a_weak_magnet_is_found_and_nothing_false_is_sure(tmp_path):
    """20 % of the flux, back within 0.5 %; what an encoder does is no candidate."""
    campaign = without_angle(tmp_path / "log")
    assert set(out_of_sight(campaign)) >= {"encoder_offset", "encoder_eccentricity"}
    d = diagnosis_of(campaign)
    assert d.best.effects == ("magnet_flux",)
    assert verdict(d) in ("explained", "ambiguous")
    sure = set.intersection(*(set(h.effects) for h in d.ambiguity_set))
    assert sure <= {"magnet_flux"}
    value = d.parameters[0]["magnet_flux.magnet_flux"].value
    assert abs(value / FLUX - 1.0) < 5e-3
    assert (
        "No angle was read: encoder eccentricity, encoder offset were no candidates"
        in which_text(d)
    )
