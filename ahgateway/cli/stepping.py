"""`--arm LOOP` of `monitor`, which lets executions through one by one by the write gate; and `--plan`."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ahgateway.cli.view import Output
    from ahgateway.clock import Clock
    from ahgateway.codec.station import Station
    from ahgateway.lockstep.stepper import Step
    from ahgateway.transports.base import Link, Tap

Arm = Annotated[
    str | None,
    typer.Option(
        metavar="LOOP", help="Let this loop's executions through one by one, through the write gate; a bench only."
    ),
]
Plan = Annotated[
    bool, typer.Option("--plan", help="Only say which ways of seeing executions are possible, and what each is worth.")
]


def stepped(station: Station, arm: str | None) -> Station:
    """Return the station with the loop that is armed followed step by step.

    Raises:
        ProfileError: There is no such loop.
        StateError: It has no trigger, or the station is no bench.
    """
    if arm is None:
        return station
    from ahgateway.cli.gate_place import loop_named
    from ahgateway.codec.ways import Way
    from ahgateway.lockstep.gate.stepping import check_can_step

    wanted = loop_named(station, arm)
    check_can_step(wanted, station)
    loops = tuple(replace(loop, way=Way.STEPPED) if loop is wanted else loop for loop in station.loops)
    return replace(station, loops=loops)


@contextlib.asynccontextmanager
async def steps(station: Station, link: Link, clock: Clock) -> AsyncIterator[dict[str, Step]]:
    """Yield what lets executions through, for the loops that are followed step by step; armed meanwhile."""
    from ahgateway.codec.ways import Way

    wanted = [loop for loop in station.loops if loop.way is Way.STEPPED]
    if not wanted:
        yield {}
        return
    from ahgateway.cli.gate_place import gate_directory, who_asks
    from ahgateway.lockstep.gate.gate import ARM_MAX_NS, Gate

    async with contextlib.AsyncExitStack() as stack:
        folder = stack.enter_context(gate_directory(station, None))
        found: dict[str, Step] = {}
        for loop in wanted:
            gate = Gate(station, loop, link, clock, folder, who=who_asks(None))
            await stack.enter_async_context(gate.armed("executions one by one", duration_ns=ARM_MAX_NS))
            assert loop.trigger is not None
            typer.echo(f"armed: {loop.trigger.coil} is set for each execution of {loop.name}", err=True)
            found[loop.name] = gate.step
        yield found


async def show_plan(station: Station, output: Output, tap: Tap | None) -> int:
    """Measure, print the plan, and return the exit code: 0 when something can be proven of every loop, else 3."""
    from ahgateway.apps.ways import as_json, is_enough, lines, planned
    from ahgateway.cli.targets import open_target
    from ahgateway.cli.view import Output, print_json
    from ahgateway.clock import WallClock
    from ahgateway.core.verdict import Exit

    clock = WallClock()
    async with open_target(station, clock, tap) as link:
        plans = await planned(station, link, clock)
    if output is Output.JSON:
        for each in plans:
            print_json(as_json(each))
    else:
        for line in lines(plans):
            typer.echo(line)
    return int(Exit.PASS if is_enough(plans) else Exit.INCONCLUSIVE)
