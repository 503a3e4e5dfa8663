"""The server of the explorer: who may ask, what comes back, and that nothing is left."""

import os
import signal
import socket
import struct
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

import amoeboid as am
from amoeboid.cli.main import main
from amoeboid.explorer.lines import new_folder
from amoeboid.explorer.server import MAX_WAITING
from amoeboid.explorer.server import Page as Connected
from explore.requests import got
from explore.serving import Page, children, explorer, gone, origin_of

D4 = {"D": 0.4, "v_p0": 5.5}


def test_the_page_and_its_files_come_with_a_policy_that_loads_nothing_else(address):
    answer, body = got(address)
    assert answer.status == 200
    assert b"amoeboid explorer" in body
    policy = answer.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    for name in ("app.js", "plots.js", "sources.js", "cell.js", "three.js", "style.css"):
        answer, body = got(address, name)
        assert answer.status == 200, name
        assert answer.headers["X-Content-Type-Options"] == "nosniff"
        assert len(body) > 1000
    assert got(address, "three-license.txt")[1].startswith(b"The MIT License")


@pytest.mark.parametrize("name", ["server.py", "../server.py", "..%2fserver.py", "page", "x.js"])
def test_no_other_file_is_given(address, name):
    assert got(address, name)[0].status == 404


@pytest.mark.parametrize(
    ("headers", "host"),
    [
        ({"Origin": "http://elsewhere.example"}, None),
        ({"Origin": "null"}, None),
        ({}, "elsewhere.example"),
        ({}, "127.0.0.1:1"),
    ],
)
def test_a_foreign_origin_or_host_is_refused(address, headers, host):
    answer, body = got(address, headers=headers, host=host)
    assert answer.status == 403
    assert body.startswith(b"Refused: the ")


def test_a_request_without_the_token_is_refused(address):
    for path in ("/", "/live", "/wrong/", "/wrong/app.js"):
        answer, body = got(origin_of(address), path)
        assert answer.status == 403
        assert b"token" in body


def test_a_token_that_is_no_text_is_refused(address):
    parts = urlsplit(address)
    with socket.create_connection((parts.hostname, parts.port), timeout=20) as connection:
        connection.sendall(
            b"GET /\xff\xfe/ HTTP/1.1\r\nHost: " + parts.netloc.encode() + b"\r\n\r\n"
        )
        assert not connection.recv(4096).startswith(b"HTTP/1.1 200")


@pytest.mark.parametrize("origin", [None, "http://elsewhere.example", "null"])
def test_a_live_connection_from_elsewhere_is_refused(address, origin):
    with (
        pytest.raises(InvalidStatus) as refused,
        connect(address.replace("http:", "ws:") + "live", origin=origin),
    ):
        pass
    assert refused.value.response.status_code == 403


