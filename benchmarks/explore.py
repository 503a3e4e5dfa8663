"""The explorer: seconds from a slider to the branch, and frames of the live cell a second.

    python -m benchmarks.explore [SECONDS]     live for so long, 20 if not given

A client without a page asks for a point right after the start, for new points, and for one that is
known. A headless Chromium, where there is one, draws the live cell of 642 nodes by software.
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from explore.chromium import browser
from explore.serving import Page, explorer

NODES = "explorer.live.latest?.fields.c.length"


def seconds_to_branch(page: Page, **values: float) -> float:
    """From a change of values to the branch of these values."""
    begun = time.monotonic()
    number = page.ask(values)
    page.until(lambda m: m.get("number") == number and m["kind"] == "branch")
    passed = time.monotonic() - begun
    page.until(lambda m: m.get("number") == number and m["kind"] == "states")  # the last answer
    return passed


def branches() -> dict[str, float]:
    """Seconds to the first branch of a program, to branches at new points, and to a known one."""
    begun = time.monotonic()
    with explorer() as (_, address), Page(address) as page:
        served = time.monotonic() - begun
        first = seconds_to_branch(page, D=0.35, v_p0=6.0)
        new = [seconds_to_branch(page, D=D, v_p0=6.0) for D in (0.31, 0.27, 0.42, 0.38, 0.45)]
        known = [seconds_to_branch(page, D=D, v_p0=6.0) for D in (0.31, 0.42, 0.38)]
    return {
        "address_s": served,
        "first_s": first,
        "new_median_s": median(new),
        "new_worst_s": max(new),
        "known_worst_s": max(known),
    }


def frames(seconds: float) -> dict[str, float]:
    """Frames a second that a page with 642 nodes has drawn."""
    with explorer() as (_, address), browser() as chromium:
        tab = chromium.open(address)
        tab.until("explorer.known.states && explorer.live.latest", 300)
        tab.until(f"{NODES} === 642", 300)
        time.sleep(5)  # what else the page asks for at the start
        before, begun = tab.value("explorer.live.frames"), time.monotonic()
        time.sleep(seconds)
        drawn = tab.value("explorer.live.frames") - before
        passed = time.monotonic() - begun
        tab.close()
    return {"frames_a_second": drawn / passed, "seconds": passed}


if __name__ == "__main__":
    found = branches() | frames(float(sys.argv[1]) if len(sys.argv) > 1 else 20.0)
    print(json.dumps(found | {"load": os.getloadavg()[0]}))
