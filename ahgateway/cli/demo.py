"""`ahgateway demo`: a fake AH500 on a real socket, followed like any PLC, convicted of a planted fault."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

import typer

from ahgateway.cli.repro import Repro
from ahgateway.cli.tape import Record, Recorded
from ahgateway.cli.view import Output, View

if TYPE_CHECKING:
    from ahgateway.apps.monitor import Monitor
    from ahgateway.fake.plc import FakePlc

PROFILE = "demo"
FAULTY = "TIC-101"
FAULT = "gain-1-percent"
OPERAND = "Kc_Kp"
RATIO = 1.01
RATIO_SPREAD = 0.001
WARM_UP_S = 600
STEP_AT_S = 3.0
STEP_TO = 84.0
FAULT_AT_S = 7.0
DURATION_S = 14.0
COMPARED_MIN = 0.5


@dataclass(frozen=True, slots=True)
class Judged:
    """What the demo found: the exit code, and the sentence behind it."""

    code: int
    text: str


def demo(
    output: Annotated[Output, typer.Option(help="text for people, json for one object per line.")] = Output.TEXT,
    record: Record = None,
    repro: Repro = None,
) -> None:
    """See the whole thing work, without a PLC, in about 15 seconds.

    A fake AH500 with a temperature loop (DPIDE) and a level loop (DPID) is served on a TCP port of this machine and
    followed in lockstep, execution by execution. After 7 seconds the gain inside the temperature loop's instruction
    grows by 1 %, while every register stays as it is. Exit code 0 if and only if exactly this was found.

    Example: ahgateway demo
    """
    import asyncio

    raise typer.Exit(asyncio.run(_demo(output, record, repro)))


async def _demo(output: Output, record: str | None, repro: str | None) -> int:
    import asyncio

    from ahgateway.apps.monitor import Monitor
    from ahgateway.cli.interrupt import stop_event
    from ahgateway.cli.repro import reproduced
    from ahgateway.cli.tape import recorded
    from ahgateway.cli.targets import open_target
    from ahgateway.clock import SECOND, WallClock
    from ahgateway.fake.plc import FakePlc
    from ahgateway.fake.serve import until
    from ahgateway.schema.profile import load
    from ahgateway.transports.server import serve_tcp

    clock = WallClock()
    loaded = load(PROFILE)
    plc = FakePlc(loaded.station(), loaded.fake_setup())
    plc.advance(WARM_UP_S * SECOND)
    server = await serve_tcp(plc, clock=clock)
    target = f"modbus+tcp://127.0.0.1:{server.port}?unit={plc.station.unit}"
    scanned = asyncio.Event()
    scanning = asyncio.ensure_future(until(scanned, plc, clock))
    try:
        station = replace(loaded.station(), target=target)
        async with open_target(station, clock) as link:
            watched = Monitor(station, link, clock)
            tape = Recorded(record, profile_text=loaded.text)
            view = View(watched, clock, output, 0.0, f"ahgateway demo: {target}")
            with (
                reproduced(repro, station) as divergences,
                stop_event() as stop,
                view,
                recorded(tape, station, clock, view.note) as sink,
            ):
                _plant(plc, view)
                async for report in watched.reports(duration_ns=round(DURATION_S * SECOND), stop=stop):
                    view.show(report)
                    sink.take(report)
                    divergences.take(report)
            was_stopped = stop.is_set()
    finally:
        scanned.set()
        await asyncio.gather(scanning, return_exceptions=True)
        await server.close()
    judged = Judged(3, "stopped before the end: nothing is claimed") if was_stopped else judge(watched, plc)
    typer.echo(f"demo: {judged.text}", err=output is Output.JSON)
    return judged.code


def _plant(plc: FakePlc, view: View) -> None:
    """Script the operator's step and the fault, in the PLC's own time from now on."""
    from ahgateway.clock import SECOND

    def step(plc: FakePlc) -> None:
        plc.write(FAULTY, "SV", STEP_TO)
        view.note(f"an operator sets SV of {FAULTY} to {STEP_TO:g}")

    def fail(plc: FakePlc) -> None:
        plc.fail(FAULTY, FAULT)
        view.note(f"planted: the gain inside {FAULTY}'s instruction is {RATIO:g} times {OPERAND} from now on")

    plc.at(plc.now_ns + round(STEP_AT_S * SECOND), step)
    plc.at(plc.now_ns + round(FAULT_AT_S * SECOND), fail)


def judge(watched: Monitor, plc: FakePlc) -> Judged:
    """Say whether exactly the planted fault was found: this loop, this operand, this size, and not too early."""
    followers = {watch.loop.name: watch.follower for watch in watched.watches}
    others = [name for name, follower in followers.items() if name != FAULTY and follower.counts.diverged]
    if others:
        return Judged(1, f"{', '.join(others)} diverged, where nothing was planted")
    counts = {name: follower.summary() for name, follower in followers.items()}
    thin = [name for name, each in counts.items() if each.compared < COMPARED_MIN * each.total]
    follower = followers[FAULTY]
    if follower.first_diverged is None:
        return Judged(3, f"the planted fault in {FAULTY} was not found")
    picture, _ = follower.first_diverged
    number = _executions_since_fault(plc, picture.seen["I_MV+6"], picture.seen["MV"])
    if number is None:
        return Judged(1, f"{FAULTY} diverged before anything was planted")
    suspect = follower.suspects[0]
    is_it = suspect.cause == "gain" and suspect.operand == OPERAND and abs(suspect.ratio - RATIO) <= RATIO_SPREAD
    if not is_it:
        return Judged(1, f"{FAULTY} diverged, but the cause was taken for {suspect.cause}: {suspect.evidence}")
    if thin:
        return Judged(3, f"found, but less than half of the executions of {', '.join(thin)} could be compared")
    return Judged(
        0, f"exactly the planted fault was found, at execution {number} behind it: {suspect.cause}, {suspect.evidence}"
    )


def _executions_since_fault(plc: FakePlc, pv1: object, mv: object) -> int | None:
    """Count from the fault to the convicted execution in the PLC's own log, from 1; None when it lies before."""
    from ahgateway.core.real import bits

    law = plc.items[FAULTY].loop
    number = 0
    for execution in plc.log(FAULTY):
        right, _ = law.controller.step(execution.inputs, execution.before, law.dialect, execution.ts)
        if number or bits(right.mv) != bits(execution.state.mv) or bits(right.i) != bits(execution.state.i):
            number += 1
        if number and bits(execution.state.pv1) == bits(pv1) and bits(execution.state.mv) == bits(mv):  # type: ignore[arg-type]
            return number
    return None
