"""The explorer against other users, broken programs and strange messages."""

import json
import os
import signal
import struct
import time
from contextlib import ExitStack
from urllib.parse import urlsplit

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from amoeboid.explorer import peers
from explore.requests import got
from explore.serving import Page, children, explorer, origin_of

D4 = {"D": 0.4, "v_p0": 5.5}


def test_a_browser_is_started_with_an_address_that_is_good_once(tmp_path):
    told = tmp_path / "told"
    opener = tmp_path / "opener"
    opener.write_text(f'#!/bin/sh\necho "$*" > {told}.part\nmv {told}.part {told}\n')
    opener.chmod(0o755)
    with explorer(browser=opener) as (_, address):
        end = time.monotonic() + 30
        while not told.exists() and time.monotonic() < end:
            time.sleep(0.05)
        once = told.read_text().strip()
        token = urlsplit(address).path.strip("/")
        assert token not in once  # everyone may list the arguments of programs
        base, code = origin_of(address), urlsplit(once).path
        assert got(base, "/once/")[0].status == 403
        assert got(base, "/once/guess")[0].status == 403  # and the right one still works
        assert got(base, code, {"Origin": "http://elsewhere.example"})[0].status == 403
        answer, _ = got(base, code)
        assert answer.status == 303
        assert answer.headers["Location"] == f"/{token}/"
        answer, body = got(base, code)
        assert answer.status == 403
        assert b"once only" in body
        assert answer.headers["Location"] is None


def test_the_program_of_another_user_is_known_by_the_table_of_linux(monkeypatch, tmp_path):
    table = tmp_path / "tcp"
    row = "  0: 0100007F:{:04X} 0100007F:{:04X} 01 0:0 00:0 0 {} 0 1 2\n"
    table.write_text("head\n" + row.format(4000, 80, 1001) + row.format(4001, 80, os.getuid()))
    monkeypatch.setattr(peers, "TABLE", table)
    monkeypatch.setattr(peers.sys, "platform", "linux")
    here = ("127.0.0.1", 80)
    assert peers.is_of_another_user(("127.0.0.1", 4000), here)
    assert not peers.is_of_another_user(("127.0.0.1", 4001), here)
    assert not peers.is_of_another_user(("127.0.0.1", 4002), here)
    monkeypatch.setattr(peers, "TABLE", tmp_path / "none")
    assert not peers.is_of_another_user(("127.0.0.1", 4000), here)


@pytest.mark.parametrize(
    "values",
    [
        '{"D": NaN}',
        '{"D": Infinity}',
        '{"v_p0": 1e308}',
        '{"v_p0": 1' + "0" * 400 + "}",
        '{"delta_P": 1e-300, "eta_b": 1e300}',
        '{"D": null}',
        '{"law": "c*9**9**9**9**9"}',
        '{"law": "v_p0*exp(exp(exp(c)))"}',
        '{"stress": "c**c**c**c"}',
        '{"gamma_share": 2}',
        '{"D": {"D": {}}}',
        '{"": 1}',
    ],
)
def test_values_that_nothing_can_be_computed_from_are_refused(page, values):
    page.number += 1
    point = f'"units": "simulation", "values": {values}}}'
    page.socket.send(f'{{"ask": "answers", "number": {page.number}, {point}')
    message = page.until(lambda m: m["kind"] in ("refused", "branch", "failed"))
    assert message["kind"] == "refused" or message["problems"], message
    page.socket.send(f'{{"ask": "live", "do": "begin", "subdivisions": 1, {point}')
    message = page.until(lambda m: m["kind"] in ("refused", "failed") or bool(m.get("problem")))
    assert message["kind"] in ("refused", "frame"), message


