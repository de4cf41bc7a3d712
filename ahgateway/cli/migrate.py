"""`ahgateway migrate`: settings of one controller rebuilt for another, with the proof; sends nothing to any PLC."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ahgateway.cli.tune import pairs, typed_settings
from ahgateway.cli.view import Output

if TYPE_CHECKING:
    from ahgateway.tuning.blocks import Family, Params
    from ahgateway.tuning.models import Model
    from ahgateway.tuning.record import Record

Range = tuple[float, float]


def migrate(
    settings: Annotated[list[str], typer.Argument(metavar="FILE|NAME=VALUE…", help="TOML file, or settings.")],
    source: Annotated[str, typer.Option("--from", help="DPID, DPIDE, MELSEC_PID, PIDINIT, PID_Temp or PID_REG_CE.")],
    target: Annotated[str, typer.Option("--to", help="One of the same.")],
    pv_from: Annotated[Range, typer.Option(help="Range of PV at the source.")] = (0.0, 100.0),
    mv_from: Annotated[Range, typer.Option(help="Range of MV at the source.")] = (0.0, 100.0),
    pv_to: Annotated[Range | None, typer.Option(help="Range of PV at the target; the same otherwise.")] = None,
    mv_to: Annotated[Range | None, typer.Option(help="Range of MV at the target; the same otherwise.")] = None,
    family_from: Annotated[str | None, typer.Option(help="CPU family of a Delta source: ah500 or as.")] = None,
    family_to: Annotated[str | None, typer.Option(help="CPU family of a Delta target: ah500 or as.")] = None,
    stroke: Annotated[
        float | None, typer.Option(help="Stroke time in s of PID_REG_CE's motor; none: Y is used.")
    ] = None,
    process: Annotated[
        list[str] | None, typer.Option(metavar="NAME=VALUE", help="Process of the proof: gain=1.5 dead=4 tau=40.")
    ] = None,
    record: Annotated[
        Path | None, typer.Option(help="CSV file or recording: its process, and SV and PV for both.")
    ] = None,
    name: Annotated[str, typer.Option(help="Tag of the loop in the profile fragment.")] = "TIC-101",
    fragment: Annotated[Path | None, typer.Option(help="Write the profile fragment.")] = None,
    report: Annotated[Path | None, typer.Option(help="Write a report as one HTML file.")] = None,
    output: Annotated[Output, typer.Option(help="text for people, json for one object.")] = Output.TEXT,
) -> None:
    """Rebuild a controller's settings for another, name every approximation with its size, and prove the result.

    Both controllers run in their own arithmetic on the same process. Exit code 0 when they are identical or equivalent
    within 1 %, 1 when they differ, 3 when there is no law of ours to prove it with.

    Example: ahgateway migrate KP=250 TI=300 KD=20 TD=400 TS=500 ACT=1 --from MELSEC_PID --to DPIDE
    """
    from ahgateway.apps.migrate import Verdict, as_json
    from ahgateway.apps.migrate import migrate as migrated
    from ahgateway.apps.migrate_text import as_text
    from ahgateway.apps.migrate_text import fragment as piece
    from ahgateway.cli.profile import _say
    from ahgateway.errors import ProfileError
    from ahgateway.tuning.blocks import Use
    from ahgateway.tuning.canonical import Scaling

    given, file = _settings(settings)
    if stroke is not None and not 0.0 < stroke < math.inf:
        raise ProfileError(f"{stroke:g} is no stroke time above 0", key="--stroke")
    _check_ranges(pv_from=pv_from, mv_from=mv_from, pv_to=pv_to, mv_to=mv_to)
    found_process, trace = _process(process, record)
    found = migrated(
        source,
        given,
        target,
        scaling=Scaling(pv_from, mv_from, pv_to or pv_from, mv_to or mv_from),
        use_from=Use(_family(family_from, source, "--family-from"), stroke),
        use_to=Use(_family(family_to, target, "--family-to"), stroke),
        process=found_process,
        record=trace,
        file=file,
    )
    if fragment is not None:
        _written(fragment, piece(found, name))
    if report is not None:
        from ahgateway.apps.migrate_page import page

        _written(report, page(found, name))
    if output is Output.JSON:
        import json

        _say(json.dumps(as_json(found), ensure_ascii=False))
    else:
        _say(as_text(found))
    codes = {Verdict.IDENTICAL: 0, Verdict.EQUIVALENT: 0, Verdict.DIFFERENT: 1, Verdict.UNPROVEN: 3}
    raise typer.Exit(codes[found.verdict])


def _settings(texts: list[str]) -> tuple[Params, str]:
    """Settings from NAME=VALUE texts, or from a TOML file of them."""
    from ahgateway.errors import ProfileError

    if len(texts) > 1 or "=" in texts[0]:
        return typed_settings(pairs(texts, "settings")), ""
    from ahgateway.schema.files import read, tables

    file = texts[0]
    if not Path(file).is_file():
        raise ProfileError("is no file, and no NAME=VALUE either", file=file)
    found = tables(read(Path(file), file), file)
    nested = [key for key, value in found.items() if isinstance(value, dict)]
    if nested:
        raise ProfileError("is a table; settings stand at the top, NAME = VALUE", file=file, key=nested[0])
    return found, file


def _check_ranges(**ranges: Range | None) -> None:
    from ahgateway.errors import ProfileError

    for name, pair in ranges.items():
        if pair is not None and not -math.inf < pair[0] < pair[1] < math.inf:
            raise ProfileError(
                f"{pair[0]:g} and {pair[1]:g} are no range, lowest first", key=f"--{name.replace('_', '-')}"
            )


def _family(text: str | None, block: str, option: str) -> Family:
    """The CPU family; a Delta block without one is taken for an AH500's, and that is said."""
    from ahgateway.errors import ProfileError
    from ahgateway.tuning.blocks import Family

    if text is None:
        if block.upper() in ("DPID", "DPIDE"):
            typer.echo(f"{block}: PID_DIR as an AH500 means it; {option} as, if it stands in an AS PLC", err=True)
        return Family.AH500
    for family in Family:
        if family.value == text.lower():
            return family
    raise ProfileError(f"`{text}` is no CPU family, known are {', '.join(each.value for each in Family)}", key=option)


