"""`amoeboid explore`: a live page in the browser, or a page in one file."""

from __future__ import annotations

import argparse
import asyncio
import signal
import webbrowser
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

from amoeboid.cli.output import say
from amoeboid.cli.settings import add_parameters, only_parameters, print_json, real
from amoeboid.extras import check
from amoeboid.validation import InvalidInput

if TYPE_CHECKING:
    from amoeboid.explorer.server import Server


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `explore`."""
    add_parameters(parser)
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path(),
        metavar="DIR",
        help="folder in which the page saves runs (default: the current one)",
    )
    parser.add_argument(
        "--idle",
        type=real,
        default=600.0,
        metavar="SECONDS",
        help="stop if no page has been open for this time (default: 600)",
    )
    parser.add_argument(
        "--no-browser", action="store_true", help="print the address without opening a browser"
    )
    parser.add_argument(
        "--export",
        type=Path,
        metavar="FILE",
        help="write a page into one file (.html) that works without a server and a network: the "
        "branches in v_p0 for four values of D around the parameters of --set, without the "
        "3D cell",
    )
    parser.epilog = (
        "The page is served only on this computer, and only with the token in its address. "
        "Ctrl-C stops the server. --set and --physical are for --export; the page has sliders.\n"
        "Except for --export this needs pip install 'amoeboid[explore]'.\n"
        "examples:\n"
        "  amoeboid explore\n"
        "  amoeboid explore --export explorer.html"
    )


def execute(args: argparse.Namespace) -> int:
    """Serve the page until it is told to stop, or write it."""
    if args.export is not None:
        return _export(args)
    from amoeboid.explorer.needed import check_packages
    from amoeboid.explorer.notebook import checked_folder, checked_idle
    from amoeboid.explorer.server import Server

    if args.settings or args.physical:
        raise InvalidInput(
            "--set and --physical are only for --export; the page has sliders instead"
        )
    folder = checked_folder(args.output)
    checked_idle(args.idle)
    check_packages()

    def started(server: Server) -> None:
        if args.json:
            print_json({"address": server.address})
        else:
            say(f"the explorer is at {server.address}", "Ctrl-C ends it")
        if not args.no_browser:
            # a browser that runs in the terminal returns when it is left only
            opening = (server.address_once(),)
            Thread(target=webbrowser.open, args=opening, daemon=True).start()

    asyncio.run(_serve(Server(folder, args.idle), started))
    return 0


async def _serve(server: Server, started: object) -> None:
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        with suppress(
            NotImplementedError, ValueError
        ):  # a loop without handlers ends by KeyboardInterrupt
            loop.add_signal_handler(number, server.stop)
    await server.run(started)  # type: ignore[arg-type]


def _export(args: argparse.Namespace) -> int:
    from amoeboid.cli.progress import shown
    from amoeboid.explorer.offline import write_page

    path: Path = args.export
    if path.suffix.lower() not in (".html", ".htm"):
        raise InvalidInput(f"--export must name a page (.html), got {str(path)!r}")
    if not path.parent.is_dir():
        raise InvalidInput(f"--export must name a file in a folder that exists, got {str(path)!r}")
    check("--export needs", "matplotlib")
    p = only_parameters(args)
    with shown() as watch:
        size = write_page(p, path, watch)
    if args.json:
        print_json({"page": str(path), "bytes": size})
    else:
        say(f"{path}: {size / 1000:.0f} kB")
    return 0
