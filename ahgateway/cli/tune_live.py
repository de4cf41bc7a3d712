"""The live half of `ahgateway tune`: an experiment through the write gate, and its trace."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ahgateway.cli.gate_place import gate_directory, loop_named, until_stopped, who_asks
from ahgateway.cli.tape import Recorded, one_loop, recorded

if TYPE_CHECKING:
    from ahgateway.apps.tune_experiment import Envelope, Wanted
    from ahgateway.codec.station import Loop, Station
    from ahgateway.tuning.blocks import Params
    from ahgateway.tuning.record import Record


@dataclass(frozen=True, slots=True)
class Asked:
    """What was typed."""

    profile: str
    arm: str | None
    loop: str | None
    experiment: str
    size: float | None
    hold_s: float | None
    pv: tuple[float, float] | None
    mv: tuple[float, float] | None
    rate: float | None
    seconds: float
    target: str | None
    save: Path | None
    recording: str | None = None
    with_frames: bool = False


def excited(asked: Asked, directory: Path | None) -> tuple[Record, str, Params]:
    """Carry out the experiment; return its trace, the instruction and the loop's settings.

    Raises:
        ProfileError: What was asked for cannot be, or the loop is not armed.
        StateError: It was aborted; everything has been put back.
    """
    from ahgateway.apps.tune_experiment import Kind, Wanted
    from ahgateway.cli.targets import resolved
    from ahgateway.errors import ProfileError
    from ahgateway.schema.profile import load

    kinds = {kind.value: kind for kind in Kind}
    if asked.experiment not in kinds:
        raise ProfileError(f"`{asked.experiment}` is no experiment, known are {', '.join(kinds)}", key="--experiment")
    if asked.arm and asked.loop and asked.arm != asked.loop:
        raise ProfileError(f"--arm {asked.arm} and --loop {asked.loop} name two loops")
    loaded = load(asked.profile)
    station = resolved(loaded.station(), asked.target)
    loop = loop_named(station, asked.arm or asked.loop)
    if loop.controller.name not in ("DPID", "DPIDE"):
        raise ProfileError(f"loop {loop.name} is a {loop.controller.name}, experiments know DPID and DPIDE")
    wanted = Wanted(kinds[asked.experiment], asked.size, asked.hold_s)
    bounds = envelope(asked, loop)
    if asked.arm is None:
        raise ProfileError(
            f"{wanted.kind.value} on loop {loop.name}, PV within {bounds.pv[0]:g}…{bounds.pv[1]:g}, MV within "
            f"{bounds.mv[0]:g}…{bounds.mv[1]:g}, {bounds.time_s:g} s at most: nothing was sent",
            hint=f"--arm {loop.name} does it",
        )
    tape = Recorded(asked.recording, asked.with_frames, profile_text=loaded.text)
    with gate_directory(station, directory) as folder:
        record, settings = asyncio.run(_run(station, loop, folder, wanted, bounds, tape))
    if asked.save is not None:
        _saved(asked.save, record)
    return record, loop.controller.name, settings


def envelope(asked: Asked, loop: Loop) -> Envelope:
    """The bounds as typed, else the profile's ranges.

    Raises:
        ProfileError: Neither says how far PV may go, or bounds are the wrong way round.
    """
    from ahgateway.apps.tune_experiment import Envelope
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


async def _run(
    station: Station, loop: Loop, folder: Path, wanted: Wanted, bounds: Envelope, tape: Recorded
) -> tuple[Record, Params]:
    from ahgateway.apps.tune_experiment import Experiment
    from ahgateway.cli.targets import open_target
    from ahgateway.clock import WallClock
    from ahgateway.lockstep.gate.gate import Gate
    from ahgateway.lockstep.picture import Sampler

    clock = WallClock()

    def told(text: str) -> None:
        typer.echo(text, err=True)

    with recorded(tape, one_loop(station, loop), clock, told) as sink:
        async with open_target(station, clock, sink.tap) as link:
            witness = sink.witness(loop)
            gate = Gate(station, loop, link, clock, folder, who=who_asks(None), sees=witness.see, told=witness.told)
            sampler = Sampler(loop, station, link, clock, witness.see)
            made = Experiment(loop, gate, sampler, clock, bounds, told=told)
            return await until_stopped(made.run(wanted))


def _saved(path: Path, record: Record) -> None:
    from ahgateway.errors import ProfileError

    rows = zip(record.t_s, record.sv, record.pv, record.mv, strict=True)
    lines = ["time,SV,PV,MV", *(f"{t:.6f},{sv!r},{pv!r},{mv!r}" for t, sv, pv, mv in (map(float, row) for row in rows))]
    try:
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise ProfileError(f"cannot be written: {error.strerror}", file=str(path)) from error
