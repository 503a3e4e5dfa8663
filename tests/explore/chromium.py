"""A headless Chromium, driven by its own protocol over the connection that the explorer needs too.

Where there is none, or it does not start, tests are skipped with the reason.
"""

import base64
import json
import os
import shutil
import subprocess
import tempfile
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from websockets.sync.client import connect

NAMES = ("chromium", "chromium-browser", "google-chrome")
PATIENCE = 300.0
"""Seconds: only what never comes takes so long, and the machine may be busy."""
ARGUMENTS = (
    "--headless=new",
    "--remote-debugging-port=0",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)


def program():
    """The browser; skips the test where there is none."""
    found = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip(f"no Chromium: none of {', '.join(NAMES)} is installed")
    return found


@contextmanager
def browser():
    """A browser with a profile of its own."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        sandbox = ["--no-sandbox"] if os.getuid() == 0 else []
        process = subprocess.Popen(
            [program(), *ARGUMENTS, *sandbox, f"--user-data-dir={profile}", "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            port, path = _told(Path(profile) / "DevToolsActivePort", process)
            with connect(f"ws://127.0.0.1:{port}{path}", max_size=None, compression=None) as socket:
                yield Browser(socket, process)
        finally:
            kill(process)


def kill(process):
    """End a browser at once, with all its processes."""
    if process.poll() is None:
        os.killpg(process.pid, 9)
    process.wait(20)


def _told(file, process):
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end and process.poll() is None:
        lines = file.read_text().splitlines() if file.exists() else []
        if len(lines) == 2:
            return lines
        time.sleep(0.05)
    pytest.skip(f"Chromium does not start here (exit code {process.poll()})")


class Refused(Exception):
    """The browser does not do what it is told, for example while it loads another page."""


class Browser:
    def __init__(self, socket, process):
        self.socket, self.process = socket, process
        self._number, self.events = 0, []

    def call(self, method, session=None, **params):
        """The result of a command of the protocol."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": params}
        self.socket.send(json.dumps(message | ({"sessionId": session} if session else {})))
        while True:
            answer = json.loads(self.socket.recv(timeout=PATIENCE))
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise Refused(f"{method}: {answer['error']}")
                return answer["result"]
            if "method" in answer:
                self.events.append(answer)

    def open(self, address, width=1280, height=900, dark=False, touch=False, still=False):
        """A tab that shows a page; `still` where the system asks for less motion."""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        tab = Tab(self, target, session)
        for domain in ("Runtime", "Page", "Network", "Log"):
            tab.call(f"{domain}.enable")
        tab.call(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=touch,
        )  # fmt: skip
        wanted = {
            "prefers-color-scheme": "dark" if dark else "light",
            "prefers-reduced-motion": "reduce" if still else "no-preference",
        }
        features = [{"name": name, "value": value} for name, value in wanted.items()]
        tab.call("Emulation.setEmulatedMedia", features=features)
        tab.call("Emulation.setScrollbarsHidden", hidden=True)
        tab.call("Page.navigate", url=address)
        return tab


class Tab:
    def __init__(self, browser, target, session):
        self.browser, self.target, self.session = browser, target, session

    def call(self, method, **params):
        return self.browser.call(method, self.session, **params)

    def value(self, expression):
        """The value of an expression of JavaScript in the page."""
        found = self.call(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def until(self, expression, timeout=PATIENCE):
        """The value of an expression once it is true."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            with suppress(Refused):
                found = self.value(f"typeof explorer === 'undefined' ? null : ({expression})")
                if found:
                    return found
            time.sleep(0.03)
        raise TimeoutError(expression)

    def events(self, method):
        """What has happened in this tab so far."""
        self.value("0")
        return [
            e["params"]
            for e in self.browser.events
            if e["method"] == method and e.get("sessionId") == self.session
        ]

    def set_slider(self, name, position):
        """Drag a slider to a position of its range."""
        self.value(
            f"(() => {{ const s = document.getElementById('p-{name}'); s.value = {position};"
            "s.dispatchEvent(new Event('input', { bubbles: true })); })()"
        )

    def type_value(self, name, text):
        """Type a value beside a slider."""
        self.value(
            f"(() => {{ const s = document.getElementById('p-{name}-text');"
            f"s.value = {json.dumps(text)};"
            "s.dispatchEvent(new Event('change', { bubbles: true })); })()"
        )

    def click(self, selector, right=0.5, down=0.5):
        """Press the mouse on a part of an element."""
        box = self.value(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)});"
            "e.scrollIntoView({ block: 'center' }); const b = e.getBoundingClientRect();"
            "return [b.x, b.y, b.width, b.height]; })()"
        )
        at = {"x": box[0] + right * box[2], "y": box[1] + down * box[3]}
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, button="left", clickCount=1, **at)

    def key(self, key):
        """Press a key."""
        number = {"Tab": 9, "Enter": 13}.get(key, 0)
        for kind in ("keyDown", "keyUp"):
            self.call(
                "Input.dispatchKeyEvent",
                type=kind, key=key, code=key, windowsVirtualKeyCode=number,
            )  # fmt: skip

    def picture(self, path, whole=True):
        """Save what is seen as a PNG file."""
        found = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        Path(path).write_bytes(base64.b64decode(found["data"]))

    def close(self):
        self.browser.call("Target.closeTarget", targetId=self.target)
