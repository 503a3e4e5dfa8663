"""`amoeboid.explore()` in a notebook with a kernel of its own."""

import re

import pytest

from explore.requests import got
from explore.serving import Page, children, gone

pytestmark = pytest.mark.slow


def test_in_a_notebook_the_page_is_shown_below_the_cell_and_ends_with_the_kernel(tmp_path):
    nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed")
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed")
    cells = ["import amoeboid as am\nshown = am.explore()\nshown", "shown.running", "1 + 1"]
    cells = [nbformat.v4.new_code_cell(source) for source in cells]
    notebook = nbformat.v4.new_notebook(cells=cells)
    client = nbclient.NotebookClient(
        notebook, timeout=120, resources={"metadata": {"path": str(tmp_path)}}
    )
    with client.setup_kernel():
        client.execute_cell(cells[0], 0)
        (output,) = cells[0]["outputs"]
        page = output["data"]["text/html"]
        address = re.search(r'<iframe src="(http://127\.0\.0\.1:\d+/[^/]+/)"', page).group(1)
        assert got(address)[0].status == 200
        with Page(address) as connected:  # as the frame does, while the kernel does something else
            connected.begin({"D": 0.4})
            client.execute_cell(cells[2], 2)
            connected.until("frame")
            assert connected.answers({"D": 0.4, "v_p0": 5.5})["states"]
            below = children(client.km.provisioner.pid)
            assert len(below) == 2
            client.execute_cell(cells[1], 1)
            assert cells[1]["outputs"][0]["data"]["text/plain"] == "True"
    assert gone(below)
