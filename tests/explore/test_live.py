"""The cell beside the page, without a page: it is a run like any other, and can be made again."""

import json
import struct
from itertools import pairwise

import numpy as np
import pytest

import amoeboid as am
from amoeboid.explorer.lines import made_again, python_lines
from amoeboid.explorer.live import LiveCell
from amoeboid.explorer.point import InvalidField, parameters_of
from amoeboid.explorer.presets import PRESETS
from amoeboid.explorer.recipe import ELONGATED, NOISE, POLARIZATION, SURFACE, TURNED, Recipe
from amoeboid.observables import polarization

P = am.Parameters(D=0.4, v_p0=6.0)


def lived(recipe, acts=(), until=1.0):
    """A live cell to which `acts` (t, function of it) are done, at a time after `until`."""
    cell, acts = LiveCell(recipe), list(acts)
    while cell.step.state.t < until:
        while acts and cell.step.state.t >= acts[0][0]:
            acts.pop(0)[1](cell)
        cell.pass_time(0.05)
    return cell


def played_with(start=POLARIZATION, p=P):
    acts = [
        (0.2, lambda cell: cell.change_to(cell.recipe.parameters.replace(v_p0=1.2 * p.v_p0))),
        (0.4, lambda cell: cell.poke((1.0, 0.2, 0.0), 0.8)),
        (0.45, lambda cell: cell.change_to(cell.recipe.parameters.replace(D=2 * p.D))),
    ]
    return lived(Recipe(p, subdivisions=1, start=start, seed=3), acts)


@pytest.mark.parametrize(
    "start",
    [
        pytest.param(NOISE, marks=pytest.mark.slow),
        pytest.param(POLARIZATION, marks=pytest.mark.slow),
        TURNED,
        pytest.param(ELONGATED, marks=pytest.mark.slow),
    ],
)
def test_what_was_seen_is_made_again_bit_for_bit(start):
    cell = played_with(start)
    again = made_again(cell.recipe, cell.step.state.t)
    assert again.status == "finished"
    assert again.last.number == cell.step.number
    assert np.array_equal(again.last.state.c, cell.step.state.c)
    assert np.array_equal(again.last.state.r, cell.step.state.r)
    assert len(cell.recipe.pokes) == (2 if start == TURNED else 1)
    assert set(cell.recipe.jumps) == {"v_p0", "D"}


@pytest.mark.parametrize("p", [P, am.Parameters.physical(v_p0="2 um/s")], ids=["plain", "physical"])
def test_the_python_lines_repeat_what_was_seen(p, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    cell = played_with(NOISE, p)
    names = {}
    exec(python_lines(cell.recipe, cell.step.state.t), names)  # noqa: S102
    found = names["solution"].last.state
    # a quantity is printed with 6 digits
    assert np.allclose(found.c, cell.step.state.c, rtol=0 if p is P else 1e-4, atol=0)
    assert am.load(tmp_path / "seen-in-the-explorer").final.t == names["solution"].final.t


def test_a_surface_from_a_file_is_a_start(tmp_path):
    final = am.simulate(P, mesh=am.Icosphere(2), until=am.time(0.1)).final
    path = tmp_path / "cell.obj"
    lines = [f"v {x} {y} {1.3 * z}" for x, y, z in final.r]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in final.faces]
    path.write_text("\n".join(lines))
    cell = LiveCell(Recipe(P, subdivisions=2, start=SURFACE, surface=str(path)))
    extent = np.ptp(cell.step.cell.x, axis=0)
    assert extent[2] / extent[0] == pytest.approx(1.3, rel=0.01)
    with pytest.raises(am.InvalidInput, match="needs a file"):
        Recipe(P, start=SURFACE)


def test_a_frame_is_the_cell_at_the_time_that_is_shown():
    cell = lived(Recipe(P, subdivisions=1, start=POLARIZATION))
    frame = cell.frame()
    (length,) = struct.unpack("<I", frame[:4])
    header, rest = json.loads(frame[4 : 4 + length]), frame[4 + length :]
    assert [name for name, *_ in header["arrays"]] == ["x", "c", "flow", "faces"]
    assert header["t"] == pytest.approx(cell.shown_t)
    shapes = {name: shape for name, shape, _ in header["arrays"]}
    x = np.frombuffer(rest[: 12 * 42], "<f4").reshape(shapes["x"])
    assert np.linalg.norm(x, axis=1) == pytest.approx(1.0, abs=0.05)
    faces = np.frombuffer(rest[-12 * 80 :], "<u4").reshape(shapes["faces"])
    assert np.array_equal(faces, cell.step.cell.faces)
    header_again = cell.frame()
    assert b"faces" not in header_again  # they are sent once
    cell.show_all()
    assert b"faces" in cell.frame()


@pytest.mark.slow
def test_a_cell_polarizes_above_the_threshold_and_not_below():
    above, below = (
        lived(Recipe(P.replace(v_p0=v), subdivisions=1, start=NOISE), until=8.0) for v in (9.0, 3.0)
    )
    assert am.observed(above.step.cell, ["polarity"])["polarity"] > 0.3
    assert am.observed(below.step.cell, ["polarity"])["polarity"] < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("name", ["circling", "helix"])
