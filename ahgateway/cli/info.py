"""`ahgateway info`: what a recording holds, and whether it is sound."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from ahgateway.cli.view import Output

if TYPE_CHECKING:
    from ahgateway.recording.reader import Recording


def info(
    file: Annotated[str, typer.Argument(help="Recording, as --record made it; it may still be written.")],
    check: Annotated[
        bool, typer.Option("--check", help="Read all of it and hold every second against its seal.")
    ] = False,
    profile: Annotated[bool, typer.Option("--profile", help="Print the profile in it and nothing else.")] = False,
    output: Annotated[Output, typer.Option(help="text for people, json for one object.")] = Output.TEXT,
) -> None:
    """Say what a recording holds: station, loops, time, verdicts, gaps, versions.

    With --check every byte is read; exit code 0 when the file is sound, 1 when something in it was changed or damaged.

    Example: ahgateway info demo.ahrec --check
    """
    from ahgateway.cli.view import print_json
    from ahgateway.recording.reader import Recording

    with Recording(file) as recording:
        if profile:
            typer.echo(recording.meta.get("profile", ""), nl=False)
            return
        found = _facts(recording, check)
    if output is Output.JSON:
        print_json(found)
    else:
        for line in _lines(found):
            typer.echo(line)
    raise typer.Exit(1 if found.get("damage") else 0)


def _facts(recording: Recording, check: bool) -> dict[str, Any]:
    from collections import Counter

    rows, first, last = recording.totals()
    verdicts: dict[str, Counter[str]] = {name: Counter() for name in recording.names}
    for loop, _, text in recording.verdicts():
        verdicts[loop][text["verdict"]] += int(text.get("count", 1))
    said = Counter(event.kind for event in recording.events())
    size = recording.path.stat().st_size
    found: dict[str, Any] = {
        "file": str(recording.path),
        "schema_version": recording.schema_version,
        "made_by": {
            name: recording.meta.get(name, "") for name in ("ahgateway", "core", "judge", "python", "numpy", "machine")
        },
        "origin": recording.meta.get("origin", "plc"),
        "station": recording.station.name,
        "target": recording.meta.get("target", ""),
        "command": recording.meta.get("command", ""),
        "part": int(recording.meta.get("part", "1")),
        "first_utc_ns": first,
        "last_utc_ns": last,
        "rows": rows,
        "size": size,
        "closed": recording.is_closed,
        "content_hash": recording.meta.get("content_hash"),
        "clock_offset_ns": int(recording.meta.get("clock_offset_ns", "0")),
        "dropped": sum(event.found["dropped"] for event in recording.events("recorder")),
        "events": dict(said),
        "writes": sum(1 for _ in recording.writes()),
        "journals": {
            event.loop: {"file": event.found["file"], "hash": event.found["record"]["hash"]}
            for event in recording.events("journal")
        },
        "notes": [text for _, text in recording.notes()],
        "loops": [
            {
                "name": loop.name,
                "instruction": loop.controller.name,
                "pv_unit": loop.pv_unit,
                "mv_unit": loop.mv_unit,
                "verdicts": dict(verdicts[loop.name]),
            }
            for loop in recording.station.loops
        ],
    }
    if check:
        damage = recording.check()
        found |= {"seconds_checked": damage.seconds, "damage": damage.texts}
    return found


def _lines(found: dict[str, Any]) -> list[str]:
    made = {name: text or "not said" for name, text in found["made_by"].items()}
    lines = [
        f"{found['file']}: recording, schema version {found['schema_version']}, part {found['part']}, "
        f"{found['size']} bytes",
        f"made by ahgateway {made['ahgateway']}, core {made['core']}, judge {made['judge']}, "
        f"Python {made['python']}, numpy {made['numpy']}, {made['machine']}",
        f"station {found['station']}, {found['target'] or 'no target'}",
    ]
    if found["command"]:
        lines.append(f"command: {found['command']}")
    if found["rows"]:
        lines.append(
            f"{_moment(found['first_utc_ns'])} to {_moment(found['last_utc_ns'])}, {found['rows']} pictures, "
            f"{found['size'] / found['rows']:.1f} bytes each"
        )
    else:
        lines.append("no pictures")
    for loop in found["loops"]:
        verdicts = ", ".join(f"{count} {name}" for name, count in sorted(loop["verdicts"].items()))
        lines.append(f"loop {loop['name']}: {loop['instruction']}; {verdicts or 'no verdicts'}")
    if found["events"]:
        lines.append("events: " + ", ".join(f"{count} {kind}" for kind, count in sorted(found["events"].items())))
    if found["writes"]:
        lines.append(f"writes to the PLC: {found['writes']}")
    lines += [
        f"journal of {loop}: {each['file']}, last hash {each['hash']}" for loop, each in found["journals"].items()
    ]
    lines += [f"note: {text}" for text in found["notes"]]
    if found["dropped"]:
        lines.append(f"GAPS: {found['dropped']} things were lost because the disk was full or too slow")
    if found["closed"]:
        lines.append(f"closed cleanly, content hash {found['content_hash']}")
    else:
        lines.append("not closed: still being written, or its writer was killed; at most its last second is missing")
    if "damage" in found:
        lines += found["damage"] or [f"sound: {found['seconds_checked']} seconds match their seals"]
    return lines


def _moment(utc_ns: int) -> str:
    from datetime import UTC, datetime

    from ahgateway.clock import SECOND

    moment = datetime.fromtimestamp(utc_ns // SECOND, UTC)
    return f"{moment:%Y-%m-%d %H:%M:%S}.{utc_ns % SECOND // 1_000_000:03d}Z"
