"""Files and folders that a command does not take: what to do with them instead."""

import pytest

from amoeboid.cli.main import main
from amoeboid.validation import InvalidInput, refuse_unknown


@pytest.mark.parametrize(
    ("command", "name", "content", "message"),
    [
        ("run", "my bumps.STL", "solid", "is a surface; start a run from it with amoeboid run "
         "--set initial.surface='my bumps.STL' (with --set initial.repair=true"),
        ("sweep", "cell.ply", "ply", "is a surface; start a run"),
        ("run", "s.toml", "[solver]\nname='theory'\n[vary]\nD=[1,2]",
         "describes a sweep; use amoeboid sweep s.toml"),
        ("sweep", "r.toml", "[time]\nend=3.0", "describes a run; use amoeboid run r.toml"),
        ("run", "plain", None, "is a folder; give the TOML file in it"),
        ("run", "none/x.toml", "missing", "No such file 'none/x.toml'; run needs"),
        ("run", "broken.toml", "D = [", "'broken.toml' must be valid TOML"),
    ],
)  # fmt: skip
def test_another_kind_of_file_is_told_where_it_belongs(
    command, name, content, message, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    if content == "missing":
        pass
    elif content is None:
        (tmp_path / name).mkdir()
    else:
        (tmp_path / name).write_text(content)
    assert main([command, name]) == 2
    assert message in capsys.readouterr().err


def test_the_folder_of_a_run_is_continued_or_repeated(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "config.toml").write_text("")
    assert main(["run", "x"]) == 2
    assert "continue its run with --resume x, or repeat it with x/config.toml" in (
        capsys.readouterr().err
    )


def test_an_unknown_name_gets_its_hint_before_a_short_list():
    known = [f"name_{k}" for k in range(60)]
    with pytest.raises(InvalidInput) as error:
        refuse_unknown(["nam_7"], known, "field", source="amoeboid run --help")
    text = str(error.value)
    assert text.startswith("unknown field 'nam_7'; did you mean name_7? allowed: name_0, ")
    assert text.endswith("name_19 and 40 more, see amoeboid run --help")
