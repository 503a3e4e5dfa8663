import subprocess
import sys

import pytest

import amoeboid


@pytest.mark.parametrize("name", amoeboid.__all__)
def test_every_public_name_exists_and_is_documented(name):
    assert getattr(amoeboid, name).__doc__ or name == "OBSERVABLES"


def test_public_names_are_listed_once_and_complete():
    assert sorted(set(amoeboid.__all__)) == sorted(amoeboid.__all__) == dir(amoeboid)
    assert set(amoeboid._HOMES) == set(amoeboid.__all__)


def test_unknown_names_are_refused():
    with pytest.raises(AttributeError, match="no attribute 'velocity'"):
        amoeboid.velocity  # noqa: B018


def test_import_is_quick_because_it_imports_nothing():
    code = "import sys, amoeboid; assert 'numpy' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
