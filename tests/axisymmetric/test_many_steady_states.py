"""States of many cells side by side; JAX is an optional package."""

import pickle
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from importlib.util import find_spec

import numpy as np
import pytest

import amoeboid as am
from amoeboid.axisymmetric.many import Table, solved
from amoeboid.axisymmetric.search import steady_solutions
from amoeboid.axisymmetric.steady import homogeneous, steady_state
from amoeboid.axisymmetric.system import SteadySystem
from amoeboid.axisymmetric.unknowns import resampled

pytestmark = pytest.mark.skipif(
    find_spec("jax") is None, reason="JAX is not installed: pip install 'amoeboid[gpu]'"
)

# five cells at a time in two lanes, so that all of these tests use the same compiled functions
COMPILED = {"max_modes": 32, "chunk": 2, "progress": False}


def difference(state, other):
    """Largest difference of two states in units of each unknown of the second one."""
    n = max(state.n, other.n)
    a, b = (resampled(s.x, s.n, n) for s in (state, other))
    sizes = np.repeat([1.0, other.max_retrograde_speed, 3.0, 1.0, 150.0], [n - 1, n, n, 1, 1])
    return float(np.abs((a - b)[:-2] / sizes).max())


def fastest(p):
    """The fastest state on the branch of l = 1, found by the solver for one cell."""
    return steady_solutions(p, degrees=(1,))[-1]


def with_as_many_modes(state, other):
    """The state that the solver for one cell finds from `other`, with the modes of `state`."""
    guess = replace(other, n=state.n, x=resampled(other.x, other.n, state.n))
    return steady_state(state.parameters, guess)


@pytest.fixture(scope="module")
def few():
    """A subcritical and a supercritical cell, one at rest, one below its fold, one next to it.

    More cells than lanes: each lane takes the next cell when it is done.
    """
    return am.many_steady_states(
        am.points(am.Parameters(), D=[0.4, 0.4, 0.4, 0.4, 0.1], v_p0=[6.1, 4.0, 5.2, 5.2097, 5.0]),
        **COMPILED,
    )  # fmt: skip


def test_states_side_by_side_are_those_of_one_at_a_time(few):
    assert few.status.tolist() == ["converged", "sphere", "sphere", "converged", "converged"]
    for k in (0, 3, 4):
        state = few.state(k)
        other = fastest(state.parameters)
        assert difference(state, with_as_many_modes(state, other)) < 1e-9
        assert few["c_rear"][k] == pytest.approx(other.c_rear, rel=1e-8)


@pytest.mark.slow
def test_states_do_not_depend_on_the_number_of_lanes(few):
    other = am.many_steady_states(few.points, progress=False, max_modes=32)
    assert other.status.tolist() == few.status.tolist()
    for name in ("c_rear", "max_retrograde_speed", "zeta0"):
        np.testing.assert_allclose(other[name], few[name], rtol=1e-10)


def test_progress_ends_with_all_cells(few):
    told = []
    solved(few.points, None, 32, 32, 2, lambda done, of: told.append((done, of)))
    assert [done for done, _ in told] == sorted(done for done, _ in told)
    assert told[-1] == (5, 5)


def test_departure_of_cells_is_the_null_vector_of_the_jacobian_at_the_threshold():
    """The critical mode in closed form, against the equations; friction moves the axial force."""
    n, D = 16, [0.1, 0.4]
    table = Table.made(am.points(am.Parameters(gamma_t=0.2, gamma_n=0.1), D=D))
    for k in range(len(D)):
        p = table.of.parameters(k).replace(v_p0=float(table.threshold[k]))
        system = SteadySystem(p, n)
        matrix = system.jacobian(homogeneous(p, n).x, np.zeros(0)) * system.scale
        departure = np.zeros(3 * n + 3)
        departure[[n - 1, 2 * n]] = table.cells.departure[k]
        departure[-2] = -(matrix @ departure) @ matrix[:, -2] / (matrix[:, -2] @ matrix[:, -2])
        assert np.abs(matrix @ departure).max() < 1e-12


