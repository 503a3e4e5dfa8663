"""`amoeboid figure`: what it does with wrong input, several figures, and cells in other units."""

import csv
import json

import pytest

from amoeboid import InvalidInput, Parameters
from amoeboid.cli.main import main
from amoeboid.cli.settings import parameters_from


def test_a_figure_that_cannot_be_made_does_not_stop_the_others(tmp_path, capsys):
    # without growth there is no flow to draw in figure 2B; the table has numbers all the same
    command = ["figure", "fig2b", "table", "-o", str(tmp_path), "--set", "v_p0=0", "--json"]
    assert main(command) == 1
    out, err = capsys.readouterr()
    document = json.loads(out)
    assert document["fig2b"]["files"] == []
    assert "v_p0" in document["fig2b"]["problems"][0]
    assert "fig2b could not be made" in err
    assert (tmp_path / "table.png").exists()


def test_a_figure_alone_that_cannot_be_made_is_a_mistake_of_the_user(tmp_path, capsys):
    assert main(["figure", "fig2b", "-o", str(tmp_path), "--set", "v_p0=0"]) == 2
    assert "v_p0" in capsys.readouterr().err


def test_all_figures_with_parameters_that_none_of_them_has_are_refused(tmp_path, capsys):
    assert main(["figure", "all", "-o", str(tmp_path / "new"), "--set", "nonsense=1"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "new").exists()


def test_of_all_figures_those_in_other_units_are_left_out_and_named(tmp_path, capsys, monkeypatch):
    made = []
    monkeypatch.setattr(
        "amoeboid.cli.figure._made", lambda figure, *_: (made.append(figure.name) or {}, 0)
    )
    assert main(["figure", "all", "-o", str(tmp_path), "--set", "R0=2"]) == 1
    left_out = {"s_alpha", "s_cylinder", "s_monomers"}
    err = capsys.readouterr().err
    assert not left_out & set(made)
    assert all(f"{name} could not be made" in err for name in left_out)
    assert "fig3a" in made


def test_a_cell_in_physical_units_takes_quantities_alone(tmp_path, capsys):
    """A bare number would be one of 10 um."""
    command = ["figure", "s_cylinder", "-o", str(tmp_path), "--set"]
    assert main([*command, "R0=20"]) == 2
    assert "dimension L" in capsys.readouterr().err
    assert main([*command, "R0=20 um"]) == 0
    capsys.readouterr()
    lines = (tmp_path / "s_cylinder-cell.csv").read_text().splitlines()
    (row, *_) = csv.DictReader(line for line in lines if not line.startswith("#"))
    assert float(row["h_over_R0"]) == pytest.approx(0.190 / 20)


def test_settings_keep_what_the_cell_of_a_figure_has_of_its_own():
    own = Parameters.physical(R0="8 um", law="inverse")
    found = parameters_from(["D=0.05 um^2/s"], False, own)
    assert found.description == own.replace(D=found.D).description
    assert found.units.length == pytest.approx(8e-6)
    with pytest.raises(InvalidInput, match="dimension"):
        parameters_from(["D=3"], False, own)


@pytest.mark.parametrize("name", ["file", "file/below"])
def test_a_folder_that_is_a_file_is_refused(name, tmp_path, capsys):
    (tmp_path / "file").write_text("mine")
    assert main(["figure", "fig2b", "-o", str(tmp_path / name)]) == 2
    assert "file" in capsys.readouterr().err
    assert (tmp_path / "file").read_text() == "mine"
