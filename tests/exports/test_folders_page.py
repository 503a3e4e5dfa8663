"""Every command and every Python line of docs/folders.md runs."""

import re
import shlex
from pathlib import Path

import pytest

import amoeboid as am
from amoeboid.cli.main import main

PAGE = (Path(__file__).parents[2] / "docs/folders.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(sh|python)\n(.*?)```", PAGE, flags=re.DOTALL)


@pytest.mark.slow
def test_the_lines_of_the_page_run_in_their_order(tmp_path, monkeypatch, capsys):
    pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    pytest.importorskip("imageio_ffmpeg")
    monkeypatch.chdir(tmp_path)
    p = am.Parameters(D=0.4, v_p0=6.0)
    am.simulate(p, mesh=am.Icosphere(1), until=am.time(0.6), folder="runs/x")
    names = {}
    for kind, block in BLOCKS:
        if kind == "python":
            exec(compile(block, "docs/folders.md", "exec"), names)  # noqa: S102  (our own file)
            continue
        for line in block.splitlines():
            assert main(shlex.split(line)[1:]) == 0, line
    assert (tmp_path / "movie.mp4").is_file()
    assert "D = 0.4, v_p0 = 6" in capsys.readouterr().out


def test_the_commands_of_the_page_that_draw_nothing_run(tmp_path, monkeypatch, capsys):
    """All lines run in the slow test; these take no time."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        "amoeboid.exports.summary.save_picture", lambda path, cell: path.write_bytes(b"png")
    )
    p = am.Parameters(D=0.4, v_p0=6.0)
    am.simulate(p, mesh=am.Icosphere(1), until=am.time(0.1), folder="runs/x")
    lines = [line for kind, block in BLOCKS if kind == "sh" for line in block.splitlines()]
    quick = [line for line in lines if "movie" not in line and "netcdf" not in line]
    assert len(quick) == len(lines) - 2 == 3
    for line in quick:
        assert main(shlex.split(line)[1:]) == 0, line
    assert "D = 0.4, v_p0 = 6" in capsys.readouterr().out


def test_the_page_lists_every_format():
    from amoeboid import exports

    listed = re.findall(r"^\| (`.*?) \|", PAGE, flags=re.MULTILINE)
    found = {name for cell in listed for name in re.findall(r"`(\w+)`", cell)}
    assert set(exports.names()) <= found
