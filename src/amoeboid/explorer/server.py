"""The server of the page: on this computer alone, for those who have the address.

A page is one connection: it asks for answers to parameter points, and has a live cell of its own.
"""

from __future__ import annotations

import asyncio
import hmac
import json
import secrets
import struct
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from http import HTTPStatus
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from amoeboid.explorer.files import CONTENT_TYPES, content, live_page
from amoeboid.explorer.peers import is_of_another_user
from amoeboid.explorer.process import Worker
from amoeboid.validation import InvalidInput

HOST = "127.0.0.1"
MAX_PAGES = 4
MAX_MESSAGE = 32 * 2**20  # bytes; a surface from a file
MAX_TEXT = 2**16
MAX_WAITING = 1000  # messages to a page that does not take them
MAX_NUMBER = 2**53
ONCE, MAX_ONCE = "once", 120.0
"""The first part of the address that is good once, and for how many seconds it is."""

SURFACES = (".stl", ".ply", ".obj", ".vtp")
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Connection": "close",
}


@dataclass(eq=False)
class Page:
    """A connection: what waits to be sent to it, and its cell."""

    number: int
    connection: Any
    live: Worker | None = None
    frame: bytes | None = None
    texts: list[str] = field(default_factory=list)
    ready: bool = True
    news: asyncio.Event = field(default_factory=asyncio.Event)
    surface: str | None = None

    def tell(self, message: dict[str, Any] | str) -> None:
        """Send a message when its turn comes; the oldest are lost where too many wait."""
        del self.texts[: max(0, len(self.texts) - MAX_WAITING + 1)]
        self.texts.append(message if isinstance(message, str) else json.dumps(message))
        self.news.set()

    def take_frame(self, data: bytes) -> None:
        """Keep a frame until the page is ready for one; a newer one replaces it."""
        self.frame = data
        self.news.set()


class Server:
    """Serves pages until it is told to stop, or no page has been open for `idle` seconds."""

    def __init__(self, folder: Path, idle: float) -> None:
        self.token = secrets.token_urlsafe(24)
        self.port = 0
        self._folder, self._idle = folder, idle
        self._pages: dict[int, Page] = {}
        self._numbers = count(1)
        self._answers = Worker("answers", self._answered)
        self._left = time.monotonic()
        self._stop = asyncio.Event()
        self._once = ""
        self._once_until = 0.0

    @property
    def address(self) -> str:
        """The address of the page, with the token."""
        return f"http://{HOST}:{self.port}/{self.token}/"

    def address_once(self) -> str:
        """An address that leads to the page once, soon, and only a program of this user.

        Every user of a computer can list the programs that run, with their arguments: a browser
        that is started with it gives nothing away. A newer one replaces it.
        """
        self._once, self._once_until = secrets.token_urlsafe(24), time.monotonic() + MAX_ONCE
        return f"http://{HOST}:{self.port}/{ONCE}/{self._once}"

    def stop(self) -> None:
        """End serving."""
        self._stop.set()

    async def run(self, started: Callable[[Server], None], port: int = 0) -> None:
        """Serve; `started` is called once the address is known. Raises OSError."""
        from websockets.asyncio.server import serve

        try:
            # it imports, and computes what every page asks for first, while a page opens
            await self._answers.send({"page": 0, "gone": True})
            async with serve(
                self._serve_page, HOST, port, process_request=self._answer_request,
                compression=None, max_size=MAX_MESSAGE, server_header=None, origins=None,
            ) as serving:  # fmt: skip
                self.port = next(iter(serving.sockets)).getsockname()[1]
                watching = asyncio.create_task(self._end_when_idle())
                try:
                    started(self)
                    await self._stop.wait()
                finally:
                    watching.cancel()
                    for page in list(self._pages.values()):
                        await page.connection.close(1001, "the server ends")
        finally:
            await self._answers.end()

    async def _end_when_idle(self) -> None:
        while True:
            await asyncio.sleep(min(1.0, 0.2 * self._idle))
            if not self._pages and time.monotonic() - self._left > self._idle:
                self.stop()

    # who may ask

    def refusal(self, host: list[str], origin: list[str]) -> str:
        """Why a request is refused, by where it comes from; empty if it is not."""
        names = [f"{name}:{self.port}" for name in (HOST, "localhost")]
        if len(host) != 1 or host[0] not in names:
            return "the host must be this computer"
        if len(origin) > 1 or any(
            one not in [f"http://{name}" for name in names] for one in origin
        ):
            return "the page must come from this server"
        return ""

    def _opened_once(self, connection: Any, code: str) -> Any:
        """The answer to the address that is good once: where the page is, or a refusal."""
        known = self._once and time.monotonic() < self._once_until
        if not known or not _same(code, self._once):
            return _refused(
                "this address leads to the page once only, and soon; use the one that the program "
                "has printed. If nobody has opened the page, somebody else may have: end the "
                "program and start it again"
            )
        if is_of_another_user(connection.remote_address, connection.local_address):
            return _refused("the page is that of another user of this computer")
        self._once = ""
        where = {"Location": f"/{self.token}/"}
        return _response(HTTPStatus.SEE_OTHER, b"", "text/plain", where)

    def _answer_request(self, connection: Any, request: Any) -> Any:
        """The answer to a request, or None for a live connection that may be made."""
        path = request.path.partition("?")[0]
        token, _, name = path.removeprefix("/").partition("/")
        host, origin = (request.headers.get_all(key) for key in ("Host", "Origin"))
        why = self.refusal(host, origin)
        if why:
            return _refused(why)
        if token == ONCE:
            return self._opened_once(connection, name)
        if not _same(token, self.token):
            return _refused("the address must have the token that the program has printed")
        if name == "live":
            why = "" if origin else "a live connection must come from a page of this server"
            return _refused(why) if why else None
        if name in ("", "index.html"):
            body, policy = live_page(self.port)
            return _response(HTTPStatus.OK, body, "text/html", {"Content-Security-Policy": policy})
        kind = CONTENT_TYPES.get(Path(name).suffix)
        found = content(name) if kind else None
        if found is None or kind is None:
            return _response(HTTPStatus.NOT_FOUND, b"There is no such file.\n", "text/plain")
        return _response(HTTPStatus.OK, found, kind)

    # a page

    async def _serve_page(self, connection: Any) -> None:
        from websockets.exceptions import ConnectionClosed

        page = Page(next(self._numbers), connection)
        if len(self._pages) >= MAX_PAGES:
            await connection.send(json.dumps({
                "kind": "failed",
                "message": f"at most {MAX_PAGES} pages may be open at once; close another one",
            }))  # fmt: skip
            return
        self._pages[page.number] = page
        sending = asyncio.create_task(_send_news(page))
        try:
            with TemporaryDirectory(prefix="amoeboid-explorer-") as folder:
                try:
                    async for message in connection:
                        await self._take(page, message, Path(folder))
                except ConnectionClosed:
                    pass
                finally:
                    sending.cancel()
                    if page.live is not None:
                        await page.live.end()
        finally:
            del self._pages[page.number]
            self._left = time.monotonic()
            if self._answers.pid is not None:
                await self._answers.send({"page": page.number, "gone": True})

    async def _take(self, page: Page, message: str | bytes, folder: Path) -> None:
        number = None
        try:
            if isinstance(message, bytes):
                page.surface = _kept_surface(message, folder)
                page.tell({"kind": "surface", "name": Path(page.surface).name})
                return
            asked = _read(message)
            number, kind = asked.get("number"), asked.pop("ask", None)
            if kind == "ready":
                page.ready = True
                page.news.set()
            elif kind == "answers":
                await self._answers.send(asked | {"page": page.number})
            elif kind == "live":
                await self._live(page, asked)
            else:
                raise InvalidInput(f"ask must be one of answers, live, ready, got {kind!r:.80}")
        except InvalidInput as error:
            page.tell({"kind": "refused", "field": "", "message": str(error), "number": number})

    async def _live(self, page: Page, asked: dict[str, Any]) -> None:
        if page.live is None:
            page.live = Worker("live", lambda kind, data: _of_cell(page, kind, data))
        # neither is the page's to choose
        await page.live.send(asked | {"surface": page.surface, "folder": str(self._folder)})

    def _answered(self, kind: str, data: bytes) -> None:
        message = json.loads(data)
        if message.get("kind") == "failed":
            for page in self._pages.values():
                page.tell(message)
            return
        found = self._pages.get(message.pop("page", 0))
        if found is not None:
            found.tell(message)