def test_nothing_listens_beyond_this_computer(server):
    process, address = server
    port = urlsplit(address).port
    listening = set()
    for name in ("tcp", "tcp6"):
        with open(f"/proc/{process.pid}/net/{name}") as file:
            for line in file.readlines()[1:]:
                local, state = line.split()[1], line.split()[3]
                host, number = local.split(":")
                if state == "0A" and int(number, 16) == port:
                    listening.add(host)
    assert listening == {"0100007F"}
    outside = {a[4][0] for a in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
    for host in outside - {"127.0.0.1"}:
        with pytest.raises(OSError, match=r"refused|timed out|unreachable"):
            socket.create_connection((host, port), timeout=2)


def test_answers_are_those_of_the_package(page):
    found = page.answers(D4)
    theory = am.theory(am.Parameters(**D4))
    assert found["theory"]["rates"][0]["rate"] == pytest.approx(theory.growth_rates[1], rel=1e-4)
    branch = found["branch"]
    assert branch["folds"][0]["x"] == pytest.approx(5.20960, abs=1e-4)  # docs/studies.md
    assert branch["thresholds"] == [pytest.approx(6.02566, abs=1e-4)]
    assert {curve["stable"] for curve in branch["curves"]} == {True, False}
    speeds = [s["numbers"]["max_retrograde_speed"] for s in found["states"]["states"]]
    assert speeds == pytest.approx([0.0, 0.490723, 1.45368], rel=1e-4)  # docs/studies.md
    assert [s["stable"] for s in found["states"]["states"]] == [True, False, True]
    assert "hysteresis" in " ".join(found["states"]["verdict"])
    # the curves pass through the states between the points that were computed
    for state, stable in zip(found["states"]["states"][1:], [False, True], strict=True):
        curve = next(c for c in branch["curves"] if c["stable"] == stable)
        order = np.argsort(curve["x"])
        x, y = (np.array(v)[order] for v in (curve["x"], curve["y"]["c_rear"]))
        assert np.interp(5.5, x, y) == pytest.approx(state["numbers"]["c_rear"], rel=5e-3)


def test_what_is_known_comes_at_once(page):
    page.answers(D4)
    best = np.inf
    for _ in range(3):
        began = time.monotonic()
        page.answers(D4)
        best = min(best, time.monotonic() - began)
    assert best < 0.1


def test_of_two_questions_in_a_row_the_last_is_answered(page):
    first = page.ask({"D": 0.31, "v_p0": 5.0})
    second = page.ask({"D": 0.32, "v_p0": 5.0})
    seen = []
    while not seen or seen[-1] != (second, "states"):
        message = page.next()
        seen.append((message.get("number"), message["kind"]))
    assert (first, "branch") not in seen
    assert (first, "states") not in seen


@pytest.mark.parametrize(
    ("values", "units", "field", "rule"),
    [
        ({"D": -1}, "simulation", "D", "D must be a finite number >= 0, got -1"),
        ({"D": 0.4, "v_p0": "1.7 kg"}, "physical", "v_p0", "must have the dimension L/T"),
        ({"law": "open('x')"}, "simulation", "law", "law"),
    ],
)
def test_a_wrong_value_comes_back_with_its_rule_and_field(page, values, units, field, rule):
    refused = page.answers(values, units=units)["refused"]
    assert refused["field"] == field
    assert rule in refused["message"]


@pytest.mark.parametrize(
    ("message", "rule"),
    [
        ("no JSON", "must be JSON"),
        ("[1]", "a JSON object"),
        ('{"ask": "everything"}', "ask must be one of"),
        ("[" * 40000, "must be JSON"),
        ('{"a": "' + "x" * 70000 + '"}', "at most 65536 characters"),
        (b"\x00", "come with its name"),
        (struct.pack("<I", 6) + b"a.html" + b"x", "must be one of .stl"),
        ('{"ask": "live", "do": "everything"}', "do must be one of"),
        ('{"ask": "live", "do": ["begin"]}', "do must be one of"),
        ('{"ask": "answers", "number": NaN}', "number must be a whole number"),
        ('{"ask": "answers", "number": [[1]]}', "number must be a whole number"),
        ('{"ask": "live", "do": "begin", "subdivisions": 6}', "subdivisions must be"),
        ('{"ask": "answers", "vary": "R"}', "units must be one of"),
        ('{"ask": "answers", "units": "simulation", "values": {}, "vary": 3}', "vary must be"),
        ('{"ask": "answers", "units": "simulation", "values": 3}', "must be names and values"),
    ],
)
def test_what_is_no_message_is_refused_and_the_page_goes_on(page, message, rule):
    page.socket.send(message)
    assert rule in page.until("refused")["message"]


def test_a_live_cell_can_be_changed_poked_stopped_and_saved(page, server, tmp_path_factory):
    page.begin({"D": 0.4, "v_p0": 6.0})
    frame = page.until("frame")
    assert frame["x"].shape == (42, 3)
    assert frame["faces"].shape == (80, 3)
    page.live("pace", value=5.0)
    page.live("change", units="simulation", values={"D": 0.4, "v_p0": 7.0})
    page.live("poke", direction=[1, 0, 0], strength=1.0)
    page.until(lambda m: m["kind"] == "frame" and m["t"] > 1.0)
    page.live("change", units="simulation", values={"D": -4})
    assert page.until("refused")["field"] == "D"
    page.live("poke", direction=[1, 0, 0], strength=10**400)
    assert "too extreme" in page.until("refused")["message"]
    page.live("pause", value=True)
    t = page.until(lambda m: m["kind"] == "frame" and m["paused"])["t"]
    page.live("pace", value=1.0)  # a message, and a frame after it
    assert page.until("frame")["t"] == t
    page.live("lines")
    lines = page.until("lines")["text"]
    assert "am.steps((" in lines
    assert "pokes=[" in lines
    page.live("save", folder="/elsewhere")  # the page does not choose the folder
    page.live("save")
    assert "one run is saved at a time" in page.until("refused")["message"]
    saved = page.until(lambda m: m["kind"] in ("saved", "refused"))
    assert saved["kind"] == "saved", saved
    run = am.load(saved["folder"])
    assert saved["folder"].endswith("explored-1")
    assert not (Path(saved["folder"]).parent / "explored-2").exists()
    assert run.final.t >= t
    assert run["v_p0"][-1] == 7.0


def test_two_servers_in_one_folder_never_save_to_the_same_place(tmp_path):
    assert new_folder(tmp_path).name == "explored-1"
    assert new_folder(tmp_path).name == "explored-2"
    with pytest.raises(am.InvalidInput, match="a folder that takes them"):
        new_folder(tmp_path / "removed")


def test_what_waits_for_a_page_that_takes_nothing_is_bounded():
    page = Connected(1, None)
    for k in range(3 * MAX_WAITING):
        page.tell({"k": k})
    assert len(page.texts) == MAX_WAITING
    assert page.texts[-1] == f'{{"k": {3 * MAX_WAITING - 1}}}'


@pytest.mark.slow
def test_a_browser_that_does_not_return_does_not_stop_the_page(tmp_path):
    blocking = tmp_path / "blocking"
    blocking.write_text("#!/bin/sh\nsleep 30\n")
    blocking.chmod(0o755)
    with explorer(browser=blocking) as (_, address):
        assert got(address)[0].status == 200


@pytest.mark.slow
def test_each_page_has_a_cell_of_its_own(page, address):
    with Page(address) as second:
        second.begin({"D": 0.4, "v_p0": 6.0})
        page.begin({"D": 0.4, "v_p0": 6.0}, start="noise")
        polarized = second.until(lambda m: m["kind"] == "frame" and m["t"] > 0.1)
        noise = page.until(lambda m: m["kind"] == "frame" and 0.1 < m["t"] < 5.0)
        assert polarized["polarity"] > 0.3 > noise["polarity"]


def test_a_page_that_is_left_leaves_no_process(server):
    process, address = server
    before = set(children(process.pid))
    page = Page(address)
    page.begin({"D": 0.4})
    page.until("frame")
    (own,) = set(children(process.pid)) - before
    page.socket.socket.shutdown(socket.SHUT_RDWR)  # as when a browser is killed
    assert gone([own])


@pytest.mark.slow
def test_a_fifth_page_is_told_to_wait():
    """With a server of its own: a page that another test has left may still count."""
    with explorer() as (_, address), ExitStack() as opened:
        *four, fifth = [opened.enter_context(Page(address)) for _ in range(5)]
        message = fifth.next()
        assert len({page.socket.state for page in four}) == 1
        assert message["kind"] == "failed"
        assert "at most 4 pages" in message["message"]


@pytest.mark.parametrize(
    "number",
    [
        pytest.param(signal.SIGINT, marks=pytest.mark.slow),
        pytest.param(signal.SIGTERM, marks=pytest.mark.slow),
        pytest.param(signal.SIGKILL, marks=pytest.mark.slow),
    ],
)
def test_however_the_server_ends_nothing_is_left(number):
    with explorer() as (process, address), Page(address) as page:
        page.begin({"D": 0.4})
        page.ask({"D": 0.4})
        page.until("frame")
        below = children(process.pid)
        assert len(below) == 2
        process.send_signal(number)
        code = process.wait(20)
        assert code == (0 if number != signal.SIGKILL else -signal.SIGKILL)
        assert gone(below)


@pytest.mark.slow
def test_the_server_ends_when_no_page_is_open_for_some_time():
    with explorer("--idle", "1") as (process, address):
        with Page(address):
            time.sleep(2.5)
            assert process.poll() is None
        assert process.wait(20) == 0


@pytest.mark.slow
def test_from_python_it_runs_until_it_is_stopped():
    before = set(children(os.getpid()))
    with am.explore(browser=False) as found:
        assert found.running
        assert got(found.address)[0].status == 200
        assert found.address in repr(found)
        assert f'src="{found.address}"' in found._repr_html_()
        with Page(found.address) as page:
            page.begin({"D": 0.4})
            page.until("frame")
            below = set(children(os.getpid())) - before
            assert len(below) == 2  # one answers, one lets the cell live
    assert not found.running
    assert gone(below)
    assert repr(found) == "Explorer(stopped)"
    found.stop()  # once more does nothing


@pytest.mark.parametrize(
    ("arguments", "rule"),
    [
        (["--idle", "0"], "idle must be a number of seconds from 1"),
        (["-o", "nowhere"], "folder must be an existing folder"),
        (["--set", "D=0.4"], "are only for --export"),
        (["--export", "page.pdf"], "must name a page"),
        (["--export", "nowhere/page.html"], "in a folder that exists"),
        (["--export", "page.html", "--set", "D=0"], "D must be > 0"),
    ],
)
def test_wrong_arguments_are_refused_in_one_line(arguments, rule, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["explore", "--no-browser", *arguments]) == 2
    said = capsys.readouterr().err
    assert said.startswith("amoeboid explore: ")
    assert rule in said
    assert said.count("\n") == 1


def test_without_websockets_the_remedy_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "websockets", None)
    with pytest.raises(am.InvalidInput, match=r"pip install 'amoeboid\[explore\]'"):
        am.explore(browser=False)


def test_the_address_is_on_this_computer_and_has_a_token(address):
    assert address.startswith("http://127.0.0.1:")
    assert len(urlsplit(address).path.strip("/")) >= 32
