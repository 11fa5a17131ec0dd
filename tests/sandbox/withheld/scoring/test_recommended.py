"""The recommended recording, made on the true bench: the replay at the truth meets its floor,
too."""

import json
from dataclasses import replace

import numpy as np
import pytest

from model.errors import BadInput
from sandbox.gap.planning.menu import menu
from sandbox.recordings.campaign import read_folder
from sandbox.recordings.writing import write_campaign
from sandbox.replay.replay import prepare, replay, residuals
from sandbox.withheld.making.case_list import Case, cases
from sandbox.withheld.making.draw import draw
from sandbox.withheld.making.make import campaign_of
from sandbox.withheld.making.outside_causes import OUTSIDE
from sandbox.withheld.scoring.recommended import cycle_of, drawn_again, entry_of, grow, recommended
from tests.sandbox.withheld.known import true_set

DRAWN = draw(Case(0, "one", "ipm_exchanged", "scored", ("dead_time",), (1.0,)), 11)
NAMES = [e.name for e in menu(DRAWN.true)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_campaign(tmp_path_factory.mktemp("follow") / "w000", campaign_of(DRAWN, 0.1))


@pytest.mark.parametrize("name", NAMES)
def test_every_entry_can_be_recorded_and_replayed_at_the_truth(name, folder, tmp_path):
    """Floor 1 within what encoder counts cost (free rotors: 1.2 as in making/test_make), also on
    a lower link."""
    grown = read_folder(grow(folder, tmp_path / "w000", (name, 0.5), DRAWN))
    assert [r.file for r in grown.recordings[:-1]] == [
        r.file for r in read_folder(folder).recordings
    ]
    added, entry = grown.recordings[-1], entry_of(grown, name, 0.5)
    assert len(added.t) == round(0.5 / DRAWN.true.converter.sampling_period)
    full = DRAWN.true.converter.dc_bus_voltage
    assert added.dc_bus_voltage == (entry.link * full if entry.link != 1.0 else None)
    assert np.mean(added.u_dc) == pytest.approx(entry.link * full, rel=1e-3)
    values = true_set(DRAWN, grown)
    one = replace(grown, recordings=(added,))
    prepared = prepare(one, values)
    found = residuals(prepared, replay(prepared, [values]))[0]
    assert found.rms()[0] < 1.2
    size = np.hypot(*added.current)
    assert np.max(size) < 1.3 * max(
        np.max(np.hypot(entry.i_d, entry.i_q)), 0.3 * grown.drive.motor.rated_current
    )


def test_a_plan_asks_for_the_entrys_currents():
    entry = next(e for e in menu(DRAWN.true) if e.name == "locked_d_inject_q")
    planned = cycle_of(entry)
    assert (planned.rotor, planned.injection_axis) == ("locked", "q")
    assert np.array_equal(planned.plan[:, 1], entry.i_d)


def test_only_an_ambiguous_diagnosis_asks():
    following = {"entry": "free_coast", "seconds": 2.0}
    asks = {"next_recording": following, "verdict": "ambiguous"}
    assert recommended(asks) == ("free_coast", 2.0)
    assert recommended({**asks, "verdict": "no_gap"}) is None
    assert recommended({**asks, "next_recording": None}) is None
    with pytest.raises(BadInput, match=r"unknown recording .free_coats.*free_coast"):
        entry_of(campaign_of(DRAWN, 0.02), "free_coats", 1.0)


def test_the_truth_is_drawn_again_or_refused():
    drawn = [draw(c, 5) for c in cases(3, 5, "mixed", "scored")]
    truths = json.loads(json.dumps({d.case.name: d.sealed() for d in drawn}))
    content = {
        "seed": 5,
        "kind": "mixed",
        "style": "scored",
        "sizes": "ladder",
        "outside": list(OUTSIDE),
    }
    content["campaigns"] = truths
    assert drawn_again(content, "w001") == drawn[1]
    truths["w001"]["bench"]["theta"] += 1e-3
    with pytest.raises(BadInput, match="another version"):
        drawn_again(content, "w001")
    del content["sizes"]
    with pytest.raises(BadInput, match="another version"):
        drawn_again(content, "w001")
