"""`ahgateway identify`: learn from the PLC, or from a recording of it, how its firmware computes."""

from __future__ import annotations

import asyncio
import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ahgateway.cli.tape import Keep, Record, Recorded, RecordFrames, RollHours, RollMb, recorded
from ahgateway.cli.view import Output

if TYPE_CHECKING:
    from ahgateway.apps.identify import Learned, Open
    from ahgateway.codec.station import Station
    from ahgateway.lockstep.picture import Picture

SQLITE = b"SQLite format 3\x00"


def identify(
    source: Annotated[str, typer.Argument(metavar="RECORDING|PROFILE", help="Recording, profile, or demo.")],
    loop: Annotated[list[str] | None, typer.Option(help="Only this loop; may be given several times.")] = None,
    target: Annotated[str | None, typer.Option(help="Link to use instead of the profile's.")] = None,
    duration: Annotated[float, typer.Option(help="How long to watch a live PLC, in seconds.", min=1.0)] = 60.0,
    save: Annotated[
        Path | None, typer.Option(metavar="PROFILE", help="Write what is decided into this profile.")
    ] = None,
    firmware: Annotated[str, typer.Option(help="Firmware, as its label shows it; it cannot be read.")] = "",
    record: Record = None,
    record_frames: RecordFrames = False,
    roll_mb: RollMb = None,
    roll_hours: RollHours = None,
    keep: Keep = None,
    output: Annotated[Output, typer.Option(help="text for people, json for one object per loop.")] = Output.TEXT,
) -> None:
    """Learn how the PLC discretises its PID formulas, by eliminating every arithmetic that misses one bit.

    Only reads the PLC. Ends with the axes that are decided, those still open with what would decide them, or the first
    execution that no known dialect explains. Exit code 0 when a dialect is named, 1 when none fits, 3 when there is
    too little to decide.

    Example: ahgateway identify demo --duration 30
    """
    if _is_recording(source):
        if record is not None:
            from ahgateway.errors import ProfileError

            raise ProfileError(f"keeps what a live PLC shows, and {source} is a recording already", key="--record")
        station, pictures = _recorded(source)
    else:
        tape = Recorded(record, record_frames, roll_mb, roll_hours, keep)
        station, pictures = _live(source, target, duration, tape)
    from ahgateway.apps.identify import learn
    from ahgateway.cli.compiled_laws import keep_compiled
    from ahgateway.core.verdict import Exit

    keep_compiled()
    results = learn(station, pictures, loop or ())
    for each in results:
        typer.echo(json.dumps(_object(each)) if output is Output.JSON else _text(each))
    if save is not None:
        _save(save, results, firmware)
    exits = {each.exit for each in results}
    raise typer.Exit(
        int(next((code for code in (Exit.DIFFERENT, Exit.INCONCLUSIVE) if code in exits), Exit.PASS))
        if results
        else int(Exit.INCONCLUSIVE)
    )


def _is_recording(source: str) -> bool:
    path = Path(source)
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(SQLITE)) == SQLITE


def _recorded(source: str) -> tuple[Station, dict[str, list[Picture]]]:
    from ahgateway.apps.identify import collected
    from ahgateway.apps.replay import Changes, Replay, judged_again
    from ahgateway.recording.parts import opened

    with opened(source) as recording:
        again = Replay(recording, judged_again(recording.station, Changes({}, None)), ())
        return recording.station, collected(again.reports())


def _live(
    source: str, target: str | None, duration_s: float, tape: Recorded
) -> tuple[Station, dict[str, list[Picture]]]:
    from ahgateway.cli.targets import resolved
    from ahgateway.schema.profile import load

    loaded = load(source)
    station = resolved(loaded.station(), target)
    return station, asyncio.run(_watched(station, duration_s, replace(tape, profile_text=loaded.text)))


