"""Help texts: they fit the terminal, and their examples can be pasted."""

import shlex

import pytest

from amoeboid.cli.help import EXAMPLE
from amoeboid.cli.main import COMMANDS, _parser


def helped(command, columns, monkeypatch, capsys):
    """What `amoeboid COMMAND --help` prints on a terminal of so many columns."""
    monkeypatch.setenv("COLUMNS", str(columns))
    with pytest.raises(SystemExit):
        _parser([command, "--help"]).parse_args([command, "--help"])
    return capsys.readouterr().out


@pytest.mark.parametrize("columns", [50, 80])
@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_every_command_fits_the_terminal(command, columns, monkeypatch, capsys):
    _, _, text = helped(command, columns, monkeypatch, capsys).partition("\n\n")
    lines = [line for line in text.splitlines() if not line.startswith(EXAMPLE)]
    assert lines
    # a single word may be longer: argparse and terminals do not divide it
    assert [line for line in lines if len(line) > columns and " " in line.strip()] == []


@pytest.mark.parametrize("command", COMMANDS)
def test_examples_in_the_help_are_commands(command, monkeypatch, capsys):
    text = helped(command, 50, monkeypatch, capsys)
    for line in text.splitlines():
        if line.startswith(EXAMPLE):
            program, name, *arguments = shlex.split(line)
            assert (program, name) == ("amoeboid", command)
            assert _parser([name]).parse_args([name, *arguments]).command == command
