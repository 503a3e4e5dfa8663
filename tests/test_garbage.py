"""Garbage is not looked for during imports; afterwards it is, and always in a user's process."""

import gc
import subprocess
import sys

from amoeboid.cli import garbage

OWN = """
import gc
from amoeboid.cli import garbage
garbage.command_begins()
assert not gc.isenabled()
with garbage.imports():
    kept = [[] for _ in range(1000)]
    assert not gc.isenabled()
assert gc.isenabled() and gc.get_freeze_count() > 1000 and not gc.get_objects(generation=2)
try:
    with garbage.imports():
        raise ImportError
except ImportError:
    assert gc.isenabled()
"""


def test_the_process_of_a_command_collects_garbage_after_its_imports():
    subprocess.run([sys.executable, "-c", OWN], check=True)


def test_in_the_process_of_a_user_everything_stays_as_it_is():
    frozen = gc.get_freeze_count()
    with garbage.imports():
        assert gc.isenabled()
    assert gc.get_freeze_count() == frozen
    gc.disable()
    try:
        with garbage.imports():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()
