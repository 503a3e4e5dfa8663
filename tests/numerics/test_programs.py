import numpy as np
import pytest

from amoeboid.axisymmetric.steady import homogeneous
from amoeboid.axisymmetric.system import SteadySystem
from amoeboid.model.parameters import Parameters
from amoeboid.numerics import array_machine, compiled_machine, machine
from amoeboid.numerics.derivatives import cos, sin, sqrt
from amoeboid.numerics.jacobians import recorded
from amoeboid.numerics.programs import Symbol

N = 5
RNG = np.random.default_rng(3)
SLOPE, MEAN = RNG.normal(size=(N, N)), RNG.normal(size=(1, N))
MAPS = {"a": (0, RNG.normal(size=(N, 3))), "b": (3, RNG.normal(size=(N, 4))),
        "size": (7, np.eye(1))}  # fmt: skip
SIZE = 8


def applied(relation, c):
    return c.relation(relation) if isinstance(c, Symbol) else relation(c, 0)[0]


def equations(fields, parameters):
    """Products of products, a field and a number; a function that is only known by its values."""
    a, b, size = fields["a"], fields["b"], fields["size"]
    height = SLOPE @ (sin(a) * size)
    ratio = cos(a) / (height * height + 2.0) - parameters.input("k") * b
    bent = SLOPE @ (ratio * applied(parameters.input("law"), b) - height**3)
    area = MEAN @ (height * size)
    return [bent / size + a, sqrt(b * b + 1.0) / 3.0, area - size, -bent * area]


class Given(dict):
    def input(self, name):
        return self[name]


def given(unknowns, k):
    fields = {name: matrix @ unknowns[first : first + matrix.shape[1]]
              for name, (first, matrix) in MAPS.items()}  # fmt: skip

    def law(c, order):
        return (np.exp(-c * k), -k * np.exp(-c * k))[: order + 1]

    return Given(fields | {"k": k, "law": law})


def residual(unknowns, k):
    here = given(unknowns, k)
    return np.concatenate(equations(here, here))


@pytest.fixture(params=[compiled_machine, array_machine], ids=["compiled", "arrays"])
def program(request, monkeypatch):
    """The recorded equations, run by either of the two forms of the loops."""
    monkeypatch.setattr(machine, "loops", lambda: request.param)
    return recorded(equations, N, SIZE, MAPS)


@pytest.mark.parametrize("k", [0.7, 0.7 + 0.2j])
def test_a_program_computes_what_the_function_it_was_recorded_from_does(program, k):
    x = RNG.normal(size=SIZE)
    found = program.residual(given(x, k), type(k))
    np.testing.assert_allclose(found, residual(x, k), rtol=1e-13, atol=1e-14)


def test_the_jacobian_of_a_program_is_that_of_complex_steps(program):
    x, step, scales = RNG.normal(size=SIZE), 1e-30, RNG.uniform(1.0, 2.0, 3 * N + 1)
    values, found = program.residual_and_jacobian(given(x, 0.7), scales)
    columns = [residual(x + 1j * step * e, 0.7).imag / step for e in np.eye(SIZE)]
    np.testing.assert_allclose(found, np.array(columns).T / scales[:, None], rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(values, residual(x, 0.7) / scales, rtol=1e-13, atol=1e-14)


def test_complex_unknowns_give_exact_second_derivatives(program):
    x, along, scales = RNG.normal(size=SIZE), RNG.normal(size=SIZE), np.ones(3 * N + 1)
    step = 1e-30
    moved = given(x + 1j * step * along, 0.7 + 0j)
    exact = program.residual_and_jacobian(moved, scales, complex)[1].imag / step

    def jacobian(y):
        return program.residual_and_jacobian(given(y, 0.7), scales)[1]

    h = 1e-5
    difference = (jacobian(x + h * along) - jacobian(x - h * along)) / (2 * h)
    np.testing.assert_allclose(exact, difference, rtol=1e-6, atol=1e-7)
    assert np.abs(exact).max() > 0.1


@pytest.mark.parametrize("kind", [float, complex])
def test_both_forms_of_the_loops_give_the_same_to_rounding(kind, monkeypatch):
    """On the equations of a cell, polarized and deformed."""
    p = Parameters(D=0.4, v_p0=6.0, gamma_t=0.1, kappa=0.02)
    system, rng = SteadySystem(p, 16, ("v_p0",)), np.random.default_rng(5)
    x = homogeneous(p, 16).x + 0.02 * system.scale * rng.normal(size=system.scale.size)
    x = x.astype(kind)
    if kind is complex:
        x += 0.01j * system.scale
    found = []
    for form in (compiled_machine, array_machine):
        monkeypatch.setattr(machine, "loops", lambda form=form: form)
        found.append(system.residual_and_jacobian(x, np.array([6.0], dtype=kind)))
    for one, other in zip(*found, strict=True):
        assert one.dtype == other.dtype == kind
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-13 * np.abs(one).max())


def test_the_installation_alone_chooses_the_loops(monkeypatch):
    for present, form in ((True, compiled_machine), (False, array_machine)):
        monkeypatch.setattr(machine, "has_numba", lambda present=present: present)
        assert machine.loops.__wrapped__() is form
