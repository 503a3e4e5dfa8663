"""Thick cortex: the Stokes problems are solved with sympy and compared with the code."""

import numpy as np
import pytest
import sympy as sp

from amoeboid.closed_forms.thick_cortex import (
    Cortex,
    cylinder_stresses,
    cylinder_surface_stresses,
    cylinder_velocity,
    sphere_stresses,
    sphere_surface_stresses,
    sphere_velocity,
    surface_viscosities,
    thin_cylinder_error,
    thin_cylinder_stresses,
    thin_sphere_error,
    thin_sphere_stresses,
)
from amoeboid.validation import InvalidInput

r, R0, h, lam, mu, v_p = sp.symbols("r R0 h lambda mu v_p", positive=True)
NODES, WEIGHTS = np.polynomial.legendre.leggauss(60)
RNG = np.random.default_rng(7)
CASES = [
    {R0: a, h: a * t, lam: b, mu: m, v_p: v}
    for a, t, b, m, v in zip(
        RNG.uniform(0.5, 3, 6),
        RNG.uniform(0.02, 0.8, 6),
        [-0.3, 0.0, 0.4, 1.0, 2.0, 5.0],
        RNG.uniform(0.5, 2, 6),
        RNG.uniform(0.2, 2, 6),
        strict=True,
    )
]


def solve(dimension):
    """(velocity, radial, hoop, axial) from div sigma = 0 and the two boundary conditions."""
    v = sp.Function("v")
    velocity = v(r)
    divergence = velocity.diff(r) + (dimension - 1) * velocity / r

    def stresses(u, div):
        transverse = lam * div
        return transverse + 2 * mu * u.diff(r), transverse + 2 * mu * u / r, transverse

    radial, hoop, _ = stresses(velocity, divergence)
    # (div sigma)_r in cylindrical (one hoop direction) and spherical (two) coordinates.
    equation = radial.diff(r) + (dimension - 1) * (radial - hoop) / r
    general = sp.dsolve(sp.expand(equation), velocity).rhs
    C1, C2 = sp.symbols("C1 C2")
    div = general.diff(r) + (dimension - 1) * general / r
    traction = stresses(general, div)[0]
    conditions = [general.subs(r, R0) + v_p, traction.subs(r, R0 - h)]
    (constants,) = sp.solve(conditions, [C1, C2], dict=True)
    solution = general.subs(constants)
    div = sp.simplify(div.subs(constants))
    radial, hoop, flat = stresses(solution, div)
    return solution, radial, hoop, flat if dimension == 2 else hoop


@pytest.fixture(scope="module", params=[2, 3], ids=["cylinder", "sphere"])
def problem(request):
    dimension = request.param
    code = {
        2: (cylinder_velocity, cylinder_stresses, cylinder_surface_stresses,
            thin_cylinder_stresses, thin_cylinder_error),
        3: (sphere_velocity, sphere_stresses, sphere_surface_stresses,
            thin_sphere_stresses, thin_sphere_error),
    }[dimension]  # fmt: skip
    return dimension, solve(dimension), code


def cortex(case):
    return Cortex(R0=case[R0], h=case[h], lambda_3d=case[lam], mu_3d=case[mu], v_p=case[v_p])


def test_flow_and_stresses_solve_the_stokes_problem(problem):
    _, solution, (velocity, stresses, integrated, *_) = problem
    for case in CASES:
        thick = cortex(case)
        for share in (0.0, 0.3, 1.0):
            at = case[R0] - share * case[h]
            u, *sigma = (float(e.subs(case).subs(r, at)) for e in solution)
            found = stresses(thick, at)
            assert velocity(thick, at) == pytest.approx(u, rel=1e-12)
            assert (found.radial, found.hoop, found.axial) == pytest.approx(sigma, abs=1e-10)
        total = integrated(thick)
        radii = case[R0] - case[h] * (1 + NODES) / 2
        expected = [
            case[h] / 2 * WEIGHTS @ (sp.lambdify(r, e.subs(case), "numpy")(radii) + 0 * radii)
            for e in solution[1:]
        ]
        assert (total.radial, total.hoop, total.axial) == pytest.approx(expected, abs=1e-10)


