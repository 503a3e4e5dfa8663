"""`amoeboid show`: what a run is, a month later."""

import json
import re
import shutil

import pytest
from matplotlib.image import imread

import amoeboid as am
from amoeboid.cli.main import main

P = am.Parameters(D=0.4, v_p0=6.0)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    am.simulate(P, mesh=am.Icosphere(1), folder=folder / "x")
    am.simulate(
        am.Parameters.physical(), mesh=am.Icosphere(1), until=am.time("20 s"), folder=folder / "y"
    )
    return folder


@pytest.fixture
def quick(monkeypatch):
    """Pictures are empty: each takes a process of its own."""
    monkeypatch.setattr(
        "amoeboid.exports.summary.save_picture", lambda path, cell: path.write_bytes(b"png")
    )


@pytest.fixture
def folder(made, tmp_path):
    shutil.copytree(made, tmp_path / "runs")
    return tmp_path / "runs"


@pytest.mark.usefixtures("quick")
def test_a_summary_says_what_the_run_is_and_where_its_picture_is(folder, capsys):
    assert main(["show", str(folder / "x")]) == 0
    out, err = capsys.readouterr()
    assert not err
    run = am.load(folder / "x")
    assert out.startswith("D = 0.4, v_p0 = 6, all else as in the paper's table\n")
    assert re.search(r"^ended +steady$", out, re.MULTILINE)
    assert re.search(rf"^steps +{run.last.number}$", out, re.MULTILINE)
    assert re.search(rf"^frames +{len(run.frames)}, from t = 0 T to ", out, re.MULTILINE)
    assert re.search(r"^written by +amoeboid \d", out, re.MULTILINE)
    assert re.search(
        rf"^max_retrograde_speed +{run['max_retrograde_speed'][-1]:.6g} L/T$", out, re.MULTILINE
    )
    assert f"decays at {-run.growth_rate:.3g} +- " in out
    assert f"picture in {folder / 'x/cell.png'}\n" in out
    assert (folder / "x/cell.png").is_file()
    assert str(run.show()) == out.rstrip("\n")
    assert "<img" in run.show()._repr_html_()


@pytest.mark.usefixtures("quick")
def test_a_physical_run_is_shown_in_its_units(folder, tmp_path, capsys):
    picture = tmp_path / "cell.png"
    assert main(["show", str(folder / "y"), "--plot", str(picture)]) == 0
    out = capsys.readouterr().out
    assert re.search(r"^t +20 s$", out, re.MULTILINE)
    assert re.search(r"^c_rear +[\d.]+ 1/um\^2$", out, re.MULTILINE)
    assert picture.is_file()
    assert not (folder / "y/cell.png").exists()
    assert main(["show", str(folder / "y"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["t"], found["units"]["t"]) == (20.0, "s")
    assert found["units"]["c_rear"] == "1/um^2"
    assert found["picture"] == str(folder / "y/cell.png")


def test_a_run_without_a_checkpoint_shows_what_is_left(folder, capsys):
    (folder / "x/checkpoint.npz").unlink()
    assert main(["show", str(folder / "x")]) == 1
    out, err = capsys.readouterr()
    assert re.search(r"^ended +steady$", out, re.MULTILINE)
    assert "has no checkpoint.npz" in err
    assert err.count("\n") == 1
    assert imread(folder / "x/cell.png").shape == (1100, 1500, 3)  # of the last frame


@pytest.mark.usefixtures("quick")
def test_a_run_without_a_time_series_says_so(folder, capsys):
    (folder / "x/timeseries.csv").unlink()
    assert main(["show", str(folder / "x"), "--json"]) == 1
    out, err = capsys.readouterr()
    assert "has no row in timeseries.csv" in err
    assert json.loads(out)["problems"] == [err.removeprefix("amoeboid show: ").rstrip()]


@pytest.mark.usefixtures("quick")
def test_a_summary_names_the_environment_of_the_path(tmp_path, capsys):
    am.simulate(P, mesh=am.Icosphere(1), until=am.time(0.02), environment="patch:20",
                folder=tmp_path / "x")  # fmt: skip
    picture = tmp_path / "new/cell.png"
    assert main(["show", str(tmp_path / "x"), "--plot", str(picture)]) == 0
    assert re.search(r"^path in +patch, half_angle 20$", capsys.readouterr().out, re.MULTILINE)
    assert picture.is_file()
    assert main(["show", str(tmp_path / "x"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["environment"] == "patch, half_angle 20"


def test_what_is_no_run_is_refused(tmp_path, folder, capsys):
    assert main(["show", str(tmp_path)]) == 2
    assert "needs the folder of a run" in capsys.readouterr().err
    assert main(["show", str(folder / "x"), "--plot", "a.jpg"]) == 2
    assert "must be a file of type .png" in capsys.readouterr().err


@pytest.mark.usefixtures("quick")
def test_a_run_in_memory_is_shown_without_a_picture(tmp_path):
    run = am.simulate(P, mesh=am.Icosphere(1), until=am.time(0.1))
    shown = run.show()
    assert shown.picture is None
    assert "written by" not in str(shown)
    assert run.show(tmp_path / "cell.png").picture.is_file()
    assert len(repr(shown)) < 1000