def _same(given: str, secret: str) -> bool:
    return hmac.compare_digest(given.encode(errors="surrogatepass"), secret.encode())


def _refused(why: str) -> Any:
    return _response(HTTPStatus.FORBIDDEN, f"Refused: {why}.\n".encode(), "text/plain")


def _of_cell(page: Page, kind: str, data: bytes) -> None:
    if kind == "B":
        page.take_frame(data)
    else:
        page.tell(data.decode())


async def _send_news(page: Page) -> None:
    """Send what waits: all texts, and the newest frame once the page has shown the one before."""
    from websockets.exceptions import ConnectionClosed

    with suppress(ConnectionClosed):
        while True:
            await page.news.wait()
            page.news.clear()
            texts, page.texts = page.texts, []
            for text in texts:
                await page.connection.send(text)
            if page.frame is not None and page.ready:
                frame, page.frame, page.ready = page.frame, None, False
                await page.connection.send(frame)


def _read(message: str) -> dict[str, Any]:
    """A message of the page. Raises InvalidInput."""
    if len(message) > MAX_TEXT:
        raise InvalidInput(f"a message must have at most {MAX_TEXT} characters")
    try:
        found = json.loads(message)
    except (ValueError, RecursionError):
        raise InvalidInput("a message must be JSON") from None
    if not isinstance(found, dict):
        raise InvalidInput("a message must be a JSON object")
    number = found.get("number")
    if number is not None and not (type(number) is int and 0 <= number < MAX_NUMBER):
        raise InvalidInput(f"number must be a whole number from 0, got {number!r:.80}")
    return found


def _kept_surface(message: bytes, folder: Path) -> str:
    """The path that a surface is kept at: 4 bytes of length, its name, the file. Raises
    InvalidInput."""
    try:
        (length,) = struct.unpack("<I", message[:4])
        name = message[4 : 4 + length].decode()
    except (struct.error, UnicodeDecodeError):
        raise InvalidInput("a file must come with its name") from None
    suffix = Path(name).suffix.lower()
    if suffix not in SURFACES:
        raise InvalidInput(f"a surface must be one of {', '.join(SURFACES)}, got {name[-40:]!r}")
    path = folder / f"surface{suffix}"
    path.write_bytes(message[4 + length :])
    return str(path)


def _response(
    status: HTTPStatus, body: bytes, kind: str, more: dict[str, str] | None = None
) -> Any:
    from websockets.datastructures import Headers
    from websockets.http11 import Response

    headers = HEADERS | {"Content-Type": f"{kind}; charset=utf-8", "Content-Length": str(len(body))}
    return Response(status, status.phrase, Headers(headers | (more or {})), body)
