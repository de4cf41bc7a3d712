"""`ahgateway tune`: a model and gains from a recorded trace, or from an experiment on a live loop."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ahgateway.cli.tape import Record as RecordFile
from ahgateway.cli.tape import RecordFrames
from ahgateway.cli.view import Output

if TYPE_CHECKING:
    from ahgateway.tuning.blocks import Params
    from ahgateway.tuning.record import Record


def tune(
    source: Annotated[Path, typer.Argument(help="CSV file with time, SV, PV, MV; a recording; or a profile.")],
    loop: Annotated[str | None, typer.Option(help="Loop of a recording or profile with several.")] = None,
    experiment: Annotated[
        str | None, typer.Option(help="With a profile: step, doublet or relay of MOUT, or sv, a step of SV.")
    ] = None,
    arm: Annotated[str | None, typer.Option(metavar="LOOP", help="Arm this loop: without it nothing is sent.")] = None,
    size: Annotated[float | None, typer.Option(help="Size of the step; sized from noise and range otherwise.")] = None,
    hold: Annotated[float | None, typer.Option(help="Seconds to hold each step; until PV settles otherwise.")] = None,
    pv_bounds: Annotated[tuple[float, float] | None, typer.Option(help="PV never leaves these; else aborted.")] = None,
    mv_bounds: Annotated[tuple[float, float] | None, typer.Option(help="MV never leaves these; else aborted.")] = None,
    rate: Annotated[float | None, typer.Option(help="Largest change of PV per second; else aborted.")] = None,
    seconds: Annotated[float, typer.Option(help="Longest time of the whole experiment.", min=1.0)] = 600.0,
    save: Annotated[Path | None, typer.Option(help="Write the experiment's trace as CSV.")] = None,
    target: Annotated[str | None, typer.Option(help="Link to use instead of the profile's.")] = None,
    directory: Annotated[Path | None, typer.Option(help="Where journals and leases stand.")] = None,
    record_file: RecordFile = None,
    record_frames: RecordFrames = False,
    instruction: Annotated[
        str | None, typer.Option(help="DPID or DPIDE, for a CSV file; a recording knows it. Default DPIDE.")
    ] = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="An operand as it stands now: CYCLE=200.")
    ] = None,
    columns: Annotated[
        list[str] | None, typer.Option("--map", metavar="NAME=COLUMN", help="Column of time, SV, PV or MV.")
    ] = None,
    dial: Annotated[float, typer.Option(help="0 cautious, 0.5 the rule as published, 1 fast.", min=0.0, max=1.0)] = 0.5,
    model: Annotated[str | None, typer.Option(help="FOPDT, SOPDT or IPDT; without it the data choose.")] = None,
    report: Annotated[Path | None, typer.Option(help="Write a report as one HTML file.")] = None,
    output: Annotated[Output, typer.Option(help="text for people, json for one object.")] = Output.TEXT,
) -> None:
    """Find a loop's process in a recorded trace and propose gains in the loop's own form.

    With a CSV file or a recording it works without a PLC. With a profile, --experiment and --arm LOOP it moves MOUT or
    SV through the write gate inside bounds, and puts everything back at the end, at an abort and at Ctrl-C. The gains
    themselves are never written here. With --record everything seen and written is kept in a recording. Exit code 0
    when proposals were made, 3 when the data were refused: too noisy, not excited, saturated, drifting, or a valve that
    sticks; each with its number.

    Example: ahgateway tune step.csv --instruction DPIDE --set CYCLE=200 --set PID_EQ=TRUE --report step.html

    Example: ahgateway tune demo --experiment doublet --arm TIC-101 --pv-bounds 60 100
    """
    from ahgateway.apps.tune import as_json, as_text
    from ahgateway.apps.tune import tune as tuned
    from ahgateway.cli.profile import _say
    from ahgateway.errors import ProfileError
    from ahgateway.tuning.models import Kind

    kinds = {kind.value: kind for kind in Kind}
    if model is not None and model.upper() not in kinds:
        raise ProfileError(f"`{model}` is no model, known are {', '.join(kinds)}", key="--model")
    if experiment is None and record_file is not None:
        raise ProfileError("keeps what an experiment shows, and none is asked for", key="--record")
    if experiment is not None:
        from ahgateway.cli.tune_live import Asked, excited

        asked = Asked(
            str(source), arm, loop, experiment, size, hold, pv_bounds, mv_bounds, rate, seconds, target, save,
            record_file, record_frames,
        )  # fmt: skip
        record, name, known = excited(asked, directory)
    else:
        record, name, known = _source(source, loop, instruction, pairs(columns, "--map"))
    typed = typed_settings(pairs(settings, "--set"))
    kind = kinds[model.upper()] if model else None
    result = tuned(record, name, known | typed, dial=dial, kind=kind)
    if report is not None:
        from ahgateway.apps.tune_page import page

        try:
            report.write_text(page(result), encoding="utf-8")
        except OSError as error:
            raise ProfileError(f"cannot be written: {error.strerror}", file=str(report)) from error
    if output is Output.JSON:
        import json

        _say(json.dumps(as_json(result), ensure_ascii=False))
    else:
        _say(as_text(result))
        if report is not None:
            typer.echo(f"report written to {report}", err=True)
    raise typer.Exit(3 if result.is_refused else 0)


def _source(
    path: Path, loop: str | None, instruction: str | None, columns: dict[str, str]
) -> tuple[Record, str, Params]:
    """The trace, the instruction and what is known of its settings."""
    from ahgateway.apps.tune_source import is_recording, read_csv, read_recording
    from ahgateway.errors import ProfileError

    if not path.is_file():
        raise ProfileError("is no file", file=str(path), hint="a profile needs --experiment")
    if is_recording(path):
        record, name, settings = read_recording(path, loop)
        return record, name, settings
    name = (instruction or "DPIDE").upper()
    if name not in ("DPID", "DPIDE"):
        raise ProfileError(
            f"`{instruction}` is no instruction of the AH500, known are DPID, DPIDE", key="--instruction"
        )
    return read_csv(path, columns), name, {}


def pairs(texts: list[str] | None, option: str) -> dict[str, str]:
    """Return NAME=VALUE texts as a table.

    Raises:
        ProfileError: A text without `=`.
    """
    from ahgateway.errors import ProfileError

    out = {}
    for text in texts or []:
        name, separator, value = text.partition("=")
        if not separator or not name:
            raise ProfileError(f"`{text}` is not NAME=VALUE", key=option)
        out[name] = value
    return out


def typed_settings(texts: dict[str, str]) -> Params:
    """Return settings as numbers and truth values.

    Raises:
        ProfileError: A value that is neither.
    """
    from ahgateway.errors import ProfileError

    words = {"true": True, "false": False, "on": True, "off": False}
    out: Params = {}
    for name, text in texts.items():
        if text.strip().lower() in words:
            out[name] = words[text.strip().lower()]
            continue
        try:
            value = float(text)
        except ValueError:
            raise ProfileError(f"`{text}` is neither a number nor TRUE or FALSE", key=name) from None
        out[name] = int(value) if value.is_integer() else value
    return out
