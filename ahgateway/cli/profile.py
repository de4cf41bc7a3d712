"""`ahgateway profile`: check, show, describe and start the file that says where a loop's operands stand."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from ahgateway.codec.access import Span
    from ahgateway.schema.profile import Profile

app = typer.Typer(no_args_is_help=True, help="Check, show, describe and start profiles; sends nothing to any PLC.")

FileArgument = Annotated[str, typer.Argument(metavar="FILE", help="Path of a profile, or a shipped example: demo.")]
OutputOption = Annotated[str, typer.Option("--output", "-o", metavar="text|json", help="Form of the result.")]


def _say(text: str) -> None:
    """Write to stdout as UTF-8 whatever the console's code page is; a sign it lacks becomes an escape."""
    encoding = sys.stdout.encoding or "utf-8"
    typer.echo(text.encode(encoding, "backslashreplace").decode(encoding))


def _one_of(output: str) -> str:
    if output not in ("text", "json"):
        raise typer.BadParameter(f"`{output}` is neither text nor json", param_hint="--output")
    return output


@app.command()
def check(file: FileArgument, output: OutputOption = "text") -> None:
    """Check a profile and say in one line what it holds; all errors are named together.

    Example: ahgateway profile check line3.toml
    """
    _one_of(output)
    from ahgateway.schema import profile

    loaded = profile.load(file)
    station = loaded.station()
    loops = [loop.name for loop in station.loops]
    if output == "json":
        _say(json.dumps({"file": loaded.file, "station": station.name, "loops": loops}, ensure_ascii=False))
        return
    count = f"{len(loops)} loop{'s' if len(loops) != 1 else ''}"
    _say(f"{loaded.file}: good, station {station.name}, {count}: {', '.join(loops)}")


@app.command()
def show(file: FileArgument, output: OutputOption = "text") -> None:
    """Show where every operand stands, who said so, and which requests fetch it.

    Example: ahgateway profile show demo --output json
    """
    _one_of(output)
    from ahgateway.schema import profile

    facts = describe(profile.load(file))
    _say(json.dumps(facts, ensure_ascii=False, indent=2) if output == "json" else _page(facts))


@app.command()
def schema() -> None:
    """Write the JSON schema of profiles to stdout, for editors.

    Example: ahgateway profile schema > profile.schema.json
    """
    from ahgateway.schema.forms import ProfileForm

    _say(json.dumps(ProfileForm.model_json_schema(), ensure_ascii=False, indent=2))


@app.command()
def init(
    file: Annotated[str, typer.Argument(metavar="FILE", help="File to write.")] = "profile.toml",
    instruction: Annotated[str, typer.Option(help="Instruction of the first loop.")] = "DPIDE",
) -> None:
    """Write a commented profile to start from; an existing file is left alone.

    Example: ahgateway profile init line3.toml --instruction DPID
    """
    from ahgateway.errors import ProfileError
    from ahgateway.schema.starter import starter

    text = starter(instruction)
    try:
        with Path(file).open("x", encoding="utf-8", newline="\n") as handle:
            handle.write(text)
    except FileExistsError as error:
        raise ProfileError("is there already and was left alone", file=file, hint="name another file") from error
    except OSError as error:
        raise ProfileError(f"cannot be written: {error.strerror}", file=file) from error
    _say(f"{file}: written; edit it, then `ahgateway profile check {file}`")


def describe(profile: Profile) -> dict[str, Any]:
    """Return everything that a profile says as plain data: settings with their origin, operands, requests."""
    from ahgateway.codec import block
    from ahgateway.codec.plan import plan

    station = profile.station()
    pacing = station.pacing
    spans: list[Span] = []
    loops: list[dict[str, Any]] = []
    for loop in station.loops:
        places = block.spans(loop, station.devices)
        spans += places.values()
        operands = [_operand(profile, loop, row) for row in loop.controller.operands]
        axes = {axis: value.name.lower() for axis, value in loop.dialect._asdict().items()}
        form = profile.form.loops[loop.name]
        loops.append(
            {
                "name": loop.name,
                "instruction": loop.controller.name,
                "en": str(loop.en) if loop.en else None,
                "dialect": {
                    axis: {"value": value, "origin": "profile" if axis in form.dialect else "default"}
                    for axis, value in axes.items()
                },
                "shared": sorted(loop.shared),
                "operands": operands,
            }
        )
    requests = plan(
        spans,
        unit=station.unit,
        words_max=pacing.words_per_request_max,
        gap_max=pacing.gap_words_max,
        exists=station.devices.covers,
    )
    return {
        "file": profile.file,
        "station": _station(profile),
        "loops": loops,
        "requests": [
            {"unit": read.unit, "table": read.table.value, "address": f"0x{read.address:04X}", "count": read.count}
            for read in requests
        ],
    }


