"""Columns of different quantities that stand for each other are named, and no other remedy.

The logs are closed forms of the nominal model, so read rightly they leave next to nothing.
"""

import itertools

import numpy as np
import pytest

from model.errors import BadInput
from sandbox import check, diagnose, read_campaign
from tests.sandbox.gap.motion.closed_form import MOTOR, motion
from tests.sandbox.recordings.made_angles import SWING, turning, written

COLUMNS = ("t", "u_alpha", "i_a", "u_dc", "theta")  # one of each quantity
PAIRS = [*itertools.combinations(COLUMNS, 2)]


def log():
    columns, theta = turning(SWING)
    return {**columns, "theta": theta}


def way(columns, **others):
    """Columns of which some hold what others should."""
    return columns | {name: columns[other] for name, other in others.items()}


def refused(folder, mapping):
    found = check(folder, columns=mapping, effects=False)
    assert not found.ok
    return found.mistakes


def test_a_right_log_is_not_refused(tmp_path):
    assert check(tmp_path, columns=written(tmp_path, log()), effects=False).ok


@pytest.mark.parametrize(("x", "y"), PAIRS, ids=["-".join(p) for p in PAIRS])
def test_two_exchanged_columns_are_named(tmp_path, x, y):
    (said,) = refused(tmp_path, written(tmp_path, way(log(), **{x: y, y: x})))
    assert "are exchanged: read so, " in said
    assert f"{x} = {{column = '{y}'}}" in said
    assert f"{y} = {{column = '{x}'}}" in said


def test_all_currents_for_all_voltages(tmp_path):
    columns = log()
    i, u = (columns["i_a"], columns["i_b"]), (columns["u_alpha"], columns["u_beta"])
    turned = columns | dict(zip(("u_alpha", "u_beta", "i_a", "i_b"), (*i, *u), strict=True))
    del turned["i_c"]
    (said,) = refused(tmp_path, written(tmp_path, turned))
    assert "'i_a' and 'u_alpha', 'i_b' and 'u_beta' are exchanged" in said


def test_a_column_that_nobody_mapped_is_the_one(tmp_path):
    columns = log()
    columns["Temp"] = 25.0 + 0.1 * np.sin(50.0 * columns["t"])
    columns["Pos"] = np.degrees(columns.pop("theta"))
    mapping = '\n[columns]\ntheta = {column = "Temp", unit = "deg"}'
    (said,) = refused(tmp_path, written(tmp_path, columns, mapping))
    assert "column 'Pos' is theta, 'Temp' is not" in said
    assert said.endswith("map theta = {column = 'Pos', unit = 'deg'}")


def test_columns_that_stand_one_beside_their_names(tmp_path):
    columns = log()
    names = list(columns)
    moved = {n: columns[names[k - 1]] for k, n in enumerate(names)}
    (said,) = refused(tmp_path, written(tmp_path, moved))
    assert "each column holds what the one beside it should" in said


def test_identify_and_diagnose_say_it_too(tmp_path):
    mapping = written(tmp_path, way(log(), i_a="theta", theta="i_a"))
    for use in (read_campaign, diagnose):
        with pytest.raises(BadInput, match=r"'i_a' and 'theta' are exchanged"):
            use(tmp_path, columns=mapping)


def test_a_mistake_of_another_kind_is_still_itself(tmp_path):
    columns = log()
    for n in ("i_a", "i_b", "i_c"):
        columns[n] = 1e3 * columns[n]
    said = refused(tmp_path, written(tmp_path, columns))
    assert "currents are in mA" in said[0]
    assert not any("exchanged" in text for text in said)


MOTION = {"t": "t", "theta": "angle", "i_q": "iq", "speed": "speed", "temperature": "temp"}


def moving(folder, columns):
    """Check two runs of a motion with columns as they stand in MOTION."""
    text = '[columns]\ntheta = {column = "angle", unit = "rev", mechanical = true}\n'
    text += 'i_q = "iq"\nspeed = {column = "speed", unit = "rev/s", mechanical = true}\n'
    text += 'temperature = "temp"\n' + MOTOR
    for k, own in enumerate(columns):
        np.savetxt(
            folder / f"{k}.csv",
            np.column_stack(list(own.values())),
            delimiter=",",
            header=",".join(own),
            comments="",
        )
        text += f'[[recording]]\nfile = "{k}.csv"\nrotor = "free"\n'
    (folder / "m.toml").write_text(text)
    return check(folder, columns=folder / "m.toml", effects=False)


def runs():
    out = []
    for seed in (0, 1):
        own = motion(seed=seed)
        del own["uq"]
        out.append({**own, "temp": np.full(len(own["t"]), 25.0)})
    return out


SHAFT = [*itertools.combinations(MOTION, 2)]


@pytest.mark.parametrize(("x", "y"), SHAFT, ids=["-".join(p) for p in SHAFT])
def test_two_exchanged_columns_of_a_motion_are_named(tmp_path, x, y):
    """A speed that stands for an angle is explained by friction alone, and a current that never
    changes by anything."""
    a, b = MOTION[x], MOTION[y]
    found = moving(tmp_path, [way(own, **{a: b, b: a}) for own in runs()])
    (said,) = found.mistakes
    assert "are exchanged: read so, " in said
    assert {x, y} <= {word.strip("(){,:") for word in said.split()}


def test_a_motion_as_it_is_is_not_doubted(tmp_path):
    assert moving(tmp_path, runs()).mistakes == ()


def test_what_a_motion_leaves_of_its_torque_is_said(tmp_path):
    """A current of noise alone: nothing else tells, so it is a note."""
    some = runs()
    for k, own in enumerate(some):
        own["iq"] = np.random.default_rng(k).standard_normal(len(own["t"]))
    found = moving(tmp_path, some)
    texts = [n.finding.text for n in found.noticed]
    assert any("of what the torque changes by is unexplained by inertia, frict" in t for t in texts)
