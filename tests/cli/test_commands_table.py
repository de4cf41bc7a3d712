"""The table of commands: every row leads to a command, and says what the command says of itself."""

from __future__ import annotations

from pathlib import Path

import pytest

import ahgateway.cli
from ahgateway.cli.commands import COMMANDS, loaded

ROOFS = {
    "__init__",
    "commands",
    "can_dump",
    "check_ground",
    "compiled_laws",
    "gate_place",
    "pytest_plugin",
    "interrupt",
    "main",
    "repro",
    "stepping",
    "run",
    "page",
    "tape",
    "targets",
    "trace",
    "tune_live",
    "view",
}
"""Modules of the roof that are no command."""


@pytest.mark.parametrize("name", COMMANDS)
def test_a_row_says_the_first_sentence_of_its_command(name: str) -> None:
    help_text = " ".join((loaded(name).help or "").split("\n\n")[0].split())

    assert help_text == COMMANDS[name].text


def test_every_command_module_stands_in_the_table() -> None:
    folder = Path(ahgateway.cli.__file__).parent
    modules = {path.stem for path in folder.glob("*.py")} - ROOFS

    assert modules == {row.place.partition(":")[0] for row in COMMANDS.values()}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_help_has_an_example(name: str) -> None:
    command = loaded(name)
    texts = [each.help or "" for each in getattr(command, "commands", {}).values()] or [command.help or ""]

    assert all("Example" in text for text in texts)