@pytest.mark.parametrize("name", ["a.stl", "a.ply", "a.obj", "a.vtp"])
@pytest.mark.parametrize("content", [b"ply\nsolid x\nv 1 2", None])
def test_a_file_that_is_no_surface_is_refused(page, name, content):
    content = os.urandom(10**5) if content is None else content
    page.socket.send(struct.pack("<I", len(name)) + name.encode() + content)
    page.until("surface")
    page.begin(D4, start="surface")
    message = page.until(lambda m: m["kind"] in ("refused", "failed", "begun"))
    assert message["kind"] == "refused", message


@pytest.mark.slow
def test_a_long_message_is_refused_and_one_that_is_too_long_ends_the_connection(page, address):
    page.socket.send("x" * 10**7)
    assert "at most 65536 characters" in page.until("refused")["message"]
    with Page(address) as other:
        other.socket.send(b"\x00" * (33 * 2**20))
        with pytest.raises(ConnectionClosed):
            other.until("never", 20)
    assert page.answers(D4)["states"]


@pytest.mark.slow
def test_saving_before_there_is_a_cell_leaves_no_folder(tmp_path):
    with explorer("-o", str(tmp_path)) as (_, address), Page(address) as page:
        page.live("save")
        assert "a cell must live" in page.until("refused")["message"]
        assert list(tmp_path.iterdir()) == []
        (tmp_path / "explored-1").write_text("a file of that name")
        page.begin(D4)
        page.until("frame")
        page.live("pause", value=True)
        page.live("save")
        saved = page.until(lambda m: m["kind"] in ("saved", "refused"))
        assert saved["folder"].endswith("explored-2")


@pytest.mark.slow
def test_a_hundred_connections_leave_the_page_alone(page, address):
    live = address.replace("http:", "ws:") + "live"
    refused = 0
    with ExitStack() as opened:
        sockets = [
            opened.enter_context(connect(live, origin=origin_of(address), compression=None))
            for _ in range(100)
        ]
        for socket in sockets[3:]:
            refused += "at most 4 pages" in socket.recv(timeout=30)
        assert refused == 97
        assert page.answers(D4)["states"]
    assert got(address)[0].status == 200


@pytest.mark.slow
def test_a_client_that_reads_nothing_costs_no_memory(server, address):
    def resident():
        with open(f"/proc/{server[0].pid}/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGESIZE")

    with Page(address) as page:
        page.begin(D4, subdivisions=3)
        page.until("frame")
        before = resident()
        for number in range(2000):  # each is refused, and nobody reads that
            page.send(ask="nothing", number=number)
        time.sleep(5.0)
        assert resident() - before < 10e6


@pytest.mark.slow
@pytest.mark.parametrize("which", [0, 1])
def test_a_process_that_is_killed_is_told_and_started_again(which):
    with explorer() as (process, address), Page(address) as page:
        page.answers(D4)
        page.begin(D4)
        page.until("frame")
        pid = sorted(children(process.pid))[which]
        os.kill(pid, signal.SIGKILL)
        assert "ended from outside" in page.until("failed")["message"]
        assert page.answers(D4)["states"]
        page.begin(D4)
        page.until("begun")


@pytest.mark.slow
def test_a_server_that_is_killed_ends_the_connection():
    with explorer() as (process, address), Page(address) as page:
        process.send_signal(signal.SIGKILL)
        with pytest.raises(ConnectionClosed):
            page.until("never", 20)


@pytest.mark.parametrize(
    "path",
    ["%2e%2e/server.py", "..\\server.py", "/etc/passwd", "app.js/../../server.py", "a" * 7000],
)
def test_no_path_leads_out_of_the_page(address, path):
    answer, body = got(address, path)
    assert answer.status in (404, 403, 400)
    assert b"import" not in body


def test_a_poke_from_infinity_is_refused(page):
    page.begin(D4)
    page.until("begun")
    page.socket.send(
        json.dumps({"ask": "live", "do": "poke", "direction": [0, 0, float("inf")], "strength": 1})
    )
    assert "direction that is not zero" in page.until("refused")["message"]
