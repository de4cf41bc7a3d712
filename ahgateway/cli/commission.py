"""`ahgateway commission`: the guided list for one loop, from the link to the sheet to sign."""

from __future__ import annotations

import asyncio
import hashlib
import json
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ahgateway.cli.gate_place import gate_directory, legible, loop_named, until_stopped, who_asks
from ahgateway.cli.tape import Record, Recorded, RecordFrames, one_loop, recorded
from ahgateway.cli.view import Output

if TYPE_CHECKING:
    from ahgateway.apps.commission.checks import Check, Progress, Step
    from ahgateway.apps.commission.run import Commission, Wishes
    from ahgateway.apps.commission.sheet import Heading
    from ahgateway.apps.commission.wiring import Envelope
    from ahgateway.clock import Clock
    from ahgateway.codec.station import Loop, Station
    from ahgateway.schema.profile import Profile
    from ahgateway.transports.base import Link, Tap

REHEARSAL_WARM_UP_S = 900
WARM_UP_SCAN_NS, SCAN_NS = 50_000_000, 5_000_000
"""Nobody looks at the warm-up, so that its scans may be coarse."""
MARKS = {"pass": "ok  ", "fail": "FAIL", "inconclusive": "?   ", "skipped": "-   "}


@dataclass(frozen=True, slots=True)
class Asked:
    """What was typed, apart from the wishes of the run."""

    auto: bool
    heading: Heading
    state: Path
    sheet: Path
    fresh: bool
    save: bool
    directory: Path | None
    output: Output
    tape: Recorded


def commission(
    profile: Annotated[str, typer.Argument(help="Profile file, or the name of a shipped example such as `demo`.")],
    loop: Annotated[str | None, typer.Option(metavar="LOOP", help="The loop, when there are several.")] = None,
    arm: Annotated[str | None, typer.Option(metavar="LOOP", help="Arm this loop: step 5 may move it.")] = None,
    auto: Annotated[bool, typer.Option("--auto", help="Ask nothing; a process moves only on a bench or fake.")] = False,
    target: Annotated[str | None, typer.Option(help="Link to use instead of the profile's.")] = None,
    executions: Annotated[int, typer.Option(min=5, help="Executions to observe.")] = 60,
    observe: Annotated[float, typer.Option(metavar="SECONDS", min=1.0, help="Longest observation.")] = 120.0,
    coverage: Annotated[float, typer.Option(min=0.0, max=1.0, help="Share of executions to prove by bits.")] = 0.5,
    step: Annotated[float | None, typer.Option(min=0.0, help="Step of MOUT; the largest allowed otherwise.")] = None,
    pv_band: Annotated[float | None, typer.Option(min=0.0, help="How far PV may go; 10 % of its range.")] = None,
    pv_rate: Annotated[float | None, typer.Option(min=0.0, help="PV's largest rate a second; no limit.")] = None,
    answer: Annotated[float, typer.Option(metavar="SECONDS", min=1.0, help="Time for PV to answer a step.")] = 60.0,
    minutes: Annotated[float, typer.Option(min=1.0, max=60.0, help="Longest time of step 5.")] = 15.0,
    search: Annotated[float, typer.Option(metavar="SECONDS", min=0.0, help="Time to search for a silent PLC.")] = 60.0,
    idle: Annotated[float, typer.Option(metavar="SECONDS", min=0.0, help="Time to idle on a TCP connection.")] = 40.0,
    by: Annotated[str | None, typer.Option(help="Who commissions; the user of this machine otherwise.")] = None,
    instrument: Annotated[list[str] | None, typer.Option(help="An instrument used; several times.")] = None,
    remarks: Annotated[str, typer.Option(help="Anything for the sheet.")] = "",
    state: Annotated[Path | None, typer.Option(help="File that keeps progress: commission-LOOP.json.")] = None,
    sheet: Annotated[Path | None, typer.Option(help="Sheet to write: commission-LOOP.html.")] = None,
    marker: Annotated[bool, typer.Option("--marker", help="With --arm: a marker in the scratch words.")] = False,
    fresh: Annotated[bool, typer.Option("--fresh", help="Begin anew instead of going on.")] = False,
    save: Annotated[bool, typer.Option("--save", help="Write what step 1 found into the profile.")] = False,
    rollback: Annotated[
        bool, typer.Option("--rollback", help="Put back what the last run left, nothing else.")
    ] = False,
    directory: Annotated[Path | None, typer.Option(help="Where journals and leases stand.")] = None,
    record: Record = None,
    record_frames: RecordFrames = False,
    output: Annotated[Output, typer.Option(help="text for people, json for one object.")] = Output.TEXT,
) -> None:
    """Take one loop to a sheet to sign: find the link, settle the map, read the loop, shadow it, prove its wiring.

    Only reads, except step 5 with --arm LOOP: small steps of MOUT inside an envelope, and everything back. A `fake://`
    target is rehearsed in virtual time, in seconds. What is done is kept; the next call goes on. With --record all that
    is seen and written is kept in a recording too. Exit code 0 when every check passed or was skipped with a reason, 1
    when one failed, 3 when one stayed open.

    Example: ahgateway commission demo --loop TIC-101 --arm TIC-101 --auto
    """
    from ahgateway.apps.commission.link import Patience
    from ahgateway.apps.commission.run import Wishes
    from ahgateway.apps.commission.sheet import Heading
    from ahgateway.cli.targets import resolved
    from ahgateway.clock import SECOND
    from ahgateway.errors import ProfileError
    from ahgateway.schema.profile import load

    if arm and loop and arm != loop:
        raise ProfileError(f"--arm {arm} and --loop {loop} name two loops")
    loaded = load(profile)
    station = resolved(loaded.station(), target)
    found = loop_named(station, arm or loop)
    tape = Recorded(record, record_frames, profile_text=loaded.text)
    if rollback:
        _roll_back(station, found, arm, directory, who_asks(by), output, tape)
        return
    wishes = Wishes(
        executions, round(observe * SECOND), coverage, arm is not None, step, pv_band, pv_rate,
        round(answer * SECOND), round(minutes * 60 * SECOND), marker and arm is not None,
        Patience(round(search * SECOND), round(idle * SECOND)),
    )  # fmt: skip
    asked = Asked(
        auto, Heading(legible(by or ""), tuple(map(legible, instrument or ())), legible(remarks)),
        state or Path(f"commission-{found.name}.json"), sheet or Path(f"commission-{found.name}.html"), fresh, save,
        directory, output, tape,
    )  # fmt: skip
    raise typer.Exit(asyncio.run(_commission(loaded, station, found, wishes, asked)))