def test_the_presets_that_circle_do_so_within_ten_units_of_time(name):
    preset = next(preset for preset in PRESETS if preset.name == name)
    p = parameters_of(preset.units, preset.values)
    recipe = Recipe(p, subdivisions=2, start=preset.start)
    axes = []
    cell = LiveCell(recipe)
    for t in (2.0, 6.0, 10.0):
        while cell.step.state.t < t:
            cell.pass_time(0.1)
        axis = polarization(cell.step.cell)
        axes.append(axis / np.linalg.norm(axis))
    turned = [np.degrees(np.arccos(a @ b)) for a, b in pairwise(axes)]
    assert turned[1] > 20.0  # it goes on turning long after the poke; a circle takes 33


@pytest.mark.slow
@pytest.mark.parametrize(("name", "least", "most"), [("circling", 0.0, 0.05), ("helix", 0.5, 0.6)])
def test_the_path_of_the_preset_has_the_torsion_of_its_name(name, least, most):
    """Torsion over curvature: 0 for a circle; 0.55 for the helix of docs/large-deformation.md."""
    preset = next(preset for preset in PRESETS if preset.name == name)
    p = parameters_of(preset.units, preset.values)
    cell = LiveCell(Recipe(p, subdivisions=2 if name == "helix" else 3, start=preset.start))
    times, places = [], []
    while cell.step.state.t < 45.0:
        cell.pass_time(0.1)
        if not times or cell.step.state.t > times[-1]:
            times.append(cell.step.state.t)
            places.append(np.array(cell.step.state.position))
    assert not cell.problem
    late = np.array(times) > 30.0
    t, x = np.array(times)[late], np.array(places)[late]
    fit = [
        np.polynomial.Polynomial.fit(t, column, 6 if name == "circling" else 14) for column in x.T
    ]
    middle = np.linspace(t[0] + 3.0, t[-1] - 3.0, 10)
    v, a, j = (np.stack([f.deriv(n)(middle) for f in fit], axis=1) for n in (1, 2, 3))
    normal = np.cross(v, a)
    torsion = np.sum(normal * j, axis=1) / np.sum(normal**2, axis=1)
    curvature = np.linalg.norm(normal, axis=1) / np.linalg.norm(v, axis=1) ** 3
    found = np.abs(np.mean(torsion / curvature))
    assert least <= found < most


def test_a_pause_stops_time():
    cell = lived(Recipe(P, subdivisions=1))
    cell.paused = True
    t = cell.shown_t
    cell.pass_time(1.0)
    assert cell.shown_t == t


def test_the_time_that_is_shown_follows_the_pace():
    cell = LiveCell(Recipe(P, subdivisions=1))
    cell.pace = 2.0
    rate = P.rate
    for _ in range(40):
        cell.pass_time(0.02)
    assert cell.shown_t * rate == pytest.approx(40 * 0.02 * 2.0, rel=0.2)
    assert cell.shown_t <= cell.step.state.t


@pytest.mark.parametrize(
    ("act", "rule"),
    [
        (lambda cell: cell.poke("up", 1), "three numbers"),
        (lambda cell: cell.poke((0, 0, 0), 1), "not zero"),
        (lambda cell: cell.poke((0, 0, 1), 99), "-1 to 5"),
        (lambda cell: cell.change_to(P.replace(law="inverse")), "law must stay"),
    ],
)
def test_what_a_live_cell_does_not_take_is_refused_with_the_rule(act, rule):
    cell = LiveCell(Recipe(P, subdivisions=1))
    with pytest.raises(am.InvalidInput, match=rule):
        act(cell)


def test_changes_are_bounded():
    recipe = Recipe(P, subdivisions=1)
    with pytest.raises(am.InvalidInput, match="at most 300 changes"):
        for k in range(400):
            recipe = recipe.changed_to(P.replace(v_p0=5 + 0.001 * (k % 7)), 0.1 * k)


def test_a_change_before_the_last_one_acts_replaces_it():
    recipe = Recipe(P).changed_to(P.replace(v_p0=5.0), 1.0).changed_to(P.replace(v_p0=4.0), 1.0)
    ((_, value),) = recipe.jumps["v_p0"]
    assert value == 4.0


def test_values_with_other_units_of_the_cell_are_converted():
    cell = am.Parameters.physical()
    faster = am.Parameters.physical(beta="0.2 1/s".replace(" 1", " * 1"))
    recipe = Recipe(cell).changed_to(faster, 0.0)
    assert set(recipe.jumps) == {"beta"}
    assert recipe.jumps["beta"][0][1] == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("units", "values", "field", "rule"),
    [
        ("simulation", {"D": "-1"}, "D", "finite number >= 0"),
        ("simulation", {"D": 0.4, "v_p0": "fast"}, "v_p0", "must be a number"),
        ("simulation", {"Q": 1}, "Q", "unknown parameter"),
        ("physical", {"D": "3 kg"}, "D", "dimension"),
        ("physical", {"beta": 0.2, "eta_s": "nan"}, "eta_s", "eta_s"),
        ("simulation", {"law": "__import__('os')"}, "law", "law"),
        ("simulation", {"D": True}, "D", "a number or a text"),
        ("simulation", {"D": [1]}, "D", "a number or a text"),
        ("feet", {}, "units", "one of simulation, physical"),
        ("simulation", [], "", "names and values"),
    ],
)
def test_a_wrong_value_is_refused_with_the_rule_and_its_field(units, values, field, rule):
    with pytest.raises(InvalidField, match=rule) as refused:
        parameters_of(units, values)
    assert refused.value.name == field


def test_a_number_without_a_unit_is_in_the_customary_one():
    assert parameters_of("physical", {"v_p0": 2, "beta": "0.1", "c0": "1370"}) == parameters_of(
        "physical", {"v_p0": "2 um/s"}
    )
