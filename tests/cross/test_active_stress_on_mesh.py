"""One velocity instead of two, on the triangulated shell of a deformed cell."""

import numpy as np
import pytest

from amoeboid.closed_forms.active_stress import Meridian, active_stress, principal_curvatures
from amoeboid.meshes.geometry import geometry
from amoeboid.meshes.operators import block_matrix
from amoeboid.surface.dissipation import dissipation_blocks
from surface.shapes import observed_orders, sphere

ETA_S, ETA_B = 1.3, 0.45


def radius(theta):
    """r(theta) of a cell 25 % longer than wide, with a front blunter than its rear; derivatives."""
    x, s = np.cos(theta), np.sin(theta)
    value = 1 + 0.2 * x**2 + 0.06 * x**3
    first = -s * (0.4 * x + 0.18 * x**2)
    second = -x * (0.4 * x + 0.18 * x**2) + s**2 * (0.4 + 0.36 * x)
    return value, first, second


def on_the_cell(directions):
    """Points, outward normals and curvature tensors of the cell in these directions (n, 3)."""
    unit = directions / np.linalg.norm(directions, axis=1)[:, None]
    theta = np.arccos(unit[:, 2])
    h, h1, h2 = radius(theta)
    x, s = np.cos(theta), np.sin(theta)
    r_x, z_x = h1 * s + h * x, h1 * x - h * s
    around = np.column_stack([-unit[:, 1], unit[:, 0], 0 * x]) / s[:, None]
    outward = np.cross(around, [0.0, 0.0, 1.0])
    along = r_x[:, None] * outward + z_x[:, None] * np.array([0.0, 0.0, 1.0])
    along /= np.linalg.norm(along, axis=1)[:, None]
    curvatures = principal_curvatures(
        Meridian(
            r=h * s,
            r_x=r_x,
            z_x=z_x,
            r_xx=h2 * s + 2 * h1 * x - h * s,
            z_xx=h2 * x - 2 * h1 * s - h * x,
        )
    )
    tensors = sum(
        k[:, None, None] * t[:, :, None] * t[:, None, :]
        for k, t in zip(curvatures, (along, around), strict=True)
    )
    return h[:, None] * unit, np.cross(along, around), tensors


def speed(r):
    return 1.0 + 0.4 * r[:, 2] - 0.2 * r[:, 0] * r[:, 1]


def powers(subdivisions, virtual):
    """(power of the stress of -v_p n, power of sigma_active) for one virtual velocity."""
    directions, mesh = sphere(subdivisions)
    # Tilted, so that no node or face center lies on the axis.
    tilt = np.linalg.qr(np.array([[3.0, 1, 0.4], [-1, 3, 0.7], [0.3, 0.2, 3]]))[0]
    r, normals, _ = on_the_cell(directions @ tilt)
    g = geometry(r, mesh.faces)
    K = block_matrix(dissipation_blocks(g, mesh, ETA_S, ETA_B), mesh)
    w = virtual(r)
    two = -w.ravel() @ (K @ (speed(r)[:, None] * normals).ravel())
    centers, center_normals, curvature = on_the_cell(r[mesh.faces].mean(axis=1))
    sigma = active_stress(curvature, center_normals, speed(centers), ETA_S, ETA_B)
    gradients = np.einsum("fad,fae->fde", g.gradients, w[mesh.faces])
    one = np.einsum("f,fde,fde->", g.face_areas, sigma, gradients)
    return len(r), two, one


@pytest.mark.parametrize(
    "virtual",
    [
        lambda r: r * r[:, 2:] ** 2,
        lambda r: np.column_stack([r[:, 1] * r[:, 2], -r[:, 0], np.sin(r[:, 0] + 2 * r[:, 1])]),
        lambda r: np.cross(r, [0.2, -0.5, 1.0]) * (1 + r[:, :1]),
    ],
    ids=["stretching", "mixed", "shearing"],
)
def test_active_stress_replaces_the_second_velocity_at_second_order(virtual):
    sizes, two, one = np.array([powers(n, virtual) for n in (2, 3, 4)]).T
    errors = two / one - 1
    print(f"powers {one}, relative differences {errors}")
    # The mixed field's power is a small difference of large parts; its error is that of the parts.
    assert abs(errors[-1]) < 1e-2
    assert observed_orders(sizes, errors)[-1] == pytest.approx(2, abs=0.4)