def test_thin_limit_gives_the_surface_viscosities(problem):
    dimension, (_, radial, hoop, axial), (*_, thin, _) = problem

    def leading(stress):
        # d/dh of the integral at h = 0 is the stress on the outer face of a vanishing cortex.
        return sp.simplify(stress.subs(r, R0).subs(h, 0))

    assert leading(radial) == 0
    eta_s, eta_b = h * mu, 2 * h * lam * mu / (lam + 2 * mu)
    if dimension == 2:
        assert sp.simplify(h * leading(hoop) + v_p * (eta_b + 2 * eta_s) / R0) == 0
        assert sp.simplify(h * leading(axial) + v_p * eta_b / R0) == 0
    else:
        assert sp.simplify(h * leading(hoop) + 2 * v_p * (eta_b + eta_s) / R0) == 0
    for case in CASES:
        thick = cortex(case)
        derived = [float(e.subs(case)) for e in (eta_s, eta_b)]
        assert surface_viscosities(thick) == pytest.approx(derived, rel=1e-13)
        expected = [float((case[h] * leading(e)).subs(case)) for e in (hoop, axial)]
        assert (thin(thick).hoop, thin(thick).axial) == pytest.approx(expected, rel=1e-12)


def test_relative_error_of_the_thin_shell_has_the_derived_slope(problem):
    dimension, (_, _, hoop, _), (*_, thin_error) = problem
    t, y = sp.symbols("t y", positive=True)
    # exact/thin = 1 + slope t: the integral over the thickness, to second order in t = h/R0.
    integrand = hoop.subs({h: t * R0, r: R0 * (1 - t * y)})
    orders = [sp.simplify(sp.diff(integrand, t, k).subs(t, 0)) for k in (0, 1)]
    mean = [sp.integrate(sp.expand(order), (y, 0, 1)) for order in orders]
    slope = sp.simplify(mean[1] / mean[0])
    factor = {2: 3, 3: 5}[dimension]
    assert sp.simplify(slope - (factor * lam + 2 * mu) / (2 * (lam + 2 * mu))) == 0
    for case in CASES:
        ratios = []
        for share in (1e-3, 5e-4):
            thin = cortex({**case, h: share * case[R0]})
            error = float(thin_error(thin))
            ratios.append(abs(error / (-float(slope.subs(case)) * share) - 1))
        assert ratios[1] < 0.6 * ratios[0] < 0.01


def test_relative_error_of_the_paper_cell_is_a_few_percent():
    # h = 190 nm, R0 = 10 um: t = 0.019; lambda = 2 mu makes eta_b = eta_s.
    thick = Cortex(R0=10.0, h=0.19, lambda_3d=2.0, mu_3d=1.0)
    eta_s, eta_b = surface_viscosities(thick)
    assert eta_s == pytest.approx(eta_b)
    assert thin_cylinder_error(thick) == pytest.approx(-0.019, rel=0.03)
    assert thin_sphere_error(thick) == pytest.approx(-1.5 * 0.019, rel=0.05)


def test_arrays_broadcast():
    many = Cortex(R0=1.0, h=np.linspace(0.01, 0.5, 5), lambda_3d=[[0.5], [2.0]], mu_3d=1.0)
    errors = thin_sphere_error(many)
    assert errors.shape == (2, 5)
    single = Cortex(R0=1.0, h=0.5, lambda_3d=2.0, mu_3d=1.0)
    assert errors[1, 4] == pytest.approx(float(thin_sphere_error(single)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"h": 0.0}, "h must be > 0, got 0"),
        ({"h": 1.0}, "h must be < R0"),
        ({"mu_3d": 0.0}, "mu_3d must be > 0"),
        ({"lambda_3d": -1.0}, "lambda_3d must be >= -2 mu_3d/3, got -1"),
        ({"lambda_3d": float("nan")}, "lambda_3d must be finite"),
        ({"R0": "1"}, "R0 must be finite numbers"),
    ],
)
def test_bad_input_is_named(changes, message):
    good = {"R0": 1.0, "h": 0.1, "lambda_3d": 1.0, "mu_3d": 1.0}
    with pytest.raises(InvalidInput, match=message):
        Cortex(**{**good, **changes})


def test_points_outside_the_cortex_are_refused():
    with pytest.raises(InvalidInput, match="r must lie in"):
        cylinder_velocity(Cortex(R0=1.0, h=0.1, lambda_3d=1.0, mu_3d=1.0), 0.5)
