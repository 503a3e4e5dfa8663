"""Random valid runs end by name, with every step and the last frame in order."""

import pytest

from cross.scripts import script

# Every end of a random run but the one without progress.
ENDS = {"steady", "end of time", "enough steps", "diverged", "refused"}


@pytest.mark.parametrize(
    ("seed", "word"),
    [
        (3, "end of time"),
        # the law is not defined beyond some concentration: steps into it are rejected
        pytest.param(36, "enough steps", marks=pytest.mark.slow),
        # remeshing without turnover
        pytest.param(79, "enough steps", marks=pytest.mark.slow),
        (16, "end of time"),
    ],
)
def test_a_random_run_ends_as_expected(seed, word):
    """Every step and the last frame pass the checks of the script, and the end has this name."""
    outcome = script("fuzz").run_case(seed)
    assert outcome.word == word
    assert outcome.steps > 0


@pytest.mark.slow
@pytest.mark.parametrize("first", [200, 220])
def test_random_runs_end_by_name(first):
    """Cases that have not been used in the development."""
    for seed in range(first, first + 20):
        outcome = script("fuzz").run_case(seed)
        print(seed, outcome)
        assert outcome.word in ENDS


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