async def _watched(station: Station, duration_s: float, tape: Recorded) -> dict[str, list[Picture]]:
    from ahgateway.apps.identify import collected
    from ahgateway.apps.monitor import Monitor
    from ahgateway.cli.interrupt import stop_event
    from ahgateway.cli.targets import open_target
    from ahgateway.clock import SECOND, WallClock

    clock = WallClock()
    reports = []
    with recorded(tape, station, clock, lambda line: typer.echo(line, err=True)) as sink:
        async with open_target(station, clock, sink.tap) as link:
            watched = Monitor(station, link, clock)
            with stop_event() as stop:
                async for report in watched.reports(duration_ns=round(duration_s * SECOND), stop=stop):
                    sink.take(report)
                    reports.append(report)
    return collected(reports)


def _object(each: Learned) -> dict[str, Any]:
    found = each.found
    shown: dict[str, Any] = {
        "loop": each.loop.name,
        "instruction": each.loop.controller.name,
        "pictures": each.pictures,
        "executions": found.executions,
        "informative": found.informative,
        "survivors": len(found.survivors),
        "cut": found.is_cut,
        "crowded": found.is_crowded,
        "exit": each.exit.name.lower(),
        "decided": each.decided() if found.is_named else {},
        "open": [
            {
                "axis": one.axis,
                "values": list(one.values),
                "try": one.excitation,
                "narrowed": one.is_narrowed,
                "after": list(one.after),
                "unseen": one.unseen,
            }
            for one in each.open()
        ],
        "words": [
            {"dword": word.dword, "follows": word.quantity, "agreed": word.agreed, "changes": word.changes}
            for word in each.words
        ],
        "unexplained": None,
    }
    if found.unexplained is not None:
        shown["unexplained"] = {
            "execution": found.unexplained.number,
            "words": {
                name: {"plc": _pattern(plc), "ref": _pattern(ref)}
                for name, (plc, ref) in found.unexplained.words.items()
            },
        }
    return shown


def _text(each: Learned) -> str:
    found, head = each.found, f"{each.loop.name} ({each.loop.controller.name})"
    if found.unexplained is not None:
        return "\n".join([f"{head}: no known dialect fits", *_unexplained(each)])
    if not found.is_named:
        return "\n".join([f"{head}: {_undecided(each)}", *_so_far(each), f"  hint: {_more(each)}"])
    lines = [f"{head}: {found.executions} executions explained by bits, {found.informative} of them informative"]
    lines += [f"  {name} = {value}" for name, value in each.decided().items()]
    lines += [
        f"  I_MV+{word.dword} follows {word.quantity}: {word.agreed} of {word.changes} changes" for word in each.words
    ]
    if found.is_cut:
        lines.append(f"  the search ran out of steps behind {found.executions} executions{_about_filter(each)}")
    return "\n".join([*lines, *_open(each)])


def _undecided(each: Learned) -> str:
    """Why nothing is named although nothing speaks against the family."""
    found = each.found
    if not found.is_crowded:
        return f"too little to decide, {found.executions} executions were explained"
    if found.executions:
        fit = f"{len(found.survivors)} combinations explain the first {found.executions} executions"
        return f"nothing is named, {fit}: more than can be followed"
    return f"too little to decide, of {each.pictures} pictures {found.plain} show a plain execution, nothing is named"


def _so_far(each: Learned) -> list[str]:
    """What every combination that is left has in common; it is not saved."""
    decided = each.decided() if each.found.executions else {}
    return [f"  as far as that: {', '.join(f'{name} = {value}' for name, value in decided.items())}"] if decided else []


def _more(each: Learned) -> str:
    """What gives a search more to go by."""
    if each.loop.controller.begin is not None:
        return f"watch longer; the block is {each.loop.controller.roles.starts}"
    wanted = "watch longer, in automatic, between the limits, ERR_DBW 0, with Ki and some movement of SV or PV"
    return wanted + _about_filter(each)


HEADS = {
    "SV, PV, the gains and the dead band": ("error", "ts", "integral", "derivative", "sum", "words", "block"),
    "limits": ("limit",),
    "manual and back": ("manual", "transfer"),
    "PID_RUN, EN and STOP": ("run",),
    "when it executes": ("schedule",),
}
"""What an operator moves, to the parts of the law that it brings to light."""


