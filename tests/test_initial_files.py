"""Runs that start from files, on the command line."""

import json
import os
import re
import shutil

import numpy as np
import pytest

from amoeboid.cli.main import main
from amoeboid.config import Config, Initial, anchored, config_from_toml, config_to_toml
from amoeboid.meshes.geometry import area
from amoeboid.validation import InvalidInput
from surface.written import crossing, ellipsoid, inside_out, write_surface

pytestmark = pytest.mark.usefixtures("without_pictures")

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
        '[initial]\nsurface = "shapes/cell.stl"\nperturbation = 1\n[time]\nend = 0.1\n'
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
    longer = told(capsys, "--resume", tmp_path / "b", "--set", "time.end=0.15")
    assert longer["steps"] > whole["steps"]
    direct = told(capsys, "../b/config.toml", "--set", "time.end=0.15", "-o", "d")
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
            assert f"initial.{field} in a configuration file must be" in says
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
        ("surface=folder.stl", "not a regular file"),
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
        ("harmonics=[[99999, 0, 0.3]]", "(l + 1)^2 <= 642"),
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


def test_that_a_shape_was_scaled_is_told(project, tmp_path, capsys):
    """A cell of 25 micrometers becomes one of R0 = 1: so says the manifest, JSON and a terminal."""
    r, faces = ellipsoid()
    write_surface(project / "um.ply", 25 * r, faces)
    given = [f"initial.surface={project / 'um.ply'}", "time.end=0.01"]
    options = [word for setting in given for word in ("--set", setting)]
    in_json = told(capsys, *options, "-o", tmp_path / "a")["initial_shape"]
    assert in_json["repairs"] == []
    says = re.fullmatch(
        r"scaled by ([\d.]+): its area ([\d.]+) must .* 4 pi R0\^2 = 12.5664", in_json["scaling"]
    )
    factor, area_given = (float(x) for x in says.groups())
    assert area_given == pytest.approx(25**2 * area(r, faces), rel=1e-5)
    assert factor == pytest.approx((12.56637 / area_given) ** 0.5, rel=1e-5)
    assert json.loads((tmp_path / "a/manifest.json").read_text())["initial_shape"] == in_json
    longer = told(capsys, "--resume", tmp_path / "a", "--set", "time.end=0.02")
    assert longer["initial_shape"] == in_json
    assert main(["run", *options, "-o", str(tmp_path / "b")]) == 0
    assert f"initial shape: {in_json['scaling']}" in capsys.readouterr().err
    # one that fits, and the sphere itself, are not scaled
    r = r * (12.566370614359172 / area(r, faces)) ** 0.5
    write_surface(project / "fits.ply", r, faces)
    given[0] = f"initial.surface={project / 'fits.ply'}"
    options = [word for setting in given for word in ("--set", setting)]
    assert told(capsys, *options, "-o", tmp_path / "c")["initial_shape"]["scaling"] is None
    assert "initial_shape" not in told(capsys, "--set", "time.end=0.01", "-o", tmp_path / "d")


def test_a_repaired_surface_runs_and_what_was_changed_is_told(project, tmp_path, capsys):
    r, faces = inside_out()
    faces[::3] = faces[::3, ::-1]
    write_surface(project / "cell.stl", np.vstack([r, [9.0, 9.0, 9.0]]), faces)
    (project / "run.toml").write_text(
        "[initial]\nsurface = 'cell.stl'\nrepair = true\nperturbation = 1\n[time]\nend = 0.1\n"
    )
    assert main(["run", str(project / "run.toml"), "--json", "-o", str(tmp_path / "a")]) == 0
    out, err = capsys.readouterr()
    assert re.search(r"^amoeboid run: initial shape: reversed \d+ triangles", err)
    whole = json.loads(out)
    manifest = json.loads((tmp_path / "a/manifest.json").read_text())
    assert manifest["initial_shape"] == whole["initial_shape"]
    assert any("reversed" in change for change in manifest["initial_shape"]["repairs"])
    # the folder repeats it from its copy of the file as it was given
    assert "repair = true" in (tmp_path / "a/config.toml").read_text()
    assert main(["run", str(tmp_path / "a/config.toml"), "--json", "-o", str(tmp_path / "b")]) == 0
    again = json.loads(capsys.readouterr().out)
    assert {k: again[k] for k in SAME} == {k: whole[k] for k in SAME}
    (project / "run.toml").write_text("[initial]\nsurface = 'cell.stl'\n")
    says = refused(capsys, project / "run.toml", "-o", tmp_path / "c")
    assert "or set initial.repair = true" in says


def test_a_damaged_manifest_does_not_keep_a_run_from_going_on(project, tmp_path, capsys):
    told(capsys, project / "run.toml", "-o", tmp_path / "a")
    shapes = ("3", '{"repairs": [NaN], "scaling": null}', '{"repairs": [], "scaling": 1e999}')
    texts = ["{", "[]", "", *(f'{{"initial_shape": {shape}}}' for shape in shapes)]
    for end, text in enumerate(texts, start=1):
        (tmp_path / "a/manifest.json").write_text(text)
        longer = told(capsys, "--resume", tmp_path / "a", "--set", f"time.end={0.3 + 0.01 * end}")
        assert "initial_shape" not in longer


def test_a_surface_that_is_not_repaired_keeps_its_nodes_and_says_so(project, tmp_path, capsys):
    words = ["--set", f"initial.surface={project / 'shapes' / 'cell.stl'}", "--set", "time.end=0.1"]
    assert main(["run", "-o", str(tmp_path / "a"), *words]) == 0
    assert "initial shape: 162 nodes, those of the file\n" in capsys.readouterr().err
    words += ["--set", "mesh.subdivisions=4", "--json"]
    assert main(["run", "-o", str(tmp_path / "b"), *words]) == 0
    err = capsys.readouterr().err
    assert "162 nodes, those of the file; mesh.subdivisions has no effect without init" in err
