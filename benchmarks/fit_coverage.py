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


def fits(sets: int) -> Iterator[tuple[float, dict[str, bool], dict[str, float]]]:
    """For each data set: chi2, which intervals hold the truth, and the deviations from it.

    Deviations are those of the logarithms in units of their standard errors.
    """
    for seed in range(sets):
        found = am.fit(am.synthetic(TRUTH, ERRORS, seed=seed), NAMES, TRUTH, starts=1)
        held = {
            name: interval.holds(TRUTH.value(name))
            for name, interval in found.intervals(LEVEL).items()
        }
        deviations = {
            name: float(np.log(found.parameters.value(name) / TRUTH.value(name))) / error
            for name, error in found.relative_errors.items()
        }
        yield found.chi2, held, deviations


def main() -> None:
    """Count, and print after each data set."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=100)
    sets = parser.parse_args().sets
    counts, sizes = dict.fromkeys(NAMES, 0), []
    for done, (chi2, held, _) in enumerate(fits(sets), 1):
        sizes.append(chi2)
        for name in NAMES:
            counts[name] += held[name]
        shares = ", ".join(f"{name} {count}" for name, count in counts.items())
        print(f"of {done}: {shares}; mean chi2 {np.mean(sizes):.2f}", flush=True)
    expected, error = LEVEL * sets, np.sqrt(sets * LEVEL * (1 - LEVEL))
    print(f"expected {expected:.1f} +- {error:.1f} of {sets}; mean chi2 {2 * 18 - 4}")


if __name__ == "__main__":
    main()
