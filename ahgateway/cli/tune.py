"""`ahgateway tune`: a model and gains from a recorded trace, or from an experiment on a live loop."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ahgateway.cli.tape import Record as RecordFile
from ahgateway.cli.tape import RecordFrames
from ahgateway.cli.view import Output

if TYPE_CHECKING:
    from ahgateway.apps.tune import Tuning
    from ahgateway.apps.tune_session import Live
    from ahgateway.tuning.blocks import Params
    from ahgateway.tuning.models import Kind
    from ahgateway.tuning.record import Record


def tune(
    source: Annotated[Path, typer.Argument(help="CSV file with time, SV, PV, MV; a recording; or a profile.")],
    loop: Annotated[str | None, typer.Option(help="Loop of a recording or profile with several.")] = None,
    experiment: Annotated[
        str | None,
        typer.Option(
            help="With a profile: step, doublet, relay of MOUT; sv, a step of SV; autotune, the PLC's own (PID_MODE 1)."
        ),
    ] = None,
    arm: Annotated[str | None, typer.Option(metavar="LOOP", help="Arm this loop: without it nothing is sent.")] = None,
    size: Annotated[float | None, typer.Option(help="Size of the step; else sized from noise and PV's answer.")] = None,
    hold: Annotated[float | None, typer.Option(help="Seconds to hold each step; until PV settles otherwise.")] = None,
    hysteresis: Annotated[
        float | None, typer.Option(help="Of the relay, in PV; sized from the noise otherwise.")
    ] = None,
    bias: Annotated[
        float, typer.Option(help="Of the relay: how far off the middle, by --size.", min=-0.8, max=0.8)
    ] = 0.25,
    pv_bounds: Annotated[tuple[float, float] | None, typer.Option(help="PV never leaves these; else aborted.")] = None,
    mv_bounds: Annotated[tuple[float, float] | None, typer.Option(help="MV never leaves these; else aborted.")] = None,
    rate: Annotated[float | None, typer.Option(help="Largest change of PV per second; else aborted.")] = None,
    seconds: Annotated[float, typer.Option(help="Longest time of an experiment or a proof.", min=1.0)] = 600.0,
    repeat: Annotated[int, typer.Option(help="Make the experiment so often; say how far results spread.", min=1)] = 1,
    apply: Annotated[
        str | None, typer.Option(metavar="RULE", help="Write this rule's gains, or `recommended`, and prove them.")
    ] = None,
    onto: Annotated[str | None, typer.Option(metavar="PROFILE", help="With --apply: where a file's gains go.")] = None,
    sv_size: Annotated[float | None, typer.Option(help="Step of SV that proves gains; 5 % of PV's bounds.")] = None,
    sv_hold: Annotated[float | None, typer.Option(help="Seconds SV stands on each side of that step.")] = None,
    rollback: Annotated[bool, typer.Option("--rollback", help="Put back the gains that the last run kept.")] = False,
    save: Annotated[Path | None, typer.Option(help="Write the experiment's trace as CSV.")] = None,
    target: Annotated[str | None, typer.Option(help="Link to use instead of the profile's.")] = None,
    directory: Annotated[Path | None, typer.Option(help="Where journals and leases stand.")] = None,
    record_file: RecordFile = None,
    record_frames: RecordFrames = False,
    instruction: Annotated[
        str | None,
        typer.Option(help="For a CSV file: DPID, DPIDE (default), MELSEC_PID, PID_Temp."),
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
    SV through the write gate inside bounds, and puts everything back at the end, at an abort and at Ctrl-C. With
    --apply the gains are written as one set, proven by a step of SV up and back, and kept only when PV does what was
    predicted. With --record everything seen and written at the loop is kept in a recording. Exit code 0 when proposals
    were made and gains kept, 1 when gains were put back, 3 when the data were refused: too noisy, not excited,
    saturated, drifting, or a valve that sticks; each with its number.

    Example: ahgateway tune step.csv --instruction DPIDE --set CYCLE=200 --set PID_EQ=TRUE --report step.html

    Example: ahgateway tune demo --experiment doublet --arm TIC-101 --pv-bounds 60 100

    Example: ahgateway tune step.csv --apply "SIMC PI" --onto demo --arm TIC-101
    """
    from ahgateway.apps.tune import tune as tuned
    from ahgateway.apps.tune_session import Live
    from ahgateway.cli.profile import _say
    from ahgateway.cli.tune_live import Asked, applied, excited, rolled_back
    from ahgateway.errors import ProfileError

    asked = Asked(
        str(onto or source), arm, loop, experiment, size, hold, pv_bounds, mv_bounds, rate, seconds, target, save,
        repeat, apply, sv_size, sv_hold, record_file, record_frames, hysteresis, bias,
    )  # fmt: skip
    if rollback:
        _say(rolled_back(asked, directory))
        return
    typed = typed_settings(pairs(settings, "--set"))
    kind = _kind(model)

    def judge(record: Record, name: str, known: Params, writable: frozenset[str] | None = None) -> Tuning:
        return tuned(record, name, known | typed, dial=dial, kind=kind, writable=writable)

    _check(source, experiment, apply, onto, repeat)
    if record_file is not None and experiment is None and apply is None:
        raise ProfileError("keeps what is seen at a loop, and a file is no loop", key="--record")
    if experiment is not None:
        live = excited(asked, directory, judge)
    else:
        # --loop names the recording's loop; where gains go, --arm names it, else the same name is meant.
        result = judge(*_source(source, loop, instruction, pairs(columns, "--map")))
        live = Live(result, (result,))
        if apply is not None and not result.is_refused:
            live = applied(asked, directory, result)
    if report is not None:
        _reported(report, live)
    _shown(live, output)
    if report is not None and output is Output.TEXT:
        typer.echo(f"report written to {report}", err=True)
    if live.error is not None:
        raise live.error
    raise typer.Exit(3 if live.result.is_refused else 1 if live.proof is not None and not live.proof.is_kept else 0)


