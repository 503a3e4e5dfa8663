"""What the tests in a browser share."""

import pytest

from explore.chromium import browser
from explore.serving import explorer


@pytest.fixture(scope="module")
def chromium():
    with browser() as found:
        yield found


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    with explorer(cwd=tmp_path_factory.mktemp("pages")) as found:
        yield found


@pytest.fixture
def tab(chromium, server):
    found = chromium.open(server[1])
    found.until("explorer.known.states && explorer.live.latest")
    yield found
    assert found.events("Runtime.exceptionThrown") == []
    found.close()
