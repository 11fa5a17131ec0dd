"""Effects from a line, a file or a mapping: the same numbers; what is wrong is said with file,
table and key."""

import pytest

from model.effect_files import effects_and_angles, effects_of
from model.effects.library import load_effect
from model.errors import BadInput

FILE = """
[effects]
dead_time.time = 2e-6
cogging_torque.2.order_mech = 12
[bench]
soft_current = 0.02
[angles]
"locked d.parquet" = 1e-4
[offsets]
"locked d.parquet" = [1e-3, -2e-3, 1e-3]
[residual]
"locked d.parquet" = 0.98
"""


def test_a_file_says_what_a_mapping_says(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(FILE)
    found = {
        "dead_time.time": 2e-6,
        "cogging_torque.2.order_mech": 12.0,
        "bench.soft_current": 0.02,
    }
    assert effects_of(path) == effects_of(str(path)) == effects_of(found) == found
    assert effects_and_angles(path).angles == {"locked d.parquet": 1e-4}
    assert effects_and_angles(path).offsets == {"locked d.parquet": (1e-3, -2e-3, 1e-3)}
    assert effects_of("dead_time.time=2e-6") == {"dead_time.time": 2e-6}
    assert effects_of(None) == effects_of("") == {}
    other = tmp_path / "MINE.TOML"  # as Windows may write it
    other.write_text(FILE)
    assert effects_of(f" {other} ") == found


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[efects]\n", "mine.toml: unknown table 'efects'; did you mean 'effects'"),
        (
            "[effects]\ndead_time.tim = 1e-6\n",
            "mine.toml: unknown effect parameter 'dead_time.tim'; did you mean",
        ),
        (
            "[effects]\ndead_time.time = 'long'\n",
            r"mine.toml: \[effects\] dead_time.time = 'long' is no finite number",
        ),
        ("[effects]\ndead_time = 2e-6\n", "mine.toml: unknown effect parameter 'dead_time'"),
        (
            "dead_time.time = 2e-6\n",
            r"'dead_time' is an effect .*; write \[effects\] above dead_time.PARAMETER = VALUE",
        ),
        (
            "[dead_time]\ntime = 2e-6\n",
            r"'dead_time' is an effect .*, or \[effects.dead_time\]",
        ),
        ("[effects]\ndead_time.time = 9.0\n", "mine.toml: dead_time.time = 9.0 is out of range"),
        (
            "[bench]\nsoft_current = nan\n",
            r"mine.toml: \[bench\] soft_current = nan is no finite number",
        ),
        ("[offsets]\na = [1, 2]\n", r"\[offsets\] a = \[1, 2\] is no list of three currents; give"),
        ("effects = 3\n", r"mine.toml: 'effects' is not a table; write \[effects\]"),
        ("[[effects\n", "not valid TOML"),
    ],
)
def test_a_wrong_file_is_refused_in_a_sentence(tmp_path, text, said):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(BadInput, match=said):
        effects_of(path)


@pytest.mark.parametrize("name", ["9" * 400, "../errors", "card", ""])
def test_a_name_that_is_no_effects_file_is_unknown(name):
    """The fuzz found: a name longer than a file's may be ended in the system's error."""
    with pytest.raises(BadInput, match="unknown effect"):
        load_effect(name)


def test_what_is_neither_is_refused():
    with pytest.raises(BadInput, match="neither a mapping nor a line"):
        effects_of(3)  # type: ignore[arg-type]
    with pytest.raises(BadInput, match=r"'nowhere.toml' does not exist"):
        effects_of("nowhere.toml")
