"""The explorer as a program that tests start and end, and a page of it without a browser."""

import json
import os
import signal
import struct
import subprocess
import time
from contextlib import ExitStack, contextmanager

import numpy as np
from websockets.sync.client import connect

from command import COMMAND

PATIENCE = 200.0


@contextmanager
def explorer(*arguments, cwd=None, browser=None):
    """The process and its address; it is ended at the end. `browser`: a program that it opens."""
    shown = ["--no-browser"] if browser is None else []
    variables = {} if browser is None else {"BROWSER": f"{browser} %s"}
    process = subprocess.Popen(
        [*COMMAND, "explore", *shown, "--json", *arguments],
        stdout=subprocess.PIPE,
        text=True,
        cwd=cwd,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"} | variables,
    )
    try:
        line = process.stdout.readline()
        yield process, json.loads(line)["address"]
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            process.wait(20)
        process.stdout.close()


def origin_of(address):
    return address.rsplit("/", 2)[0]


class Page:
    """What the page of a browser does, by the same messages."""

    def __init__(self, address):
        live = address.replace("http:", "ws:") + "live"
        self.stack = ExitStack()
        self.socket = self.stack.enter_context(
            connect(live, origin=origin_of(address), max_size=None, compression=None)
        )
        self.frames, self.number = 0, 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stack.close()

    def send(self, **message):
        self.socket.send(json.dumps(message))

    def live(self, do, **more):
        self.send(ask="live", do=do, **more)

    def begin(self, values, start="polarization", subdivisions=1, units="simulation", **more):
        self.live(
            "begin", units=units, values=values, start=start, subdivisions=subdivisions, **more
        )

    def ask(self, values, units="simulation", vary="v_p0"):
        self.number += 1
        self.send(ask="answers", number=self.number, units=units, values=values, vary=vary)
        return self.number

    def next(self, timeout=PATIENCE):
        """The next message; a frame as its header, with its arrays."""
        message = self.socket.recv(timeout=timeout)
        if isinstance(message, str):
            return json.loads(message)
        (length,) = struct.unpack("<I", message[:4])
        header, place = json.loads(message[4 : 4 + length]), 4 + length
        for name, shape, kind in header["arrays"]:
            size = 4 * int(np.prod(shape))
            kind = "<u4" if kind == "u" else "<f4"
            header[name] = np.frombuffer(message[place : place + size], kind).reshape(shape)
            place += size
        self.frames += 1
        self.send(ask="ready")
        return header

    def until(self, wanted, timeout=PATIENCE):
        """The first message that is wanted: of a kind, or by a function."""
        if isinstance(wanted, str):
            kind, wanted = wanted, lambda m: m["kind"] == kind
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            message = self.next(max(0.1, end - time.monotonic()))
            if wanted(message):
                return message
        raise TimeoutError(wanted)

    def answers(self, values, **more):
        """All answers to a point, by kind."""
        number = self.ask(values, **more)
        found = {}
        while "states" not in found:
            message = self.until(lambda m: m.get("number") == number)
            if message["kind"] == "refused":
                return {"refused": message}
            found[message["kind"]] = message
        return found


def children(pid):
    """The numbers of the processes that a process has started, and those below them."""
    found = []
    for entry in os.listdir("/proc"):
        if entry.isdigit():
            try:
                with open(f"/proc/{entry}/stat") as file:
                    parent = int(file.read().rsplit(")", 1)[1].split()[1])
            except OSError:
                continue
            if parent == pid:
                found += [int(entry), *children(int(entry))]
    return found


def gone(pids, timeout=15.0):
    """Whether all these processes end in time."""
    end = time.monotonic() + timeout
    while time.monotonic() < end:
        if not any(os.path.exists(f"/proc/{pid}") for pid in pids):
            return True
        time.sleep(0.05)
    return False
