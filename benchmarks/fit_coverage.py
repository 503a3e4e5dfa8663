"""How often intervals of fits hold the truth, on synthetic data sets with different noise.

    python -m benchmarks.fit_coverage --sets 100

fits D, v_p0, c0 and beta to 18 points each of flow and concentration of the cell of figure 3D, with
errors of 2.2 and 2.3 % of the largest value, and counts the 95 % intervals that hold the truth.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import numpy as np

import amoeboid as am

TRUTH = am.Parameters(D=0.4, v_p0=6.0)
NAMES = ("D", "v_p0", "c0", "beta")
ERRORS = {"u": 0.04, "c": 0.3}
LEVEL = 0.95


def fits(sets: int) -> Iterator[tuple[float, dict[str, bool]]]:
    """For each data set: chi2 of the truth less that of the fit, which intervals hold the truth."""
    for seed in range(sets):
        found = am.fit(am.synthetic(TRUTH, ERRORS, seed=seed), NAMES, TRUTH, starts=1)
        held = {
            name: interval.holds(TRUTH.value(name))
            for name, interval in found.intervals(LEVEL).items()
        }
        truth = found.problem.evaluated(np.zeros(len(NAMES)), found.point)
        assert truth is not None
        yield truth.chi2 - found.chi2, held


def main() -> None:
    """Count, and print after each data set."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=100)
    sets = parser.parse_args().sets
    counts, falls = dict.fromkeys(NAMES, 0), []
    for done, (fall, held) in enumerate(fits(sets), 1):
        falls.append(fall)
        for name in NAMES:
            counts[name] += held[name]
        shares = ", ".join(f"{name} {count}" for name, count in counts.items())
        print(f"of {done}: {shares}; mean fall of chi2 {np.mean(falls):.2f}", flush=True)
    expected, error = LEVEL * sets, np.sqrt(sets * LEVEL * (1 - LEVEL))
    print(f"expected {expected:.1f} +- {error:.1f} of {sets}; mean fall of chi2 {len(NAMES)}")


if __name__ == "__main__":
    main()