def _roll_back(
    station: Station, loop: Loop, arm: str | None, directory: Path | None, who: str, output: Output, tape: Recorded
) -> None:
    from ahgateway.cli.write import carry_out
    from ahgateway.errors import ProfileError

    if arm is None:
        raise ProfileError("--rollback changes something and needs --arm LOOP")
    with gate_directory(station, directory) as folder:
        asyncio.run(carry_out(station, loop, folder, "restore", [], "rollback", who, output, tape))


async def _commission(loaded: Profile, station: Station, loop: Loop, wishes: Wishes, asked: Asked) -> int:
    from ahgateway.apps.commission import sheet
    from ahgateway.apps.commission.checks import Progress, exit_for, resume
    from ahgateway.apps.commission.run import Commission
    from ahgateway.schema import device_map, files

    mark = hashlib.sha256(loaded.text.encode("utf-8")).hexdigest()
    progress = Progress(loop.name, mark) if asked.fresh else resume(asked.state, loop.name, mark)
    typed = sheet.Heading.kept(progress, asked.heading)
    heading = replace(typed, by=typed.by or who_asks(None))
    clock, link_maker = _opening(station)
    maps = [device_map.load(name) for name in files.names(files.shipped())]
    with ExitStack() as stack:
        sink = stack.enter_context(recorded(asked.tape, one_loop(station, loop), clock, _talk))
        work = Commission(
            station, loop, link_maker(sink.tap), clock, progress,
            path=asked.state, gates=stack.enter_context(gate_directory(station, asked.directory)), maps=maps,
            who=heading.by, witness=sink.witness(loop), begins=_begins(station, wishes),
        )  # fmt: skip
        _resumed(progress)
        await until_stopped(
            work.run(wishes, _said, consent=lambda bounds: _consents(work.station, loop, bounds, asked.auto))
        )
    _changes(loaded, work, asked.save)
    utc_ns = clock.utc_ns()
    _write_file(asked.sheet, sheet.html(progress, work.station, loop, heading, utc_ns))
    if asked.output is Output.JSON:
        typer.echo(json.dumps(sheet.sheet_json(progress, work.station, loop, heading, utc_ns), ensure_ascii=False))
    code = exit_for(progress.checks)
    typer.echo(f"{loop.name}: {sheet.VERDICT[int(code)]}; sheet {asked.sheet}, progress {asked.state}", err=True)
    return int(code)


def _talk(line: str) -> None:
    typer.echo(line, err=True)


def _opening(station: Station) -> tuple[Clock, Callable[[Tap | None], Callable[[Station], Any]]]:
    """The clock, and what makes openers of links; a fake PLC is one for the whole run and lives in virtual time."""
    from ahgateway.clock import SECOND, VirtualClock, WallClock
    from ahgateway.transports.uri import open_link, parse_uri

    wall = WallClock()
    target = parse_uri(station.target)
    if target.scheme != "fake":

        def tapped(tap: Tap | None) -> Callable[[Station], Any]:
            async def opened(variant: Station) -> Link:
                return open_link(parse_uri(variant.target), wall, variant.pacing, tap, can=variant.can)

            return opened

        return wall, tapped

    from ahgateway.fake.plc import FakePlc
    from ahgateway.schema.profile import load
    from ahgateway.transports.memory import MemoryLink

    clock = VirtualClock(utc_start_ns=wall.utc_ns())
    loaded = load(target.path)
    plc = FakePlc(loaded.station(), loaded.fake_setup(), clock=clock, scan_ns=WARM_UP_SCAN_NS)
    plc.warm_up(REHEARSAL_WARM_UP_S * SECOND)
    plc.scan_ns = SCAN_NS

    def rehearsing(tap: Tap | None) -> Callable[[Station], Any]:
        async def opened(variant: Station) -> Link:
            return MemoryLink(plc, clock, latency_ns=2_000_000, tap=tap, pacing=variant.pacing, target=variant.target)

        return opened

    return clock, rehearsing