def test_every_cell_without_a_state_says_why(few):
    assert "no other state here" in few.reason(1)
    assert few.reason(0) == ""
    assert not few.state(1).converged
    assert np.isnan(few["max_retrograde_speed"][1])
    assert few.state(1).message == few.reason(1)


def test_many_states_show_themselves_and_are_kept(few):
    assert repr(few) == "ManySteadyStates(5 cells: 3 converged, 2 sphere)"
    again = pickle.loads(pickle.dumps(few))  # noqa: S301  (our own)
    np.testing.assert_array_equal(again["c_rear"], few["c_rear"])
    assert few.states()[4].parameters == am.Parameters(D=0.1, v_p0=5.0)


def test_a_table_of_many_states_has_status_and_parameters(few):
    pytest.importorskip("xarray")
    table = few.to_xarray()
    assert table["status"].values.tolist() == few.status.tolist()
    np.testing.assert_array_equal(table["D"], [0.4, 0.4, 0.4, 0.4, 0.1])
    assert table.attrs["beta"] == 1.0


def test_cells_that_come_to_the_sphere_from_a_start_are_told_as_such():
    p = am.Parameters(D=0.4)
    found = am.many_steady_states(
        am.points(p, v_p0=[3.0, 4.0, 4.5, 5.0, 7.0]), start=homogeneous(p), **COMPILED
    )  # fmt: skip
    assert found.status.tolist() == ["sphere"] * 5
    assert "the start led back to the sphere" in found.reason(0)


def test_the_precision_of_the_users_own_arrays_stays(few):
    import jax

    assert jax.numpy.ones(3).dtype == np.float32


def test_laws_that_branch_on_numbers_are_refused():
    def stepped(c, v_p0, c_r):
        return v_p0 if np.all(c < c_r) else v_p0 * np.exp(-c)

    with pytest.raises(am.InvalidInput, match="must consist of arithmetic and NumPy functions"):
        am.many_steady_states(
            am.points(am.Parameters(law=stepped), v_p0=[6.0]), start=fastest(
                am.Parameters(D=0.4, v_p0=6.1)
            ), progress=False,
        )  # fmt: skip


def cell_with_law(factor):
    """A cell with a law that has the name of another one."""

    def hill(c, v_p0, c_r):
        return v_p0 / (1 + factor * c / c_r)

    return am.Parameters(law=hill)


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        ([am.Parameters(), am.Parameters(law="inverse")], "compute each law separately"),
        ([cell_with_law(1.0), cell_with_law(2.0)], "compute each law separately"),
        ([am.Parameters(), am.Parameters.physical()], "physical units or none, got both"),
    ],
)
def test_cells_of_two_laws_and_with_and_without_units_are_refused(cells, message):
    with pytest.raises(am.InvalidInput, match=message):
        am.many_steady_states(cells)


def test_cells_with_units_of_their_own_are_computed_in_those_of_the_first():
    small, large = (
        am.Parameters.physical(
            R0=f"{10 * k} um", delta_P=f"{300 / k} Pa", D=f"{4 * k**2} um^2/s", v_p0=f"{3 * k} um/s"
        )
        for k in (1, 2)
    )
    assert small.value("v_p0") == large.value("v_p0")  # each in its own units
    found = am.many_steady_states([small, large] * 2 + [small], **COMPILED)
    speeds = found["max_retrograde_speed"]
    assert speeds[1] == pytest.approx(2 * speeds[0], rel=1e-9)
    assert speeds[::2] == pytest.approx(speeds[0], rel=1e-9)


@pytest.mark.slow
def test_200_random_cells_agree_with_one_at_a_time():
    """Those without a state too: at rest, or with more modes than were allowed."""
    rng = np.random.default_rng(7)
    cells = am.points(
        am.Parameters(), D=rng.uniform(0.08, 0.6, 200), v_p0=rng.uniform(3.5, 8.0, 200),
        delta_P=10 ** rng.uniform(1.5, 3.0, 200), beta=rng.uniform(0.7, 1.5, 200),
    )  # fmt: skip
    found = am.many_steady_states(cells, max_modes=64, progress=False)
    counts = {word: int(np.sum(found.status == word)) for word in set(found.status)}
    assert counts.keys() <= {"converged", "sphere", "unresolved"}
    assert counts["converged"] > 100
    for state, status in zip(found.states(), found.status, strict=True):
        other = fastest(state.parameters)
        assert (other.max_retrograde_speed > 0) == (status != "sphere")
        if status == "converged":
            assert difference(state, with_as_many_modes(state, other)) < 1e-9
        elif status == "unresolved":
            assert other.n > 64


