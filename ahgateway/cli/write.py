"""`ahgateway write`: write operands of one loop through the gate, or put back what was written."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ahgateway.cli.gate_place import gate_directory, legible, loop_named, until_stopped, who_asks
from ahgateway.cli.tape import Record, Recorded, RecordFrames, one_loop, recorded
from ahgateway.cli.view import Output

if TYPE_CHECKING:
    from ahgateway.codec.station import Loop, Station
    from ahgateway.lockstep.gate.gate import Gate
    from ahgateway.lockstep.gate.outcome import Plan, Restored
    from ahgateway.lockstep.gate.place import Place


def write(
    profile: Annotated[str, typer.Argument(help="Profile file, or the name of a shipped example such as `demo`.")],
    values: Annotated[
        list[str] | None, typer.Argument(metavar="NAME=VALUE…", help="Operands and their values.")
    ] = None,
    arm: Annotated[str | None, typer.Option(metavar="LOOP", help="Arm this loop and really write.")] = None,
    loop: Annotated[str | None, typer.Option(metavar="LOOP", help="The loop, without arming it.")] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be sent, even with --arm.")] = False,
    restore: Annotated[bool, typer.Option("--restore", help="Put back what the last run wrote or left.")] = False,
    accept: Annotated[bool, typer.Option("--accept", help="What stands there is right: close what was left.")] = False,
    reason: Annotated[str, typer.Option(help="Why, for the journal.")] = "",
    by: Annotated[str | None, typer.Option(help="Who, for the journal; the user of this machine otherwise.")] = None,
    target: Annotated[str | None, typer.Option(help="Link to use instead of the profile's.")] = None,
    directory: Annotated[Path | None, typer.Option(help="Where journals and leases stand.")] = None,
    record: Record = None,
    record_frames: RecordFrames = False,
    output: Annotated[Output, typer.Option(help="text for people, json for one object.")] = Output.TEXT,
) -> None:
    """Write operands of one loop, each read back; without --arm only say what would be written.

    Only what the profile lists under [loops.TAG.write] can be written, within the limits there. What was written stays;
    --restore puts it back. Every write stands in the journal with who, why, before and after, and with --record in a
    recording too, with what was seen of the loop.

    Example: ahgateway write demo SV=82.5 --arm TIC-101
    """
    from ahgateway.cli.targets import resolved
    from ahgateway.errors import ProfileError
    from ahgateway.schema.profile import load

    if restore + accept + bool(values) != 1:
        raise ProfileError("say one thing: NAME=VALUE…, --restore or --accept", hint="`SV=82.5`")
    if (restore or accept) and arm is None:
        raise ProfileError("--restore and --accept change something and need --arm LOOP")
    if arm and loop and arm != loop:
        raise ProfileError(f"--arm {arm} and --loop {loop} name two loops")
    loaded = load(profile)
    station = resolved(loaded.station(), target)
    found = loop_named(station, arm or loop)
    task = "restore" if restore else "accept" if accept else "write" if arm and not dry_run else "preview"
    with gate_directory(station, directory) as folder:
        tape = Recorded(record, record_frames, profile_text=loaded.text)
        asyncio.run(carry_out(station, found, folder, task, values or [], legible(reason), who_asks(by), output, tape))


async def carry_out(
    station: Station,
    loop: Loop,
    folder: Place,
    task: str,
    texts: list[str],
    reason: str,
    who: str,
    output: Output,
    tape: Recorded,
) -> None:
    """Do one of `write`, `preview`, `restore`, `accept` on one loop and show how it went."""
    from ahgateway.cli.targets import open_target
    from ahgateway.clock import WallClock
    from ahgateway.lockstep.gate.gate import Gate
    from ahgateway.lockstep.picture import Sampler

    clock = WallClock()
    values = _values(loop, texts)
    with recorded(tape, one_loop(station, loop), clock, _talk) as sink:
        async with open_target(station, clock, sink.tap) as link:
            witness = sink.witness(loop)
            gate = Gate(station, loop, link, clock, folder, who=who, sees=witness.see, told=witness.told)
            await _task(gate, task, values, reason, output)
            if tape.path is not None:
                # What stands there now is the last picture of the recording.
                await Sampler(loop, station, link, clock, witness.see).picture()


def _talk(line: str) -> None:
    typer.echo(line, err=True)


async def _task(gate: Gate, task: str, values: dict[str, Any], reason: str, output: Output) -> None:
    if task == "preview":
        _show(gate, output, task, plan=await gate.preview(values))
    elif task == "accept":
        _show(gate, output, task, note="closed" if gate.accept(reason) else "nothing was left open")
    elif task == "restore":
        await _restore(gate, reason, output)
    else:
        _show(gate, output, task, plan=await until_stopped(_armed(gate, values, reason)))


async def _armed(gate: Gate, values: dict[str, Any], reason: str) -> Plan:
    async with gate.armed(reason or "write", keep=True):
        if gate.recovered is not None:
            typer.echo(f"left by an earlier run: {gate.recovered.text(gate.loop)}", err=True)
        return await gate.write(values, reason)


async def _restore(gate: Gate, reason: str, output: Output) -> None:
    from ahgateway.errors import StateError

    restored = await until_stopped(gate.recover(reason or "asked for"))
    if restored is not None and not restored.is_clean:
        raise StateError(
            f"loop {gate.loop.name}: {restored.text(gate.loop)}",
            hint="look at the loop; `--accept` takes it as it stands",
        )
    _show(gate, output, "restore", restored=restored, note="" if restored else "there is nothing to put back")


def _values(loop: Loop, texts: list[str]) -> dict[str, Any]:
    from ahgateway.errors import ProfileError
    from ahgateway.lockstep.gate.change import parsed

    values: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise ProfileError(f"`{text}` is no NAME=VALUE", hint="as in `SV=82.5`")
        if name in values:
            raise ProfileError(f"`{text}`: {name} stands there twice")
        values[name] = parsed(loop, name, value)
    return values


def _show(
    gate: Gate, output: Output, task: str, *, plan: Plan | None = None, restored: Restored | None = None, note: str = ""
) -> None:
    if output is Output.JSON:
        typer.echo(json.dumps(_facts(gate, task, plan, restored, note), ensure_ascii=False))
        return
    for line in plan.lines if plan else []:
        typer.echo(f"{gate.loop.name} {line}")
    if plan and plan.unchanged:
        typer.echo(f"{gate.loop.name} unchanged: {', '.join(plan.unchanged)}")
    if restored:
        typer.echo(f"{gate.loop.name}: {restored.text(gate.loop)}")
    if note:
        typer.echo(f"{gate.loop.name}: {note}")
    if task == "preview":
        count = len(plan.steps) if plan else 0
        typer.echo(f"{count} request{'s' if count != 1 else ''}, not sent; --arm {gate.loop.name} sends them", err=True)
    else:
        typer.echo(f"journal {gate.path}, last hash {gate.anchor}", err=True)


def _facts(gate: Gate, task: str, plan: Plan | None, restored: Restored | None, note: str) -> dict[str, Any]:
    from ahgateway.apps.report import number
    from ahgateway.lockstep.gate.change import hexadecimal

    return {
        "loop": gate.loop.name,
        "task": task,
        "requests": [
            {
                "table": step.request.table.value,
                "address": step.request.address,
                "words": list(step.request.values),
                "operands": [
                    {
                        "operand": item.operand, "device": item.device,
                        "old": number(item.old_value), "new": number(item.new_value),
                        "old_words": hexadecimal(item.old), "new_words": hexadecimal(item.new),
                    }
                    for item in step.items
                ],
            }
            for step in (plan.steps if plan else ())
        ],
        "unchanged": list(plan.unchanged) if plan else [],
        "restored": list(restored.operands) if restored else [],
        "note": note,
        "journal": str(gate.path) if task != "preview" else None,
        "anchor": gate.anchor or None,
    }  # fmt: skip
