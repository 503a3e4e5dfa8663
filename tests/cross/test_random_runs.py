"""Random valid runs end by name, with every step and the last frame in order."""

import pytest

from cross.scripts import script


@pytest.mark.parametrize("seed", [3, 36, 79])
def test_a_random_run_ends_by_name(seed):
    """36: a law that ends within a step; 79: remeshing without turnover."""
    assert script("fuzz").run_case(seed).word


@pytest.mark.slow
@pytest.mark.parametrize("first", [200, 220])
def test_random_runs_end_by_name(first):
    """Cases beyond those that the program was mended with."""
    for seed in range(first, first + 20):
        outcome = script("fuzz").run_case(seed)
        print(seed, outcome)
        assert outcome.word != "no progress"


def test_the_checks_of_random_runs_see_what_is_broken(monkeypatch):
    """Filaments lost in one step are found."""
    fuzz = script("fuzz")
    real = fuzz.evolve

    def leaking(first, time, events):
        for step in real(first, time, events):
            step.state.c[...] *= 1 - 1e-6
            yield step

    monkeypatch.setattr(fuzz, "evolve", leaking)
    with pytest.raises(fuzz.Broken, match="filaments off"):
        fuzz.run_case(16)
