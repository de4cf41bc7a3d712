"""`ahgateway journal`: check the chain of a write journal against an anchor, and read it."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import typer

from ahgateway.cli.view import Output

app = typer.Typer(no_args_is_help=True, help="Check and read the journals of the write gate; sends nothing to any PLC.")

HASH_DIGITS = 64

FileArgument = Annotated[Path, typer.Argument(metavar="FILE", help="A journal, as `write` and `commission` name it.")]
OutputOption = Annotated[Output, typer.Option(help="text for people, json for machines.")]


@app.command()
def verify(
    file: FileArgument,
    anchor: Annotated[str | None, typer.Option(metavar="HASH", help="A hash that stands on a sheet.")] = None,
    output: OutputOption = Output.TEXT,
) -> None:
    """Follow the chain of a journal; with --anchor, prove that nothing before that hash was changed.

    Exit code 0 when it is whole and holds the anchor, 1 when not, 2 when it cannot be read, 3 when it holds no record.

    Example: ahgateway journal verify journal.jsonl --anchor 2c26b46b68ffc68f…
    """
    from ahgateway.lockstep.gate import journal

    anchor = None if anchor is None else _whole_hash(anchor)
    found = journal.verify(file, anchor)
    lacks = anchor is not None and found.anchor_at is None
    if output is Output.JSON:
        facts = {
            "file": str(file), "records": len(found.records), "last": found.last, "fault": found.fault or None,
            "anchor": anchor, "anchor_at": found.anchor_at, "unfinished_bytes": len(found.tail),
        }  # fmt: skip
        typer.echo(json.dumps(facts, ensure_ascii=False))
    else:
        count = f"{len(found.records)} record{'s' if len(found.records) != 1 else ''}"
        state = f"broken, {found.fault}" if found.fault else "whole" if found.records else "empty, nothing was checked"
        typer.echo(f"{file}: {state}, {count}, last hash {found.last}")
        if anchor is not None:
            where = "is not in it: what stands before it was changed" if lacks else f"is record {found.anchor_at}"
            typer.echo(f"anchor {anchor} {where}")
        if found.tail:
            typer.echo(f"the last line was cut short after {len(found.tail)} bytes")
    raise typer.Exit(1 if found.fault or lacks else 0 if found.records else 3)


def _whole_hash(text: str) -> str:
    from ahgateway.errors import ProfileError

    digits = text.strip().lower()
    if len(digits) != HASH_DIGITS or set(digits) - set("0123456789abcdef"):
        raise ProfileError(
            f"--anchor `{text}` is no hash, which has {HASH_DIGITS} hexadecimal digits",
            hint="the whole of it stands on the sheet and behind every write; `journal show` cuts it short",
        )
    return digits


@app.command()
def show(file: FileArgument, output: OutputOption = Output.TEXT) -> None:
    """Write the records of a journal, one a line.

    Example: ahgateway journal show journal.jsonl
    """
    from ahgateway.lockstep.gate import journal

    for record in journal.verify(file).records:
        typer.echo(json.dumps(record, ensure_ascii=False) if output is Output.JSON else _line(record))


def _line(record: Any) -> str:
    when = datetime.fromtimestamp(record["utc_ns"] / 1e9, UTC).isoformat(timespec="milliseconds")
    texts = [
        f"{each['operand']} {each['device']} {each['old_value']} -> {each['new_value']}"
        for each in record.get("items", ())
    ]
    texts += [str(record[key]) for key in ("loop", "why", "who", "text", "how") if record.get(key)]
    return f"{record['n']} {when} {record['kind']} {'; '.join(texts)} {record['hash'][:12]}".replace("  ", " ")
