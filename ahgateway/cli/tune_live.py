"""The live half of `ahgateway tune`: experiments and gains through the write gate."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import typer

from ahgateway.cli.gate_place import gate_directory, loop_named, until_stopped, who_asks
from ahgateway.cli.tape import Recorded, one_loop, recorded

if TYPE_CHECKING:
    from ahgateway.apps.tune import Tuning
    from ahgateway.apps.tune_session import Gains, Live, Session
    from ahgateway.apps.tune_sitting import Envelope
    from ahgateway.codec.station import Loop, Station
    from ahgateway.lockstep.gate.place import Place
    from ahgateway.tuning.record import Record

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Asked:
    """What was typed; `sv_size` and `sv_hold_s` belong to the proof of gains."""

    profile: str
    arm: str | None
    loop: str | None
    experiment: str | None
    size: float | None
    hold_s: float | None
    pv: tuple[float, float] | None
    mv: tuple[float, float] | None
    rate: float | None
    seconds: float
    target: str | None
    save: Path | None
    repeat: int = 1
    apply: str | None = None
    sv_size: float | None = None
    sv_hold_s: float | None = None
    recording: str | None = None
    with_frames: bool = False
    hysteresis: float | None = None
    bias: float = 0.25


def excited(asked: Asked, directory: Path | None, judge: Callable[..., Tuning]) -> Live:
    """Carry out the experiments, judge each, and try the gains that were asked for.

    Raises:
        ProfileError: What was asked for cannot be, or the loop is not armed.
        StateError: It was aborted; everything has been put back.
    """
    from ahgateway.apps.tune_experiment import Kind, Wanted
    from ahgateway.errors import ProfileError

    kinds = {kind.value: kind for kind in Kind}
    if asked.experiment not in kinds:
        raise ProfileError(f"`{asked.experiment}` is no experiment, known are {', '.join(kinds)}", key="--experiment")
    station, loop, tape = _found(asked)
    wanted = Wanted(kinds[asked.experiment], asked.size, asked.hold_s, asked.hysteresis, asked.bias)
    bounds = envelope(asked, loop)
    if asked.arm is None:
        raise ProfileError(
            f"{wanted.kind.value} on loop {loop.name}, PV within {bounds.pv[0]:g}…{bounds.pv[1]:g}, MV within "
            f"{bounds.mv[0]:g}…{bounds.mv[1]:g}, {bounds.time_s:g} s at most: nothing was sent",
            hint=f"--arm {loop.name} does it",
        )
    gains, within = _gains(asked), partial(judge, writable=frozenset(loop.writes))
    live = _at_the_loop(
        station,
        loop,
        bounds,
        directory,
        tape,
        lambda session: session.excited(wanted, within, asked.repeat, gains),
    )
    if asked.save is not None and live.record is not None:
        _saved(asked.save, live.record)
    return live


def applied(asked: Asked, directory: Path | None, result: Tuning) -> Live:
    """Try gains that a file gave on a live loop; without arming only say what would be written.

    Raises:
        ProfileError: What was asked for cannot be.
        StateError: Refused, or aborted and everything put back.
    """
    station, loop, tape = _found(asked)
    from ahgateway.apps.tune_session import Live

    gains = _gains(asked)
    assert gains is not None

    async def work(session: Session) -> Live:
        if asked.arm is None:
            return await session.previewed(result, gains.rule)
        return Live(result, (result,), proof=await session.tried(result, gains))

    return _at_the_loop(station, loop, envelope(asked, loop), directory, tape, work)


def _gains(asked: Asked) -> Gains | None:
    from ahgateway.apps.tune_session import Gains

    return None if asked.apply is None else Gains(asked.apply, asked.sv_size, asked.sv_hold_s)


def _at_the_loop(
    station: Station, loop: Loop, bounds: Envelope, directory: Path | None, tape: Recorded,
    work: Callable[[Session], Coroutine[Any, Any, Result]],
) -> Result:  # fmt: skip
    """Open the link, do the work, and end in good order at a signal."""
    from ahgateway.apps.tune_session import Session
    from ahgateway.cli.targets import open_target
    from ahgateway.clock import WallClock

    def told(text: str) -> None:
        typer.echo(text, err=True)

    async def run(folder: Place) -> Result:
        clock = WallClock()
        with recorded(tape, one_loop(station, loop), clock, told) as sink:
            async with open_target(station, clock, sink.tap) as link:
                session = Session(
                    station, loop, link, clock, folder, bounds,
                    who=who_asks(None), told=told, witness=sink.witness(loop),
                )  # fmt: skip
                return await until_stopped(work(session))

    with gate_directory(station, directory) as folder:
        return asyncio.run(run(folder))


def rolled_back(asked: Asked, directory: Path | None) -> str:
    """Put back what the last kept run wrote; return how that went.

    Raises:
        ProfileError: The loop is not armed.
        StateError: Something could not be put back.
    """
    from ahgateway.apps.tune_sitting import Envelope
    from ahgateway.errors import ProfileError, StateError

    if asked.arm is None:
        raise ProfileError("--rollback changes something and needs --arm LOOP")
    station, loop, tape = _found(asked)

    bounds = Envelope((-math.inf, math.inf), (-math.inf, math.inf))
    restored = _at_the_loop(
        station, loop, bounds, directory, tape, lambda session: session.gate.recover("tune: rolled back")
    )
    if restored is None:
        return f"{loop.name}: there is nothing to put back"
    if not restored.is_clean:
        raise StateError(
            f"loop {loop.name}: {restored.text(loop)}",
            hint="look at the loop; `ahgateway write --accept` takes it as it stands",
        )
    return f"{loop.name}: {restored.text(loop)}"


def _found(asked: Asked) -> tuple[Station, Loop, Recorded]:
    from ahgateway.cli.targets import resolved
    from ahgateway.errors import ProfileError
    from ahgateway.schema.profile import load

    if asked.arm and asked.loop and asked.arm != asked.loop:
        raise ProfileError(f"--arm {asked.arm} and --loop {asked.loop} name two loops")
    loaded = load(asked.profile)
    station = resolved(loaded.station(), asked.target)
    loop = loop_named(station, asked.arm or asked.loop)
    if loop.controller.name not in ("DPID", "DPIDE"):
        raise ProfileError(f"loop {loop.name} is a {loop.controller.name}, experiments know DPID and DPIDE")
    return station, loop, Recorded(asked.recording, asked.with_frames, profile_text=loaded.text)


def envelope(asked: Asked, loop: Loop) -> Envelope:
    """The bounds as typed, else the profile's ranges.

    Raises:
        ProfileError: Neither says how far PV may go, or bounds are the wrong way round.
    """
    from ahgateway.apps.tune_sitting import Envelope
    from ahgateway.errors import ProfileError

    pv, mv = asked.pv or loop.pv_range, asked.mv or loop.mv_range or (0.0, 100.0)
    if pv is None:
        raise ProfileError(
            f"nobody says how far PV of loop {loop.name} may go",
            hint="--pv-bounds LOW HIGH, or ranges.pv in the profile",
        )
    for name, pair in (("--pv-bounds", pv), ("--mv-bounds", mv)):
        if not pair[0] < pair[1]:
            raise ProfileError(f"{pair[0]:g} is not below {pair[1]:g}", key=name)
    return Envelope(pv, mv, float("inf") if asked.rate is None else asked.rate, asked.seconds)


def _saved(path: Path, record: Record) -> None:
    from ahgateway.errors import ProfileError

    rows = zip(record.t_s, record.sv, record.pv, record.mv, strict=True)
    lines = ["time,SV,PV,MV", *(f"{t:.6f},{sv!r},{pv!r},{mv!r}" for t, sv, pv, mv in (map(float, row) for row in rows))]
    try:
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise ProfileError(f"cannot be written: {error.strerror}", file=str(path)) from error
