"""`amoeboid run`."""

from __future__ import annotations

import argparse

from amoeboid.cli.settings import add_settings


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `run`."""
    add_settings(parser)


def execute(args: argparse.Namespace) -> int:
    """Run a simulation."""
    raise SystemExit(1)
