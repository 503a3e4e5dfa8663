"""Pokes: local cues that pass, in a run and in its files."""

import numpy as np
import pytest

import amoeboid as am
from amoeboid.model.cues import POKE_WIDTH

SIDE = (1.0, 0.0, 0.0)
P = am.Parameters(D=0.4, v_p0=6.0)


def test_a_poke_is_local_and_passes():
    cue = am.Cue(strength=0.1, pokes=[(1.0, 2.0, *SIDE, 0.5)])
    angles = np.linspace(0, np.pi, 9)
    directions = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    background = 1 + 0.1 * directions[:, 2]
    for t in (0.0, 1.0, 3.0, 9.0):
        assert np.array_equal(cue.factor(directions, t), background)
    here = cue.factor(directions, 2.0) / background - 1
    assert here[0] == pytest.approx(0.5)
    assert np.allclose(here, 0.5 * np.exp((np.cos(angles) - 1) / POKE_WIDTH**2))
    assert (np.diff(here) < 0).all()
    half = cue.factor(directions, 1.5) / background - 1
    assert np.allclose(half, 0.5 * here)  # sin^2 of a quarter of its time
    assert cue.until == 3.0
    assert am.Cue().until == -np.inf


def test_factors_of_any_pokes_stay_positive():
    cue = am.Cue(strength=-1, pokes=[(0.0, 2.0, *SIDE, -1.0), (0.0, 2.0, *SIDE, 3.0)])
    directions = np.random.default_rng(0).normal(size=(100, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    assert (cue.factor(directions, 1.0) >= 0).all()


@pytest.mark.parametrize(
    "pokes",
    [
        [(1.0, 2.0)],
        [(1.0, 0.0, *SIDE, 0.5)],
        [(-1.0, 1.0, *SIDE, 0.5)],
        [(1.0, 1.0, 0, 0, 0, 0.5)],
        [(1.0, 1.0, *SIDE, -1.5)],
        [(1.0, 1.0, *SIDE, np.inf)],
        [(1.0, 1.0, *SIDE, True)],
        [(2.0, 1.0, *SIDE, 0.5), (1.0, 1.0, *SIDE, 0.5)],
        "now",
    ],
)
def test_what_is_no_poke_is_refused_with_the_rule(pokes):
    with pytest.raises(am.InvalidInput, match=r"cue.pokes must be a list of \[begin, duration"):
        am.Cue(pokes=pokes)


def test_a_poked_run_is_the_same_from_its_file(tmp_path):
    cue = am.Cue(pokes=[(0.2, 0.5, *SIDE, 0.8)])
    sol = am.simulate(P, mesh=am.Icosphere(1), cue=cue, until=am.time(1.0), folder=tmp_path / "a")
    config = am.config_from_toml((tmp_path / "a" / "config.toml").read_text())
    assert config.cue == cue
    again = am.simulate(config)
    assert np.array_equal(again.final.c, sol.final.c)
    plain = am.simulate(P, mesh=am.Icosphere(1), until=am.time(1.0))
    assert np.abs(plain.final.c - sol.final.c).max() > 0.01


def test_a_poke_leaves_fewer_filaments_where_it_is():
    rest = am.Parameters(D=0.4, v_p0=3.0)  # below the threshold: the sphere is stable
    start = am.Initial(perturbation=0.0)
    cue = am.Cue(pokes=[(0.0, 1.0, *SIDE, 1.0)])
    sol = am.simulate(rest, mesh=am.Icosphere(2), initial=start, cue=cue, until=am.time(0.8))
    # front where polymerization is fast: the polarity points from front to rear
    assert sol.final.c[np.argmax(sol.final.x[:, 0])] < sol.final.c[np.argmin(sol.final.x[:, 0])]


def test_an_axisymmetric_cell_refuses_pokes():
    from amoeboid.axisymmetric.steady import homogeneous, steady_state

    with pytest.raises(am.InvalidInput, match="without pokes"):
        steady_state(P, homogeneous(P), am.Cue(pokes=[(0.0, 1.0, 0.0, 0.0, 1.0, 0.5)]))