def _kind(model: str | None) -> Kind | None:
    from ahgateway.errors import ProfileError
    from ahgateway.tuning.models import Kind

    kinds = {kind.value: kind for kind in Kind}
    if model is not None and model.upper() not in kinds:
        raise ProfileError(f"`{model}` is no model, known are {', '.join(kinds)}", key="--model")
    return kinds[model.upper()] if model else None


def _check(source: Path, experiment: str | None, apply: str | None, onto: str | None, repeat: int) -> None:
    """Options that only make sense together."""
    from ahgateway.errors import ProfileError

    if experiment is not None and onto is not None:
        raise ProfileError(f"--experiment works on {source} itself", key="--onto", hint="leave --onto out")
    if experiment is None and (apply is None) != (onto is None):
        raise ProfileError(
            "gains of a file need --apply RULE and --onto PROFILE, one of them is missing",
            hint='--apply "SIMC PI" --onto demo',
        )
    if experiment is None and repeat > 1:
        raise ProfileError("only an experiment can be repeated", key="--repeat", hint="--experiment doublet")


def _reported(path: Path, live: Live) -> None:
    from ahgateway.apps.tune_page import page
    from ahgateway.apps.tune_spread import spread
    from ahgateway.errors import ProfileError

    text = page(live.result, live.proof, spread(live.repeats) if len(live.repeats) > 1 else None)
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ProfileError(f"cannot be written: {error.strerror}", file=str(path)) from error


def _shown(live: Live, output: Output) -> None:
    from ahgateway.apps import tune as tuning
    from ahgateway.apps import tune_apply, tune_spread
    from ahgateway.cli.profile import _say

    apart = tune_spread.spread(live.repeats) if len(live.repeats) > 1 else None
    if output is Output.JSON:
        import json

        facts = tuning.as_json(live.result) | {
            "spread": tune_spread.as_json(apart) if apart else None,
            "verification": tune_apply.as_json(live.proof) if live.proof else None,
            "preview": list(live.preview),
        }
        _say(json.dumps(facts, ensure_ascii=False))
        return
    parts = [tuning.as_text(live.result)]
    rules = [each.name for each in (live.result.chosen,) if each] + ([live.proof.rule] if live.proof else [])
    parts += [tune_spread.as_text(apart, rules)] if apart else []
    parts += [tune_apply.as_text(live.proof)] if live.proof else []
    parts += ["\n".join(["would be written:", *(f"  {line}" for line in live.preview)])] if live.preview else []
    _say("\n\n".join(parts))
    if live.preview:
        typer.echo("nothing was sent; --arm LOOP writes and proves it", err=True)


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
    from ahgateway.tuning.conversion import block

    name = block(instruction or "DPIDE").name
    return read_csv(path, columns), name, {}


def pairs(texts: list[str] | None, option: str) -> dict[str, str]:
    """Return NAME=VALUE texts as a table.

    Raises:
        ProfileError: A text without `=`, or a name twice.
    """
    from ahgateway.errors import ProfileError

    out: dict[str, str] = {}
    for text in texts or []:
        name, separator, value = text.partition("=")
        if not separator or not name:
            raise ProfileError(f"`{text}` is not NAME=VALUE", key=option)
        if name.strip() in out:
            raise ProfileError(f"{name} is given twice, {out[name.strip()]} and {value}", key=option)
        out[name.strip()] = value.strip()
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