def _station(profile: Profile) -> dict[str, Any]:
    station, form = profile.station(), profile.form.station
    values = {
        "name": station.name,
        "target": station.target,
        "unit": station.unit,
        "device_map": station.devices.name,
        "kind": "bench" if station.bench else "plant",
        "running": str(station.running) if station.running else None,
    }
    facts: dict[str, Any] = {
        key: {"value": value, "origin": "profile" if key in form.model_fields_set else "default"}
        for key, value in values.items()
    }
    if form.unit is None and "unit=" in form.target:
        facts["unit"]["origin"] = "target"
    for key in type(form.pacing).model_fields:
        origin = "profile" if key in form.pacing.model_fields_set else "default"
        facts[f"pacing.{key}"] = {"value": getattr(form.pacing, key), "origin": origin}
    return facts


def _operand(profile: Profile, loop: Any, row: Any) -> dict[str, Any]:
    from ahgateway.codec.station import Const

    bound = profile.bound[loop.name][row.name]
    units = {"PV": loop.pv_unit or "PV", "MV": loop.mv_unit or "MV"}
    facts: dict[str, Any] = {
        "name": row.name,
        "kind": row.kind.value,
        "unit": units.get(row.unit, row.unit),
        "device": None,
        "table": None,
        "address": None,
        "bit": None,
        "words": row.words,
        "confidence": None,
        "origin": bound.origin,
    }
    if isinstance(bound.binding, Const) or bound.place is None:
        facts["const"] = loop.bindings[row.name].value
        return facts
    devices = profile.station().devices
    facts["device"] = str(bound.binding)
    facts["table"] = bound.place.table.value
    facts["address"] = f"0x{bound.place.address:04X}"
    facts["bit"] = bound.place.bit
    facts["confidence"] = devices.range_of(bound.binding, bits=bound.place.is_bit).confidence
    return facts


def _page(facts: dict[str, Any]) -> str:
    lines = [facts["file"], "", "[station]"]
    lines += _columns([[key, _text(fact["value"]), fact["origin"]] for key, fact in facts["station"].items()])
    for loop in facts["loops"]:
        lines += ["", f"[{loop['name']}] {loop['instruction']}, EN {loop['en'] or 'not bound'}"]
        heads = ["operand", "kind", "unit", "device", "table", "address", "confidence", "origin"]
        lines += _columns([heads, *(_row(operand) for operand in loop["operands"])])
        if loop["shared"]:
            lines.append(f"shared with another loop, never written: {', '.join(loop['shared'])}")
        lines.append("dialect")
        lines += _columns([[axis, fact["value"], fact["origin"]] for axis, fact in loop["dialect"].items()])
    lines += ["", "requests for one picture of all loops"]
    rows = [[each["table"], each["address"], str(each["count"])] for each in facts["requests"]]
    lines += _columns([["table", "address", "count"], *rows])
    return "\n".join(lines)


def _row(operand: dict[str, Any]) -> list[str]:
    place = _text(operand["address"])
    if operand["bit"] is not None:
        place += f".{operand['bit']}"
    device = f"const {_text(operand['const'])}" if "const" in operand else operand["device"]
    table, confidence = _text(operand["table"]), _text(operand["confidence"])
    return [operand["name"], operand["kind"], operand["unit"], device, table, place, confidence, operand["origin"]]


def _text(value: Any) -> str:
    if value is None:
        return "-"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _columns(rows: list[list[str]]) -> list[str]:
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return [
        "  " + "  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    ]
