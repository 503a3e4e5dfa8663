import numpy as np

from amoeboid.numerics.derivatives import Dual, cos, sin, stacked


def expression(x, matrix):
    y = sin(x) / (2.0 + cos(x) * x) - 3.0 / (x * x + 1.0)
    return stacked([matrix @ y, -y + 0.5 * x, (1.0 - x) / 4.0 * np.arange(1.0, 4.0)])


def test_a_dual_carries_the_derivative_that_a_complex_step_gives():
    rng = np.random.default_rng(1)
    matrix, x = rng.normal(size=(2, 3)), rng.normal(size=3)
    dual = expression(Dual(x, np.eye(3)), matrix)
    step = 1e-30
    columns = [expression(x + 1j * step * e, matrix).imag / step for e in np.eye(3)]
    np.testing.assert_allclose(dual.derivatives, np.array(columns).T, rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(dual.values, expression(x, matrix), rtol=1e-15)
