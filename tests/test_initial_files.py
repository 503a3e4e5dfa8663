"""Runs that start from files, on the command line."""

import json
import os
import shutil

import pytest

from amoeboid.cli.main import main
from amoeboid.config import Config, Initial, anchored, config_from_toml, config_to_toml
from amoeboid.validation import InvalidInput
from surface.written import crossing, ellipsoid, inside_out, write_surface

SAME = ("max_retrograde_speed", "c_front", "c_rear", "zeta0", "steps")


def told(capsys, *arguments):
    assert main(["run", *map(str, arguments), "--json"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    return json.loads(out)


@pytest.fixture
def project(tmp_path):
    """A folder with a configuration that names a surface, inside a folder with another one."""
    folder = tmp_path / "project"
    (folder / "shapes").mkdir(parents=True)
    write_surface(folder / "shapes" / "cell.stl", *ellipsoid())
    write_surface(tmp_path / "outside.stl", *ellipsoid())
    (folder / "run.toml").write_text(
        '[initial]\nsurface = "shapes/cell.stl"\nperturbation = 1\n[time]\nend = 0.3\n'
    )
    return folder


def test_a_run_keeps_what_it_started_from(project, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    whole = told(capsys, "project/run.toml", "-o", "a")
    assert (tmp_path / "a" / "initial_surface.stl").is_file()
    assert 'surface = "initial_surface.stl"' in (tmp_path / "a/config.toml").read_text()
    assert str(tmp_path) not in (tmp_path / "a/manifest.json").read_text()
    shutil.rmtree(project)
    # from another place, after the original is gone, and after the folder has moved
    (tmp_path / "a").rename(tmp_path / "b")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    again = told(capsys, "../b/config.toml", "-o", "c")
    assert {k: again[k] for k in SAME} == {k: whole[k] for k in SAME}
    longer = told(capsys, "--resume", tmp_path / "b", "--set", "time.end=0.4")
    assert longer["steps"] > whole["steps"]
    direct = told(capsys, "../b/config.toml", "--set", "time.end=0.4", "-o", "d")
    assert direct["zeta0"] == pytest.approx(longer["zeta0"], rel=1e-3)


def test_a_run_goes_on_from_a_frame(project, tmp_path, capsys):
    told(capsys, project / "run.toml", "-o", tmp_path / "a")
    frames = sorted((tmp_path / "a/frames").iterdir())
    setting = f"initial.from_frame={frames[-1]}"
    b = told(capsys, "--set", setting, "--set", "time.end=0.2", "-o", tmp_path / "b")
    assert (tmp_path / "b/initial_frame.vtp").read_bytes() == frames[-1].read_bytes()
    text = (tmp_path / "b/config.toml").read_text()
    assert 'from_frame = "initial_frame.vtp"' in text
    # left open: it follows from the frame
    assert "perturbation" not in text
    assert json.loads((tmp_path / "b/manifest.json").read_text())["initial"]["perturbation"] == 0
    again = told(capsys, tmp_path / "b/config.toml", "-o", tmp_path / "c")
    assert {k: again[k] for k in SAME} == {k: b[k] for k in SAME}


def test_a_path_on_the_command_line_may_lead_anywhere(project, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(project)
    short = ["--set", "time.end=0.01"]
    told(capsys, *short, "--set", "initial.surface=../outside.stl", "-o", "a")
    told(capsys, *short, "--set", f"initial.surface={tmp_path / 'outside.stl'}", "-o", "b")
    # and it replaces the one in the file
    (project / "shapes/cell.stl").unlink()
    told(capsys, "run.toml", *short, "--set", "initial.surface=../outside.stl", "-o", "c")


def refused(capsys, *arguments):
    assert main(["run", *map(str, arguments), "--json"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("amoeboid run: ")
    return err


def test_paths_from_a_file_never_leave_its_folder(project, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(project)
    (project / "link.stl").symlink_to(tmp_path / "outside.stl")
    (project / "up").symlink_to(tmp_path)
    (project / "loop.stl").symlink_to("loop.stl")
    (project / "good.stl").symlink_to("shapes/cell.stl")
    for field in ("surface", "from_frame"):
        for path in (
            "../outside.stl",
            "shapes/../../outside.stl",
            str(tmp_path / "outside.stl"),
            str(project / "shapes/cell.stl"),
            "link.stl",
            "up/outside.stl",
            "../missing.stl",
        ):
            (project / "bad.toml").write_text(f"[initial]\n{field} = '{path}'\n")
            says = refused(capsys, "bad.toml", "-o", "out")
            assert f"initial.{field} in a configuration file must lead to" in says
            assert f"--set initial.{field}=PATH" in says
        (project / "bad.toml").write_text(f"[initial]\n{field} = 'loop.stl'\n")
        assert f"initial.{field} must" in refused(capsys, "bad.toml", "-o", "out")
    assert not (project / "out").exists()
    # a folder reached through a link is the folder; a link that stays inside is one more name
    (tmp_path / "alias").symlink_to(project)
    (project / "run.toml").write_text("[initial]\nsurface = 'good.stl'\n[time]\nend = 0.01\n")
    told(capsys, tmp_path / "alias" / "run.toml", "-o", "out")


def test_a_stored_run_whose_copy_leads_out_is_refused(project, tmp_path, capsys):
    told(capsys, project / "run.toml", "-o", tmp_path / "a")
    path = tmp_path / "a/config.toml"
    path.write_text(path.read_text().replace("initial_surface.stl", "../outside.stl"))
    says = refused(capsys, "--resume", tmp_path / "a", "--set", "time.end=1")
    assert "keeps [initial]" in says


def test_wrong_files_are_refused_with_one_line(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_surface(tmp_path / "inside_out.ply", *inside_out())
    write_surface(tmp_path / "crossing.obj", *crossing())
    (tmp_path / "garbage.stl").write_bytes(bytes(range(256)) * 20)
    (tmp_path / "folder.stl").mkdir()
    for setting, says in (
        ("surface=missing.stl", "initial.surface must be a readable file, got 'missing.stl'"),
        ("surface=folder.stl", "no regular file"),
        ("surface=garbage.stl", "no triangles were found"),
        ("surface=inside_out.ply", "must be oriented outward"),
        ("surface=crossing.obj", "must not intersect or touch itself"),
        ("surface=3", "initial.surface must be the path of a file, or left out, got 3"),
        ("surface=' '", "initial.surface must be the path of a file"),
        ("from_frame=missing.vtp", "initial.from_frame must be a readable file"),
        ("from_frame=garbage.stl", "initial.from_frame must be a file of type .vtp"),
        ("harmonics=3", "initial.harmonics must be a list of [l, m, amplitude]"),
        ("harmonics=[[2, 3, 0.1]]", "|m| <= l"),
        ("harmonics=[[2, 0.5, 0.1]]", "|m| <= l"),
        ("harmonics=[[-1, 0, 0.1]]", "|m| <= l"),
        ("harmonics=[[1, 0, inf]]", "a finite number"),
        ("harmonics=[[1, 0]]", "a list of"),
        ("harmonics=[[1, 0, true]]", "a list of"),
        ("harmonics=[2, 0, 0.3]", "a list of"),
        ("harmonics=[[99999, 0, 0.3]]", "(l + 1)^2 <= 642 nodes"),
    ):
        err = refused(capsys, "--set", f"initial.{setting}", "-o", "out")
        assert says in err
    both = ["--set", "initial.surface=a.stl", "--set", "initial.from_frame=b.vtp"]
    assert "one initial shape" in refused(capsys, *both)
    assert not (tmp_path / "out").exists()


def test_the_fields_read_back_equal_and_are_led_from_the_folder(tmp_path):
    config = Config(initial=Initial(surface="a b/ä'\".stl", harmonics=[[2, -1, 1], (0, 0, 0.5)]))
    assert config.initial.harmonics == ((2, -1, 1.0), (0, 0, 0.5))
    assert config_from_toml(config_to_toml(config)) == config
    led = anchored(config, tmp_path).initial.surface
    assert led == os.path.join(tmp_path, "a b/ä'\".stl")
    with pytest.raises(InvalidInput, match="path of a file"):
        Initial(from_frame="a\0b.vtp")
