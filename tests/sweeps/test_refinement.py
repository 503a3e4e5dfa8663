"""Adaptive refinement of a boundary."""

import numpy as np
import pytest

import amoeboid as am


def inside(p):
    """Whether a point is in a circle."""
    return {"in": (p.D - 0.5) ** 2 + (p.v_p0 - 0.5) ** 2 < 0.09, "x": p.D}


AXIS = {"linspace": [0, 1, 5]}


def fine_cells_at_the_boundary(found, depth):
    """Whether each point of the finest grid beside a change of the label was computed."""
    n = 4 * 2**depth + 1
    x = np.linspace(0, 1, n)
    label = (x[:, None] - 0.5) ** 2 + (x[None, :] - 0.5) ** 2 < 0.09
    known = np.zeros_like(label)
    places = np.rint(np.stack([found["D"].values, found["v_p0"].values]) * (n - 1)).astype(int)
    known[tuple(places)] = True
    change = np.zeros_like(label)
    after, before, whole = slice(1, None), slice(None, -1), slice(None)
    for one, other in (((after, whole), (before, whole)), ((whole, after), (whole, before))):
        differs = label[one] != label[other]
        change[one] |= differs
        change[other] |= differs
    return known[change]


@pytest.mark.parametrize("depth", [1, 3, 5])
def test_the_boundary_is_as_fine_as_the_finest_grid(depth):
    found = am.sweep(am.refine(am.grid(D=AXIS, v_p0=AXIS), "in", depth=depth), inside)
    assert fine_cells_at_the_boundary(found, depth).all()
    # a boundary of length 1.9 in cells of 1/(4 2^depth), some ten points for each: a few percent
    # of the whole grid where it is fine
    assert len(found) < 10 * 1.9 * 4 * 2**depth + 25


def test_nothing_is_refined_without_a_change():
    found = am.sweep(am.refine(am.grid(D=AXIS, v_p0=AXIS), "in"), lambda p: {"in": 1.0})
    assert len(found) == 25


def test_points_that_fail_have_no_label():
    plan = am.refine(am.grid(D=[-1, 0, 1, 2]), "x", depth=2)
    found = am.sweep(plan, lambda p: {"x": p.D > 1.2})
    assert found["D"].values.tolist() == [-1, 0, 1, 2, 1.5, 1.25]
    assert found.counts == {"ok": 5, "failed": 1}


def test_a_logarithmic_grid_is_refined_in_the_logarithm():
    plan = am.refine(am.grid(D={"logspace": [0.01, 1, 3]}), "value", depth=1)
    found = am.sweep(plan, lambda p: p.D > 0.5)
    assert found["D"].values == pytest.approx([0.01, 0.1, 1, 10**-0.5])


def test_a_refined_sweep_is_continued(tmp_path):
    counted = []

    def solver(p):
        counted.append(p)
        return {"in": p.D * p.v_p0 > 0.3}

    grid = am.grid(D=AXIS, v_p0=AXIS)
    first = am.sweep(am.refine(grid, "in", depth=2), solver, folder=tmp_path / "a", key="1")
    count = len(counted)
    again = am.sweep(am.refine(grid, "in", depth=2), solver, folder=tmp_path / "a", key="1")
    assert len(counted) == count == len(first)
    assert again.rows == first.rows
    deeper = am.sweep(am.refine(grid, "in", depth=3), solver, folder=tmp_path / "a", key="1")
    assert len(counted) == len(deeper) > count


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: am.refine(am.paired(D=[1, 2]), "x"), "refine needs a grid"),
        (lambda: am.refine(am.grid(D=[1]), "x"), "at least two numbers"),
        (lambda: am.refine(am.grid(D=[1, 3, 2]), "x"), "numbers in order"),
        (lambda: am.refine(am.grid(law=["inverse", "exponential"]), "x"), "at least two numbers"),
        (lambda: am.refine(am.grid(D=[1, 2]), "x", depth=0), "depth must be"),
        (lambda: am.refine(am.grid(D=[1, 2]), ()), "label must be a name"),
        (lambda: am.refine(am.grid(D=range(99), c0=range(99)), "x", depth=9), "at most 50000000"),
        (lambda: am.sweep(am.refine(am.grid(D=[1, 2]), "y"), inside), "allowed: in, x"),
    ],
)
def test_what_cannot_be_refined_is_refused(make, message):
    with pytest.raises(am.InvalidInput, match=message):
        make()


def test_a_refinement_has_no_shards(tmp_path):
    plan = am.refine(am.grid(D=[1, 2]), "in")
    with pytest.raises(am.InvalidInput, match="cannot be divided into shards"):
        am.sweep(plan, inside, folder=tmp_path / "a", shard=(1, 2))
