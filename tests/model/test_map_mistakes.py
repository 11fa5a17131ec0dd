"""A mistake planted in a flux map is named, and the map without it is left alone; one wild point is
named by its currents and its line.

The machine is that of `planted_map`: reciprocal, convex, even in i_q by its formula.
"""

import re

import numpy as np
import pytest

from model.errors import BadInput
from model.fluxmap import TURNS
from model.map_mistakes import check_points, wild_points
from model.map_points import MapPoints, read_points
from tests.data import real_data
from tests.model.planted_map import machine

COLUMNS = ("i_d", "i_q", "psi_d", "psi_q")


def columns(quadrant=False, n=9):
    """Columns of a map of both signs of i_q without the line i_d = 0, or of one quadrant."""
    d, q = (-12.0, 0.0), (0.0, 12.0) if quadrant else (-12.0, 12.0)
    d = d if quadrant else (-12.0, 3.0)
    i_d, i_q = (x.ravel() for x in np.meshgrid(np.linspace(*d, n), np.linspace(*q, n + 2)))
    return dict(zip(COLUMNS, (i_d, i_q, *machine(i_d, i_q)), strict=True))


def written(body, folder, names=None):
    """Write columns as CSV; the header is line 1."""
    head = ",".join(names or body)
    rows = np.stack(list(body.values()), axis=1)
    lines = "".join(",".join("" if np.isnan(x) else f"{x:.9g}" for x in row) + "\n" for row in rows)
    (folder / "m.csv").write_text(f"{head}\n{lines}")
    return folder / "m.csv"


def said(path, magnet="d", stated=None):
    points = read_points(path, magnet, 0.0, stated)
    try:
        check_points(points, magnet)
    except BadInput as error:
        return str(error)
    return ""


def exchanged(body, a, b):
    return {**body, a: body[b], b: body[a]}


CHANGES = {
    "psi_d and psi_q exchanged": lambda m: exchanged(m, "psi_d", "psi_q"),
    "i_d and i_q exchanged": lambda m: exchanged(m, "i_d", "i_q"),
    "i_q or psi_q counted the other way": lambda m: {**m, "psi_q": -m["psi_q"]},
    "i_d counted the other way": lambda m: {**m, "i_d": -m["i_d"]},
    "psi_d counted the other way": lambda m: {**m, "psi_d": -m["psi_d"]},
    "i_q in mA (write the unit into the header: i_q [mA])": lambda m: {**m, "i_q": 1e3 * m["i_q"]},
    "psi_q in mWb": lambda m: {**m, "psi_q": 1e3 * m["psi_q"]},
    'magnet = "-d" in [flux_map]': lambda m: {**m, "i_d": -m["i_d"], "psi_d": -m["psi_d"]},
    'magnet = "q" in [flux_map]': lambda m: exchanged(exchanged(m, "i_d", "i_q"), "psi_d", "psi_q"),
}
TWO = {"i_q in mA": "psi_d in mWb", "psi_q in mWb": "i_d in mA"}  # the map cannot tell these apart


@pytest.mark.parametrize("quadrant", [False, True])
@pytest.mark.parametrize("name", CHANGES)
def test_a_mistake_is_named_and_no_other(tmp_path, name, quadrant):
    found = said(written(CHANGES[name](columns(quadrant)), tmp_path))
    guesses = re.split(r": (?=is |are |does |do )", found)[1].split(", or ")
    assert name in guesses[0] + guesses[-1]
    other = next((b for a, b in TWO.items() if name.startswith(a)), "")
    assert len(guesses) == (2 if other else 1)
    assert other in found


@pytest.mark.parametrize("quadrant", [False, True])
def test_a_right_map_is_left_alone(tmp_path, quadrant):
    assert said(written(columns(quadrant), tmp_path)) == ""


def test_the_columns_are_called_as_in_the_file(tmp_path):
    """The remedy, written into [flux_map], is what reads the file right."""
    body = CHANGES["psi_d and psi_q exchanged"](columns())
    path = written(body, tmp_path, ["Id", "Iq", "Fd", "Fq"])
    found = said(path)
    assert 'are Fd and Fq exchanged (psi_d = "Fq" and psi_q = "Fd" in [flux_map] then)?' in found
    assert said(path, stated={"psi_d": "Fq", "psi_q": "Fd"}) == ""


