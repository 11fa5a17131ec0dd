"""What the names of columns mean: as people of several countries write them."""

import numpy as np
import pytest

from sandbox import check
from sandbox.public.campaigns.column_words import TABLE, meant
from sandbox.recordings.column_map import KIND

SAID = {
    "t": "t Time Zeit temps tempo tiempo 时间 log.Time",
    "theta": "Winkel Rotorlage Winkel_el θ_el angle Ángulo posición Posizione 电角度 Lage_ist",
    "i_a": "I_U Strom_U Ia i_a_ist Strom_L1 courant_a Corrente_A a相电流 Phasenstrom_U IL1",
    "i_b": "I_V StromV Ib i2 Current_B corriente_b",
    "i_d": "Id isd Id_ist d轴电流 I_d_meas",
    "i_q": "Iq I_q current Iq_act strom_q",
    "i_beta": "iβ I_beta",
    "u_a": "Ua va Spannung_U Spannung_U_soll",
    "u_d": "ud Ud_soll vd_ref U_d usd",
    "u_alpha": "Ualpha uα U_alpha_cmd",
    "u_dc": "Uzk U_ZK Zwischenkreisspannung Udc vbus DC_Link 母线电压 Uzk_ist",
    "d_b": "duty_b DutyB Tastgrad_V",
    "load_torque": "M_Last Lastmoment load_torque",
    "temperature": "Wicklungstemperatur",
}


@pytest.mark.parametrize("standard", SAID)
def test_names_in_several_languages(standard):
    names = SAID[standard].split()
    assert {n: meant(n, None) for n in names} == dict.fromkeys(names, (standard, ""))


@pytest.mark.parametrize(
    "name",
    [
        "Mode",
        "Uuv",
        "UV",
        "Iq_soll",
        "Ud_ist",
        "I_ref",
        "Drehmoment_soll",
        "speed",
        "u",
        "i",
        "",
        ".",
    ],
)
def test_what_could_be_another_quantity_is_left_to_the_user(name):
    """Line to line, wanted currents, measured voltages, a speed in any unit."""
    assert meant(name, None) is None


def test_a_speed_is_taken_with_its_unit():
    shaft = ', unit = "rpm", mechanical = true'
    assert meant("Drehzahl", None) == meant("Drehzahl_", None) == ("speed", shaft)
    assert meant("Drehzahl", "1/min") == ("speed", ", mechanical = true")
    assert meant("erpm", None) == ("speed", ', unit = "rpm"')
    assert meant("Vitesse", "rad/s") == ("speed", "")


def test_no_name_means_two_columns():
    names = list(TABLE)
    assert set(names) <= set(KIND)
    assert all(TABLE[a].isdisjoint(TABLE[b]) for k, a in enumerate(names) for b in names[:k])


def test_a_german_log_is_drafted_whole(tmp_path):
    """Semicolons, decimal commas, units in brackets: each column but the operator's own is
    found."""
    own = {
        "Zeit [ms]": "t",
        "Ualpha [V]": "u_alpha",
        "Ubeta [V]": "u_beta",
        "I_U [A]": "i_a",
        "I_V [A]": "i_b",
        "Strom W": "i_c",
        "Uzk": "u_dc",
        "Winkel [°]": "theta",
        "Drehzahl [1/min]": "speed",
        "M_Last": "load_torque",
        "Schicht": None,
    }
    rows = np.arange(40.0)[:, None] * np.arange(1.0, 1.0 + len(own))
    text = "\n".join(";".join(f"{x:.2f}".replace(".", ",") for x in row) for row in rows)
    (tmp_path / "versuch.csv").write_text(";".join(own) + "\n" + text + "\n", encoding="utf-8")
    draft = check(tmp_path).draft
    found = {line.split(" =")[0]: line for line in draft.splitlines() if "= {column" in line}
    assert set(found) == {name for name in own.values() if name}
    assert 'column = "Winkel"}  # °, as the table says' in found["theta"]
    assert found["t"].endswith("# ms, as the table says")
    assert found["speed"].endswith("mechanical = true}  # 1/min, as the table says")
    assert found["i_c"].endswith("}")  # states none, and needs none
    assert "# [flux_map]" in draft