def _resumed(progress: Progress) -> None:
    done = [str(step.value) for step in progress.steps if progress.is_done(step)]
    if done:
        typer.echo(f"steps {', '.join(done)} are done already; --fresh does them again", err=True)


def _begins(station: Station, wishes: Wishes) -> Callable[[Step], None]:
    """Say each step before it begins, and how long it can take where nobody would wait without a word."""
    from ahgateway.clock import SECOND

    is_network = "tcp" in station.target.partition("://")[0]
    idle = f"; a connection is left idle for up to {wishes.patience.idle_ns / SECOND:g} s"
    waits = {
        1: f"a silent PLC is searched for up to {wishes.patience.search_ns / SECOND:g} s{idle if is_network else ''}",
        3: f"{wishes.executions} executions, at most {wishes.observe_ns / SECOND:g} s",
    }

    def say(step: Step) -> None:
        wait = f" ({waits[step.value]})" if step.value in waits else ""
        typer.echo(f"{step.value} {step.title}{wait}", err=True)

    return say


def _said(step: Step, checks: Sequence[Check]) -> None:
    from ahgateway.apps.commission.catalogue import CATALOGUE

    reasons = {check.text for check in checks}
    if len(reasons) == 1 and len(checks) > 1 and checks[-1].outcome.value == "skipped":
        first, last = (CATALOGUE[check.name].code for check in (checks[0], checks[-1]))
        typer.echo(f"  {MARKS[checks[0].outcome.value]} {first}…{last} left out: {checks[0].text}", err=True)
        return
    for check in checks:
        kind = CATALOGUE[check.name]
        typer.echo(f"  {MARKS[check.outcome.value]} {kind.code} {check.name}: {check.text}", err=True)
        if check.outcome.value == "fail":
            typer.echo(f"       hint: {kind.do}", err=True)


def _consents(station: Station, loop: Loop, bounds: Envelope, auto: bool) -> bool:
    """Ask before the process is moved, with what is written where, and what ends the test."""
    from ahgateway.cli.interrupt import while_asking
    from ahgateway.errors import StateError

    typer.echo(_announced(station, loop, bounds), err=True)
    if auto or not sys.stdin.isatty():
        is_safe = station.bench or station.target.startswith("fake://")
        typer.echo(f"  {'a bench, it goes on' if is_safe else 'a plant: needs a person, left out'}", err=True)
        return is_safe
    try:
        with while_asking():
            return typer.confirm("  go on?", default=False, err=True)
    except (KeyboardInterrupt, typer.Abort):
        typer.echo("", err=True)
        raise StateError("stopped before the process was moved") from None


def _announced(station: Station, loop: Loop, bounds: Envelope) -> str:
    from ahgateway.clock import SECOND

    roles = loop.controller.roles
    where = {name: f"{name} {loop.bindings[name]}" for name in (roles.manual, roles.mout)}
    limits = [f"{name} {loop.bindings[name]}" for name in ("MV_MAX", "MV_MIN") if name in loop.writes]
    lines = [
        f"  this moves the process of {loop.name} at {station.target} unit {station.unit}:",
        f"  {where[roles.manual]} to manual and back, {where[roles.mout]} by {bounds.step:g} {loop.mv_unit} each way",
        *([f"  {' and '.join(limits)} to half a step beside MV and back"] if limits else []),
        f"  it ends, and everything goes back, when PV leaves {bounds.pv_low:.6g}…{bounds.pv_high:.6g} {loop.pv_unit}, "
        f"when anybody else writes, at Ctrl-C, or after {bounds.total_ns / SECOND / 60:g} min",
    ]
    return "\n".join(lines)


def _changes(loaded: Profile, work: Commission, save: bool) -> None:
    from ahgateway.apps.commission.link import amended

    if not work.changes:
        return
    said = ", ".join(f"station.{key} = {json.dumps(value)}" for key, value in work.changes.items())
    if not save:
        typer.echo(f"the profile should say {said}; --save writes it there", err=True)
        return
    _write_file(Path(loaded.file), amended(loaded.text, work.changes))
    typer.echo(f"{loaded.file} says now {said}", err=True)


def _write_file(path: Path, text: str) -> None:
    from ahgateway.errors import ProfileError

    try:
        path.write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise ProfileError(f"cannot be written: {error.strerror}", file=str(path)) from error
