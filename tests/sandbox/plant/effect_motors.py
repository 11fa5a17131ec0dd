"""Small motors and a converter on which effects have closed forms, for the exact plant and the
switched bench."""

import dataclasses
import math

import numpy as np

from model.parameters import Converter, Motor

L, R, U, TS = 0.05, 10.0, 400.0, 250e-6
LINEAR = Motor("linear", 4, R, 0.1, L, L, 1e-3, 2.0, 1.0, 1000.0)
NO_MAGNET = dataclasses.replace(LINEAR, magnet_flux=0.0)
IPM = Motor("ipm", 6, 12.0, 0.1, 0.09, 0.045, 1e-3, 1.2, 1.0, 1000.0, 7.7, 5.35, 19.4, 22.2, 6.6)
CONVERTER = Converter(TS, U, 0.0, 0.0)


def signs(i):
    """Return the vector of the three legs' current signs: amplitude 4/3."""
    a, b, c = i.real, -i.real / 2 + math.sqrt(0.75) * i.imag, -i.real / 2 - math.sqrt(0.75) * i.imag
    return (2 * np.sign(a) - np.sign(b) - np.sign(c)) / 3 + 1j * (
        np.sign(b) - np.sign(c)
    ) / math.sqrt(3)


def vector(out):
    """Return the vector (A) of three phase currents i_a, i_b, i_c by name."""
    return (2 * out["i_a"] - out["i_b"] - out["i_c"]) / 3 + 1j * (
        out["i_b"] - out["i_c"]
    ) / np.sqrt(3)