def test_an_angle_counted_from_d_is_named(tmp_path):
    """Amplitude and angle from q towards -d: read right; the same angle from d: 90 degrees more."""
    size, angle = (x.ravel() for x in np.meshgrid(np.linspace(0.5, 12, 8), np.linspace(0, 90, 9)))
    psi = machine(-size * np.sin(np.radians(angle)), size * np.cos(np.radians(angle)))
    body = dict(zip(("current", "advance", "psi_d", "psi_q"), (size, angle, *psi), strict=True))
    path = written(body, tmp_path)
    assert said(path) == ""
    assert "in degrees, as it reaches 90" in " ".join(read_points(path).notes)
    turned = said(written({**body, "advance": angle + 90.0}, tmp_path))
    assert "is the currents' angle counted from d, not from q towards -d" in turned
    assert "counted the other way" in said(written({**body, "advance": -angle}, tmp_path))


@pytest.mark.parametrize("fill", [0.0, -1.0])
def test_a_value_that_stands_for_none_is_named(tmp_path, fill):
    body = columns(quadrant=True)
    outside = np.hypot(body["i_d"], body["i_q"]) > 13.0
    assert 0.05 < outside.mean() < 0.5
    filled = {n: np.where(outside, fill, body[n]) for n in ("psi_d", "psi_q")}
    found = said(written({**body, **filled}, tmp_path))
    assert f"do the points whose fluxes are {fill:g} and {fill:g} Wb hold no value" in found
    assert ", or " not in found
    empty = {n: np.where(outside, np.nan, body[n]) for n in ("psi_d", "psi_q")}
    assert said(written({**body, **empty}, tmp_path)) == ""


@pytest.mark.parametrize(
    ("name", "factor"), [("psi_d", 2.0), ("psi_q", -1.0), ("psi_q", 10.0), ("i_q", 10.0)]
)
def test_a_wild_point_is_named_by_its_line(tmp_path, name, factor):
    """Rows in any order, a comment and a blank line between them."""
    body = columns()
    order = np.random.default_rng(1).permutation(len(body["i_d"]))
    body = {n: x[order] for n, x in body.items()}
    row = int(np.flatnonzero(np.abs(body["i_q"]) > 5.0)[3])
    body[name][row] *= factor
    path = written(body, tmp_path)
    lines = path.read_text().splitlines()
    path.write_text("\n".join(["# a bench", *lines[:3], "", "# more", *lines[3:]]) + "\n")
    found = said(path)
    at = row + 2 + (1 if row < 2 else 3)
    assert f"(line {at})" in found
    assert found.count("(line") == 1
    assert lines[row + 1] == path.read_text().splitlines()[at - 1]


def test_a_wild_point_of_an_array_is_named_by_row_and_column(tmp_path):
    body = {n: x.reshape(11, 9) for n, x in columns().items()}
    body["psi_d"][4, 6] *= 2.0
    np.savez(tmp_path / "m.npz", **body)
    points = read_points(tmp_path / "m.npz")
    assert np.flatnonzero(wild_points(points)).tolist() == [4 * 9 + 6]
    assert "(row 5, column 7)" in said(tmp_path / "m.npz")


@pytest.mark.parametrize(
    ("file", "magnet"),
    [
        ("baldor_pmsyrm/baldor_meas.npz", "d"),
        ("brusa_hsm1/brusa_meas.npz", "d"),
        ("thor_fea/thor_fea.npz", "-q"),
        ("sew_map/LUT_SEW_jax_grad.mat", "d"),
    ],
)
def test_published_maps_are_right_on_their_own_axis_alone(file, magnet):
    path = real_data() / file
    assert said(path, magnet=magnet) == ""
    for other in set(TURNS) - {magnet}:
        assert f'magnet = "{magnet}" in [flux_map])?' in said(path, magnet=other)


def test_a_magnet_off_the_d_axis_is_seen_where_a_map_ends_at_no_current_along_q():
    """psi_q of 0.3 Wb at i_q = 0, the map's last column, and of 0.6 Wb at most."""
    i_d, i_q = np.linspace(-2.0, 2.0, 5), np.linspace(-2.0, 0.0, 5)
    x, y = np.meshgrid(i_d, i_q, indexing="ij")
    d, q = x.ravel(), y.ravel()
    with pytest.raises(BadInput, match="the magnet is not on the d axis"):
        check_points(MapPoints("mine", d, q, 0.1 * d, 0.3 + 0.1 * q, ()))
    check_points(MapPoints("mine", d, q, 0.1 * d, 0.1 * q, ()))
