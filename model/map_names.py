"""Which array of a file is which quantity of a flux map: names as bench and finite-element programs
write them.

Spellings of motulator, SyR-e (Id, Fd), MathWorks (idVec, fluxD), Motor-CAD (Id_Peak,
Flux_Linkage_D, Phase_Advance), JMAG (d-axis current, d-axis flux linkage), pyleecan (Id, Phi_d,
Tem_av) and FEMM scripts (lambda_d) are known; where two would do, the first of NAMES.  [flux_map]
may name any of them itself: i_d = "my column".
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from model.errors import BadInput, unknown
from model.units import KNOWN

NAMES = {  # accepted spellings of each quantity, in order of preference
    "i": ("i_s_dq",),
    "psi": ("psi_s_dq",),
    "i_d": ("i_d", "id", "id_map", "Id", "i_d_A"),
    "i_q": ("i_q", "iq", "iq_map", "Iq", "i_q_A"),
    "psi_d": ("psi_d_mean", "psi_d", "psid_map", "Fd", "Psi_d"),
    "psi_q": ("psi_q_mean", "psi_q", "psiq_map", "Fq", "Psi_q"),
    "torque": ("torque_mean", "torque", "tau", "T"),
}
OF_BOTH = ("i_d", "i_q", "psi_d", "psi_q")
CURRENT = "(?:stator|phase)?(?:current|curr?|is?)"
FLUX = "(?:stator)?(?:flux(?:linkages?)?|linkageflux(?:es)?|linkages?|psis?|f|phi|lambdas?|lam)"
MORE = "(?:vec|vector|map|grid|index|mean|av|avg|average|axis|peak|pk|amp|data|table|dq|lut|rms|dqh|linkages?)*"  # noqa: E501
D, Q = "(?:direct|d)(?:axis|ax)?", "(?:quadrature|q)(?:axis|ax)?"
PATTERNS = {  # of a name without blanks, units and signs between its letters, lower case
    **{
        quantity: re.compile(f"{what}{MORE}{axis}{MORE}|{axis}{what}{MORE}")
        for quantity, what, axis in (
            ("i_d", CURRENT, D),
            ("i_q", CURRENT, Q),
            ("psi_d", FLUX, D),
            ("psi_q", FLUX, Q),
        )
    },
    "torque": re.compile(
        "(?:(?:electromagnetic|em|shaft|airgap|mean|average)?torque|tau|te|tem|t)(?:mean|av|avg|average|em)*"
    ),
    "current": re.compile(
        "(?:stator|phase|line|motor)?(?:current|i|is)(?:phase|line)?(?:amplitude|magnitude|peak|pk|abs|amp|rms|max)*"
    ),
    "advance": re.compile(
        "(?:phase|current|lead)?(?:advance|beta|gamma|lead)(?:angle)?|current(?:phase(?:angle)?|angle)"
    ),
}
STATED = (*OF_BOTH, "torque", "current", "advance")  # keys of [flux_map] that name an array
GREEK = {"ψ": "psi", "λ": "lambda", "φ": "phi", "ϕ": "phi", "γ": "gamma", "β": "beta", "τ": "tau"}
UNIT_BEHIND = re.compile(r"[_ ]+(m?wb|uwb|m?vs|[mk]?a|arms|m?nm|deg|rad)$", re.IGNORECASE)
BEHIND = {
    "mwb": 1e-3,
    "uwb": 1e-6,
    "mvs": 1e-3,
    "ma": 1e-3,
    "ka": 1e3,
    "mnm": 1e-3,
    "deg": math.pi / 180.0,
}


class Column(NamedTuple):
    """An array's name in its file, and the factor to SI units and peak values that its name
    says."""

    name: str
    factor: float


def columns_of(
    names: Iterable[str], stated: Mapping[str, str], file: str
) -> dict[str, list[Column]]:
    """Return the arrays that each quantity may be, the likeliest first, by a file's names.

    stated: names by quantity, as [flux_map] gives them; BadInput where there is no such array.
    """
    there = list(names)
    out: dict[str, list[Column]] = {}
    for quantity in (*NAMES, *PATTERNS):
        if quantity in stated:
            if stated[quantity] not in there:
                raise BadInput(
                    f"[flux_map] {quantity}: {unknown(f'array of {file}', stated[quantity], there)}"
                )
            out[quantity] = [Column(stated[quantity], _factor(stated[quantity]))]
        elif quantity not in out:
            exact = [n for n in NAMES.get(quantity, ()) if n in there]
            pattern = PATTERNS.get(quantity)
            alike = [
                n for n in there if pattern and n not in exact and pattern.fullmatch(_plain(n))
            ]
            out[quantity] = [Column(n, _factor(n)) for n in (*exact, *alike)]
    return out


def _plain(name: str) -> str:
    """Return a name's letters and digits, without the unit behind it."""
    last = name.rpartition(".")[2]  # of a structure's field
    bare = re.sub(
        r"[\[(](?![dq](?:[ -]?axis)?[\])]).*?[\])]", "", last, flags=re.IGNORECASE
    ).strip()
    plain = UNIT_BEHIND.sub("", bare).lower()
    for letter, word in GREEK.items():
        plain = plain.replace(letter, word)
    return re.sub(r"[^a-z0-9]", "", plain)


def _factor(name: str) -> float:
    """Return the factor to SI units, peak values and rad that a name says; a unit in brackets is
    its reader's."""
    bracket = re.search(r"[\[(](.*?)[\])]", name)
    behind = UNIT_BEHIND.search(name)
    factor = BEHIND.get(behind[1].lower(), 1.0) if behind else 1.0
    read = bool(bracket) and bracket[1].strip() in KNOWN  # type: ignore[index]
    rms = "rms" in name.lower() and not (read and "rms" in bracket[1].lower())  # type: ignore[index]
    return factor * (math.sqrt(2.0) if rms else 1.0)