def _open(each: Learned) -> list[str]:
    """What is left open: what this loop depends on as it runs, the rest by what an operator moves, what has to wait."""
    left = each.open()
    if not left:
        return ["  nothing is open"]
    lines = [f"  open, {len(left)} axes; monitor and check take the default for what the profile does not name"]
    if each.loop.controller.name == "DPIDE":
        lines.append("    keep Td_Kd = 0 where a line does not name it: what D's filter holds stands in no word")
    ready = [one for one in left if not one.after and not one.unseen]
    narrowed = [one for one in ready if one.is_narrowed]
    if narrowed:
        lines += ["    what this loop depends on as it ran; to decide it:", *_tips(narrowed)]
    for head, groups in HEADS.items():
        rest = [one for one in ready if one.group in groups and not one.is_narrowed]
        if rest:
            lines += [f"    not asked for yet, {head}:", *_tips(rest)]
    waiting = [one for one in left if one.after and not one.unseen]
    if waiting:
        lines.append("    later, what it waits for in brackets; identify again and its line comes:")
        lines += [f"      {one.axis} ({', '.join(one.after)})" for one in waiting]
    unseen = [one for one in left if one.unseen]
    if unseen:
        lines.append("    cannot be told apart by anything an operator does:")
        lines += [f"      {one.axis}: {' or '.join(one.values)}, with {one.unseen}" for one in unseen]
    return lines


def _tips(left: list[Open]) -> list[str]:
    return [f"      {one.axis}: {' or '.join(one.values)}\n        do: {one.excitation}" for one in left]


def _about_filter(each: Learned) -> str:
    """What costs most steps on a DPIDE: the content of D's filter, which no word shows."""
    if each.loop.controller.name != "DPIDE":
        return ""
    return "; on a DPIDE, Td_Kd = 0 or Tf = 0 for the recording leaves nothing hidden and decides the other axes first"


def _unexplained(each: Learned) -> list[str]:
    missed = each.found.unexplained
    assert missed is not None
    lines = [f"  first execution that none explains: number {missed.number}, beside the closest dialect"]
    for name, (plc, ref) in missed.words.items():
        mark = "" if _pattern(plc) == _pattern(ref) else "   differs"
        lines.append(f"    {name}: plc {plc:.9g} ({_pattern(plc)}), ref {ref:.9g} ({_pattern(ref)}){mark}")
    lines += [
        f"    {name}: {value:.9g}"
        for name, value in missed.terms._asdict().items()
        if name in ("e", "p", "i", "d", "raw")
    ]
    chosen = ", ".join(f"{axis} = {value}" for axis, value in each.closest().items())
    lines.append(f"    closest dialect: {chosen or 'the default'}")
    if getattr(missed.dialect, "ts_source", 0):
        allowed = f"a measured Ts is sought within CYCLE and scan_ms_max = {each.loop.scan_ms_max} ms"
        lines.append(f"  hint: {allowed}; if scans can be longer, raise it in the loop's profile and watch again")
    return lines


def _pattern(value: Any) -> str:
    """The bits of a REAL, or a whole number."""
    import numpy as np

    from ahgateway.core.real import bits

    return f"0x{bits(value):08x}" if isinstance(value, np.floating) else str(int(value))


def _save(path: Path, results: list[Learned], firmware: str) -> None:
    from ahgateway.clock import WallClock
    from ahgateway.schema.files import read
    from ahgateway.schema.learned import with_dialect

    text = read(path, str(path))
    date = _date(WallClock().utc_ns())
    for each in results:
        if not each.found.is_named:
            typer.echo(f"{path}: dialect of {each.loop.name} not written, none is named", err=True)
            continue
        evidence: dict[str, str | int] = {
            "by": "ahgateway identify",
            "date": date,
            "executions": each.found.executions,
            "firmware": firmware,
        }
        text, notes = with_dialect(text, str(path), each.loop.name, each.decided(), each.left(), evidence)
        for note in (f"dialect of {each.loop.name} written, {len(each.decided())} axes decided", *notes):
            typer.echo(f"{path}: {note}", err=True)
    path.write_text(text, encoding="utf-8")


def _date(utc_ns: int) -> str:
    from datetime import UTC, datetime

    return datetime.fromtimestamp(utc_ns / 1e9, UTC).date().isoformat()