def _process(texts: list[str] | None, record: Path | None) -> tuple[Model | None, Record | None]:
    """The process of the proof, as typed, or identified from a record, or none; and the record."""
    from ahgateway.errors import ProfileError, StateError
    from ahgateway.tuning.models import Kind, Model

    trace = None
    if record is not None:
        from ahgateway.apps.tune_source import is_recording, read_csv, read_recording
        from ahgateway.tuning.identify import identify

        if not record.is_file():
            raise ProfileError("is no file", file=str(record))
        trace = read_recording(record)[0] if is_recording(record) else read_csv(record)
        if not texts:
            found = identify(trace)
            if found.fit is None or found.is_refused:
                reasons = "; ".join(each.text for each in found.findings)
                raise StateError(
                    f"{record}: no process can be told from it: {reasons}",
                    hint="give one with --process; the recorded SV and PV go through both all the same",
                )
            return found.fit.model, trace
    if not texts:
        return None, trace
    values = typed_settings(pairs(texts, "--process"))
    unknown = set(values) - {"gain", "dead", "tau", "zeta"}
    if unknown or "gain" not in values:
        raise ProfileError("takes gain, dead, tau and zeta; without tau it integrates", key="--process")
    kind = Kind.IPDT if "tau" not in values else (Kind.SOPDT if "zeta" in values else Kind.FOPDT)
    gain, dead = float(values["gain"]), float(values.get("dead", 0.0))
    tau, zeta = float(values.get("tau", 1.0)), float(values.get("zeta", 1.0))
    if not (gain != 0.0 and dead >= 0.0 and tau > 0.0 and zeta > 0.0):
        raise ProfileError("gain must not be 0, dead not negative, tau and zeta above 0", key="--process")
    return Model(kind, gain, dead, tau, zeta), trace


def _written(path: Path, text: str) -> None:
    from ahgateway.errors import ProfileError

    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ProfileError(f"cannot be written: {error.strerror}", file=str(path)) from error
    typer.echo(f"{path}: written", err=True)
