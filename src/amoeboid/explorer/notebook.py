"""`amoeboid.explore()`: the explorer from Python, in a notebook or beside a program."""

from __future__ import annotations

import asyncio
import atexit
import threading
import webbrowser
from concurrent.futures import Future
from pathlib import Path
from typing import TYPE_CHECKING, Any

from amoeboid.explorer.needed import check_packages
from amoeboid.terminal import in_notebook
from amoeboid.validation import InvalidInput

if TYPE_CHECKING:
    from amoeboid.explorer.server import Server

IDLE = 600.0
"""Seconds without a page after which the server ends."""

HEIGHT = 900


class Explorer:
    """An explorer that runs in the background: a page at `address`, until `stop`.

    In a notebook it shows the page. It ends with the program, too, and `idle` seconds after the
    last page was closed.
    """

    def __init__(self, folder: Path, idle: float) -> None:
        self._folder, self._idle = folder, idle
        self._server: Server | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread = threading.Thread(target=self._run, name="amoeboid-explorer", daemon=True)
        self._started: Future[Server] = Future()
        self._thread.start()
        self._server = self._started.result()
        atexit.register(self.stop)

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except BaseException as error:
            if not self._started.done():
                self._started.set_exception(error)
            else:
                raise

    async def _serve(self) -> None:
        from amoeboid.explorer.server import Server

        self._loop = asyncio.get_running_loop()
        server = Server(self._folder, self._idle)
        await server.run(self._started.set_result)

    @property
    def address(self) -> str:
        """The address of the page; who has it can use the explorer, on this computer alone."""
        return "" if self._server is None else self._server.address

    def open(self) -> None:
        """Show the page in the browser, by an address that is good once."""
        if self._server is not None and self.running:
            webbrowser.open(self._server.address_once())

    @property
    def running(self) -> bool:
        """Whether the server still runs."""
        return self._thread.is_alive()

    def stop(self) -> None:
        """End the server, with its pages and computations. Does nothing if it has ended."""
        if self.running and self._loop is not None and self._server is not None:
            try:
                self._loop.call_soon_threadsafe(self._server.stop)
            except RuntimeError:  # its loop has just ended
                return
            self._thread.join(10.0)
        atexit.unregister(self.stop)

    def __enter__(self) -> Explorer:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def __reduce__(self) -> Any:
        raise InvalidInput(
            "an explorer runs in its own program and cannot be pickled; start a new one"
        )

    def __repr__(self) -> str:
        return f"Explorer({self.address if self.running else 'stopped'})"

    def _repr_html_(self) -> str:
        if not self.running:
            return "<p>The explorer was stopped.</p>"
        return (
            f'<iframe src="{self.address}" title="amoeboid explorer" width="100%" '
            f'height="{HEIGHT}" style="border:0"></iframe>'
        )


def explore(*, folder: Any = ".", idle: float = IDLE, browser: bool | None = None) -> Explorer:
    """Start the live explorer: a page with sliders, the branch, and a 3D cell that lives.

    In a notebook the page is shown below the cell, elsewhere the browser is opened; `browser` says
    whether. `folder` is where runs are saved from the page, `idle` the seconds without a page after
    which the server ends by itself; `stop()` ends it at once. It listens on this computer alone.
    Needs `pip install 'amoeboid[explore]'`. Raises InvalidInput.
    """
    path = checked_folder(folder)
    checked_idle(idle)
    check_packages()
    explorer = Explorer(path, float(idle))
    if browser if browser is not None else not in_notebook():
        explorer.open()
    return explorer


def checked_folder(folder: Any) -> Path:
    """The folder that runs are saved in. Raises InvalidInput if there is none."""
    path = Path(folder).resolve()
    if not path.is_dir():
        raise InvalidInput(f"folder must be an existing folder for runs, got {str(folder)!r}")
    return path


def checked_idle(idle: Any) -> None:
    """Raise InvalidInput for a value that is not a time to wait for a page."""
    if isinstance(idle, bool) or not isinstance(idle, int | float) or not 1.0 <= idle <= 1e6:
        raise InvalidInput(f"idle must be a number of seconds from 1 to 1e6, got {idle!r}")
