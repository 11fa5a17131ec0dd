"""Names of columns as programs and people write them in several languages, and what they mean."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable

from model.units import UNITS
from sandbox.recordings.column_map import KIND

GREEK = {"α": "alpha", "β": "beta", "θ": "theta", "ϑ": "theta", "φ": "phi", "ϕ": "phi"}
WORDS = {  # of a quantity, folded; English, German, French, Italian, Spanish, Chinese
    "t": (
        *("t", "time", "timestamp", "times", "zeit", "zeitstempel"),
        *("temps", "tempo", "tiempo", "时间"),
    ),
    "theta": (
        *("theta", "position", "pos", "angle", "posestimate", "rotorposition", "phi"),
        *("rotorangle", "thetael", "thetae", "encoder", "winkel", "rotorwinkel", "lage"),
        *("rotorlage", "lagewinkel", "drehwinkel", "winkelel", "drehgeber", "angolo"),
        *("posizione", "angulo", "posicion", "角度", "位置", "电角度", "转子位置", "转角"),
    ),
    "hall": ("hall", "hallstate", "hallstates"),
    "steps": ("tachometer", "tacho"),
    "i_d": ("idmeasured",),
    "i_q": ("iqmeasured", "current"),
    "u_dc": (
        *("udc", "vdc", "vbus", "ubus", "vbusvoltage", "busvoltage", "dcbusvoltage", "dclink"),
        *("dclinkvoltage", "dcbus", "vsupply", "link", "uzk", "uzwk", "zwischenkreis"),
        *("zwischenkreisspannung", "spannungzk", "zkspannung", "spannungzwischenkreis"),
        *("tensionbus", "bustension", "tensionebus", "母线电压", "直流母线电压"),
    ),
    "load_torque": (
        *("loadtorque", "torqueload", "tload", "mload", "mlast", "lastmoment", "couplecharge"),
        *("coppiacarico", "parcarga", "负载转矩"),
    ),
    "temperature": ("temperature", "temperatur", "wicklungstemperatur", "temperatura", "温度"),
}
REVOLUTIONS = {  # of which the name alone tells rpm: of the shaft, and electrical
    True: ("drehzahl", "转速"),
    False: ("erpm",),
}
SPEEDS = (  # in any unit: taken where the table states one
    *("speed", "velocity", "omega", "rpm", "geschwindigkeit", "winkelgeschwindigkeit"),
    *("vitesse", "velocita", "velocidad", "速度"),
)
STEMS = {  # what stands before or behind a phase or an axis
    "i": (
        *("i", "is", "strom", "phasenstrom", "current", "phasecurrent", "courant"),
        *("corrente", "corriente", "电流", "相电流"),
    ),
    "u": ("u", "us", "v", "spannung", "voltage", "tension", "tensione", "电压", "相电压"),
    "d": ("d", "duty", "dutycycle", "tastgrad", "tastverhaltnis", "占空比"),
}
ENDS = {
    "a": ("a", "u", "1", "l1", "phasea", "phaseu", "phase1"),
    "b": ("b", "v", "2", "l2", "phaseb", "phasev", "phase2"),
    "c": ("c", "w", "3", "l3", "phasec", "phasew", "phase3"),
    "d": ("d", "daxis", "dachse", "d轴"),
    "q": ("q", "qaxis", "qachse", "q轴"),
    "alpha": ("alpha",),
    "beta": ("beta",),
}
# uv, vw, wu are voltages from line to line; du, d1, dd are no usual names of duties
SHORT = {"u": ("a", "b", "c", "1", "2", "3", "l1", "l2", "l3"), "d": ("a", "b", "c")}
MEASURED = ("istwert", "ist", "measured", "meas", "actual", "act", "mesure", "实际", "反馈")
COMMANDED = ("sollwert", "soll", "ref", "command", "cmd", "setpoint", "consigne", "给定")


def folded(name: str) -> str:
    """Return a name without path, case, accents, blanks and signs; Greek letters are written
    out."""
    name = name.strip().rstrip(".").rpartition(".")[2].casefold()
    text = "".join(GREEK.get(c, c) for c in unicodedata.normalize("NFKD", name))
    return "".join(c for c in text if c.isalnum())


def _joined(quantity: str, axis: str) -> set[str]:
    """Return the names of a quantity's phase or axis: its stems before and behind its ends."""
    names = set[str]()
    for stem in STEMS[quantity]:
        few = SHORT.get(quantity) if len(stem) == 1 and len(axis) == 1 and axis in "abc" else None
        ends = [e for e in ENDS[axis] if few is None or e in few]
        names |= {stem + e for e in ends}
        names |= {e + stem for e in ends if len(stem) > 2 or not stem.isascii()}
    return names


def _table() -> dict[str, frozenset[str]]:
    """Return every known folded name by standard column."""
    table = {name: set(words) for name, words in WORDS.items()}
    for quantity, axes in (("i", ENDS), ("u", ENDS), ("d", "abc")):
        for axis in axes:
            table.setdefault(f"{quantity}_{axis}", set()).update(_joined(quantity, axis))
    return {name: frozenset(words) for name, words in table.items()}


TABLE = _table()


def _without(plain: str, words: Iterable[str]) -> str:
    """Return a folded name without the first of some words at its end or begin."""
    for word in words:
        if plain != word and plain.endswith(word):
            return plain.removesuffix(word)
        if plain != word and plain.startswith(word):
            return plain.removeprefix(word)
    return plain


def meant(name: str, unit: str | None) -> tuple[str, str] | None:
    """Return the standard column that a name means and what an entry says beside the column's
    name; None for a name that is not known. unit: what the table states."""
    plain = folded(name)
    for shaft, turns in REVOLUTIONS.items():
        if plain in turns:
            stated = "" if unit in UNITS["speed"] else ', unit = "rpm"'
            return "speed", stated + (", mechanical = true" if shaft else "")
    if plain == "rpm" or (plain in SPEEDS and unit in UNITS["speed"]):
        return "speed", ""
    for standard, words in TABLE.items():
        asked = KIND[standard] in ("voltage", "duty") and standard != "u_dc"
        suffixes = COMMANDED if asked else MEASURED
        if plain in words or _without(plain, suffixes) in words:
            return standard, ""
    return None
