"""How tutorials and scripts of the gallery are run, with warnings as errors."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = sorted((ROOT / "examples").glob("*.py"))
TUTORIALS = sorted(page for page in (ROOT / "docs/tutorials").glob("*.md") if page.stem != "index")
CELL = r"```\{code-cell\} ipython3\n(.*?)```"
MAX_TIME = 600  # seconds, on a busy machine
STRICT = "import warnings\nwarnings.simplefilter('error')\n"
# that is no matter of ours: the kernel warns of itself when it is shut down
KERNEL = "warnings.filterwarnings('default', module='ipykernel')\n"
# pictures are drawn into memory; `show` has no window to open, and says so
SILENT_SHOW = "import matplotlib.pyplot as plt\nplt.show = lambda: plt.close('all')\n"


def assertions(source):
    """The number of assertions in lines of Python."""
    return sum(isinstance(node, ast.Assert) for node in ast.walk(ast.parse(source)))


def run_script(path, folder):
    """Run a script of the gallery in a process of its own; fails with what it printed last."""
    code = STRICT + SILENT_SHOW + "import runpy, sys\nrunpy.run_path(sys.argv[1], run_name='x')\n"
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)],
        cwd=folder,
        env=os.environ | {"MPLBACKEND": "agg"},
        capture_output=True,
        text=True,
        timeout=MAX_TIME,
    )
    assert done.returncode == 0, done.stderr[-3000:]


def notebook(path):
    """A tutorial as a notebook. Skips the test without MyST-NB."""
    read = pytest.importorskip("myst_nb.core.read", reason="MyST-NB is not installed")
    config = pytest.importorskip("myst_parser.config.main").MdParserConfig()
    return read.read_myst_markdown_notebook(path.read_text(encoding="utf-8"), config)


def cells_of(path):
    """The cells of code of a tutorial, as texts."""
    return re.findall(CELL, path.read_text(encoding="utf-8"), flags=re.DOTALL)


def run_tutorial(path, folder):
    """Run a tutorial as Jupyter does."""
    client = pytest.importorskip("nbclient", reason="nbclient is not installed")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed")
    import nbformat

    found = notebook(path)
    found.cells.insert(0, nbformat.v4.new_code_cell(STRICT + KERNEL))
    client.NotebookClient(
        found, timeout=MAX_TIME, kernel_name="python3", resources={"metadata": {"path": folder}}
    ).execute()
    return found
