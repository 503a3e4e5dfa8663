"""The picture of the way of a cell."""

import numpy as np
import pytest
from matplotlib.image import imread

from amoeboid.plotting.trajectory import along_principal_axes, save_trajectory_picture


def helix(turns=3.0):
    t = np.linspace(0, 2 * np.pi * turns, 200)
    return t, np.column_stack([3 * np.cos(t), 0.5 * t, 3 * np.sin(t)])


def test_a_way_keeps_its_lengths_in_its_own_axes():
    _, x = helix()
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    a, b = along_principal_axes(x), along_principal_axes(x @ turn.T + [1, 2, 3])
    np.testing.assert_allclose(
        np.linalg.norm(a[7:] - a[:-7], axis=1), np.linalg.norm(x[7:] - x[:-7], axis=1)
    )
    np.testing.assert_allclose(np.abs(a), np.abs(b), atol=1e-9)
    assert np.all(np.diff(np.std(a, axis=0)) < 0)
    flat = along_principal_axes(np.column_stack([x[:, 0], x[:, 0] ** 2, 0 * x[:, 0]]))
    np.testing.assert_allclose(flat[:, 2], 0, atol=1e-12)


@pytest.mark.parametrize("R0", [1.0, 1e-5])
def test_the_picture_is_drawn_only_if_the_cell_has_moved(tmp_path, R0):
    t, x = helix()
    path = tmp_path / "trajectory.png"
    assert not save_trajectory_picture(path, t, 1e-2 * R0 * x, R0)
    assert not path.exists()
    assert save_trajectory_picture(path, t, R0 * x, R0)
    pixels = imread(path)
    assert pixels.shape[1] > 900
    assert np.ptp(pixels[..., :3]) > 0.5
