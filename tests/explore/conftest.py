"""What the tests in a browser share."""

import pytest

from explore.chromium import browser
from explore.serving import Page, explorer


@pytest.fixture(scope="module")
def chromium():
    with browser() as found:
        yield found


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    with explorer(cwd=tmp_path_factory.mktemp("pages")) as found:
        yield found


@pytest.fixture(scope="module")
def address(server):
    return server[1]


@pytest.fixture(scope="module")
def page(address):
    """A page without a browser."""
    with Page(address) as found:
        yield found


@pytest.fixture
def tab(chromium, server):
    found = chromium.open(server[1])
    found.until("explorer.known.states && explorer.live.latest")
    yield found
    assert found.events("Runtime.exceptionThrown") == []
    found.close()
