"""The table of commands: each one's module is imported when it is asked for, so that `--help` stays light.

A row is a command's name, where its function (or its sub-app) stands, and its line in `ahgateway --help`; a test
holds that line to the first sentence of the command's own help.
"""

from __future__ import annotations

from collections.abc import Iterator, MutableMapping
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import typer
from typer.core import TyperGroup
from typer.main import get_command

if TYPE_CHECKING:
    from typer._click import Command as ClickCommand
    from typer._click import Context, HelpFormatter


class Row(NamedTuple):
    """Where a command stands and what `--help` says of it."""

    place: str
    text: str


COMMANDS: dict[str, Row] = {
    "demo": Row("demo:demo", "See the whole thing work, without a PLC, in about 15 seconds."),
    "monitor": Row("monitor:monitor", "Follow every loop of a profile and compare each execution with the reference."),
    "doctor": Row(
        "doctor:doctor",
        "Check ports, adapter, clock and line, and say whether the loops of a profile can be followed over it.",
    ),
    "scan": Row("scan:scan", "Ask every unit of a line or host for one register and say who answers."),
    "read": Row("read:read", "Read devices, or every operand of a loop, once."),
    "replay": Row(
        "replay:replay", "Follow a recording again and list every execution, term by term, PLC beside reference."
    ),
    "info": Row("info:info", "Say what a recording holds: station, loops, time, verdicts, gaps, versions."),
    "export": Row(
        "export:export",
        "Write a recording for other programs: absolute time in UTC, units, operands as the manual spells them.",
    ),
    "import": Row("import_:import_", "Make a recording from a CSV trend of another program."),
    "identify": Row(
        "identify:identify",
        "Learn how the PLC discretises its PID formulas, by eliminating every arithmetic that misses one bit.",
    ),
    "explain": Row(
        "explain:explain",
        "Say what a code, a cause of a divergence or an axis of the dialect means; without a name list them all.",
    ),
    "profile": Row("profile:app", "Check, show, describe and start profiles; sends nothing to any PLC."),
    "commission": Row(
        "commission:commission",
        "Take one loop to a sheet to sign: find the link, settle the map, read the loop, shadow it, prove its wiring.",
    ),
    "check": Row(
        "check:check", "Run scenarios on a bench, a fake in virtual time or a real PLC, and say whether each passes."
    ),
    "write": Row(
        "write:write", "Write operands of one loop, each read back; without --arm only say what would be written."
    ),
    "plc-code": Row(
        "plc_code:plc_code",
        "Write Structured Text for ISPSoft, made from the tables of a profile; sends nothing to any PLC.",
    ),
    "journal": Row("journal:app", "Check and read the journals of the write gate; sends nothing to any PLC."),
    "tune": Row("tune:tune", "Find a loop's process in a recorded trace and propose gains in the loop's own form."),
    "migrate": Row(
        "migrate:migrate",
        "Rebuild a controller's settings for another, name every approximation with its size, and prove the result.",
    ),
    "can": Row("can:app", "Look at a CAN bus, write an EDS, put the fake PLC on a bus."),
    "proxy": Row(
        "proxy:proxy",
        "Pass Modbus between a client and a PLC, and spoil the line on purpose when faults are asked for.",
    ),
    "fake": Row("fake:fake", "Run the PLC of a profile on this machine until Ctrl-C; it touches no real PLC."),
}
"""Every command, in the order in which `--help` lists them."""


def loaded(name: str) -> ClickCommand:
    """Import a command and return it as typer runs it."""
    module, _, attribute = COMMANDS[name].place.partition(":")
    found: Any = getattr(import_module(f"ahgateway.cli.{module}"), attribute)
    roof = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    if isinstance(found, typer.Typer):
        roof.add_typer(found, name=name)
        group: Any = get_command(roof)
        return cast("ClickCommand", group.commands[name])
    roof.command(name=name)(found)
    return get_command(roof)


class _Lazy(MutableMapping[str, Any]):
    """The table as typer wants it: names at once, commands on demand."""

    def __init__(self) -> None:
        self._known: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in COMMANDS:
            raise KeyError(name)
        if name not in self._known:
            self._known[name] = loaded(name)
        return self._known[name]

    def __contains__(self, name: object) -> bool:
        return name in COMMANDS

    def __setitem__(self, name: str, command: Any) -> None:
        self._known[name] = command

    def __delitem__(self, name: str) -> None:
        del self._known[name]

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __len__(self) -> int:
        return len(COMMANDS)


class LazyGroup(TyperGroup):
    """A group that knows its commands' names and lines without importing them."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands = _Lazy()

    def list_commands(self, ctx: Context) -> list[str]:
        return list(COMMANDS)

    def format_commands(self, ctx: Context, formatter: HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, row.text) for name, row in COMMANDS.items()])