@pytest.mark.slow
def test_a_law_of_the_user_and_friction_side_by_side_as_one_at_a_time():
    def hill(c, v_p0, c_r, n=2.0):
        return v_p0 / (1.0 + np.exp(n * np.log(c / c_r)))

    p = am.Parameters(D=0.3, gamma_t=0.2, gamma_n=0.1, law=hill)
    cells = am.points(p, v_p0=[4.8, 5.0, 5.2], **{"law.n": [2.0, 2.1, 2.2]})
    found = am.many_steady_states(cells, progress=False)
    assert np.any(found.converged)
    for state in found.states():
        other = fastest(state.parameters)
        assert (other.max_retrograde_speed > 0) == state.converged
        if state.converged:
            assert difference(state, with_as_many_modes(state, other)) < 1e-9
            assert state.defects[0] != 0.0  # the drag on the moving frame


def test_cells_with_and_without_friction_are_refused_together():
    with pytest.raises(am.InvalidInput, match="must have friction"):
        am.many_steady_states(am.points(am.Parameters(), gamma_t=[0.0, 0.1]), progress=False)


def test_observables_of_many_states_show_progress(few, monkeypatch):
    """They take longer than the states on an accelerator."""
    shown = []

    @contextmanager
    def at_once(after):
        yield lambda parts: shown.append(parts[0])

    monkeypatch.setattr("amoeboid.studies.many.shown_line", at_once)
    few.__dict__.pop("_known", None)
    few["reduced_volume"]
    assert shown == ["reduced_volume: 0 of 3 states"]


# As the solver of a sweep: how it is asked for is tested in sweeps/test_side_by_side.py.
GRID = {"D": [0.4, 0.1], "v_p0": [4.0, 6.1]}
MANY = partial(am.many_steady_states, max_modes=32, chunk=2)


@pytest.fixture(scope="module")
def swept():
    """Cells at rest, polarized, and with more modes than are allowed; and one that cannot be."""
    return am.sweep(am.grid(D=[*GRID["D"], -1.0], v_p0=GRID["v_p0"]), MANY)


def test_states_of_a_sweep_are_those_of_many_steady_states(swept):
    D, v_p0 = np.meshgrid(GRID["D"], GRID["v_p0"], indexing="ij")
    many = am.many_steady_states(am.points(am.Parameters(), D=D, v_p0=v_p0), **COMPILED)
    for name in ("max_retrograde_speed", "c_rear", "zeta0"):
        np.testing.assert_allclose(swept[name].sel(D=GRID["D"]), many[name], rtol=1e-9)
    assert swept["max_retrograde_speed"].attrs["units"] == "L/T"
    assert swept["modes"].sel(D=0.4, v_p0=6.1) == 32


def test_statuses_and_reasons_of_lanes_are_those_of_points(swept):
    assert swept["status"].values.tolist() == [["ok", "ok"], ["ok", "failed"], ["failed"] * 2]
    assert swept["state"].values.tolist() == [["sphere", "polarized"], ["polarized", ""], ["", ""]]
    assert "no other state here" in str(swept["why"].sel(D=0.4, v_p0=4.0).values)
    assert "unresolved: the series of 32 modes" in str(swept["why"].sel(D=0.1, v_p0=6.1).values)
    assert "D must be a finite number" in str(swept["why"].sel(D=-1.0, v_p0=4.0).values)


@pytest.mark.slow
def test_cells_that_cannot_be_side_by_side_are_computed_in_turns():
    p = am.Parameters(D=0.4, v_p0=6.1)
    rows = am.sweep([p, p.replace(gamma_t=0.1), p.replace(D=0.41)], MANY)
    assert rows["status"].values.tolist() == ["ok"] * 3
    alone = am.sweep([p], MANY)
    assert rows["c_rear"].values[0] == pytest.approx(alone["c_rear"].values[0], rel=1e-9)
