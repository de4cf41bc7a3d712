"""`ahgateway check`: scenarios run on a bench, each with a verdict, for people and for CI."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from ahgateway.cli.check_ground import Asked, ground, runnable
from ahgateway.cli.view import Output, print_json

if TYPE_CHECKING:
    import asyncio
    from collections.abc import AsyncIterator

    from ahgateway.apps.check.fingerprint import Difference
    from ahgateway.apps.check.history import Past
    from ahgateway.apps.check.result import Floor, Result
    from ahgateway.apps.check.suite import Ground
    from ahgateway.schema.scenario import KnownForm, Scenario

Item = TypeVar("Item")

MARKS = {"pass": "pass", "known": "known", "inconclusive": "INCONCLUSIVE", "error": "ERROR", "fail": "FAIL"}


def check(
    paths: Annotated[
        list[str] | None,
        typer.Argument(
            help="Scenario files and folders, or the shipped `conformance` (`dpid` and `dpide`), `melsec_pid`, "
            "`pid_reg_ce`, `pid_temp`, `plants`."
        ),
    ] = None,
    profile: Annotated[
        str | None, typer.Option(help="Profile of the bench: its loops and dialects; without it the shipped bench.")
    ] = None,
    target: Annotated[
        str | None, typer.Option(help="The PLC: fake://PROFILE, or a real one; without it the profile's own target.")
    ] = None,
    over: Annotated[
        str, typer.Option(help="How it is reached: memory, tcp, rtu or ascii on a local socket.")
    ] = "memory",
    loop: Annotated[str, typer.Option(help="Loop to use; the first with the scenario's instruction otherwise.")] = "",
    arm: Annotated[bool, typer.Option("--arm", help="Really drive a real bench; everything is put back.")] = False,
    directory: Annotated[Path | None, typer.Option(help="Where journals and leases of a real bench stand.")] = None,
    expression: Annotated[
        str,
        typer.Option("-k", metavar="EXPR", help="Only names that hold this text; `a or b`, `not a` are understood."),
    ] = "",
    shard: Annotated[str | None, typer.Option(metavar="I/N", help="Only this part of N, from 1.")] = None,
    repeat: Annotated[int, typer.Option(help="Run each so often, each time with the next seed.", min=1, max=1000)] = 1,
    seed: Annotated[int, typer.Option(help="Of the noise; equal seeds give equal words.", min=0)] = 1,
    known: Annotated[Path | None, typer.Option(help="File of known differences.")] = None,
    junit: Annotated[Path | None, typer.Option(help="Write JUnit XML.")] = None,
    html: Annotated[Path | None, typer.Option(help="Write a report as one HTML file.")] = None,
    fingerprint: Annotated[Path | None, typer.Option(help="Write what every execution left, to compare with.")] = None,
    against: Annotated[
        Path | None, typer.Option(help="Compare with this fingerprint; a difference is a failure.")
    ] = None,
    compare: Annotated[
        tuple[Path, Path] | None,
        typer.Option(metavar="OLD NEW", help="Run nothing: compare two fingerprints that were kept."),
    ] = None,
    record: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Keep a recording of each scenario in this folder.")
    ] = None,
    history: Annotated[Path | None, typer.Option(help="Keep the results here, and say since when one fails.")] = None,
    output: Annotated[Output, typer.Option(help="text for people, json for one object per line.")] = Output.TEXT,
) -> None:
    """Run scenarios on a bench, a fake in virtual time or a real PLC, and say whether each passes.

    A scenario is a TOML file: a process, a time line, and what must be seen. Before the first one the bench runs
    against itself; a bench that fails this is condemned, and nothing is said of the product. On a real PLC of kind =
    "bench" the process is simulated here and PV written into the PLC, with --arm only. Exit code 0 when
    everything passed or failed only where --known expects it, 1 when something failed or differs from --against, 2 for
    a wrong file, 3 when something was inconclusive, the bench was broken, or nothing was checked.

    Example: ahgateway check conformance --junit check.xml --html check.html

    Example: ahgateway check dpide -k "manual or saturation" --profile demo

    Example: ahgateway check --compare firmware-1.json firmware-2.json

    Example: ahgateway check dpide --profile bench.toml --target modbus+tcp://192.0.2.10:502 --arm --history nights.db
    """
    import asyncio

    from ahgateway.errors import ProfileError, StateError
    from ahgateway.schema.scenario import collected, known_differences

    if (compare is None) == (not paths):
        raise ProfileError("name scenarios, or two fingerprints with --compare", hint="`ahgateway check conformance`")
    if compare is not None:
        raise typer.Exit(_compared(*compare, output))
    scenarios = [each for each in collected(paths or []) if _is_wanted(each.name, expression)]
    if not scenarios:
        raise StateError(
            f"no scenario matches -k `{expression}`", hint="`ahgateway check conformance` runs the shipped"
        )
    part = _shard(scenarios, shard)
    asked = Asked(profile, target, loop, over, arm, directory, record)
    entries = () if known is None else known_differences(known)
    files = _Files(junit, html, fingerprint, against, history, is_part=bool(expression or shard))
    raise typer.Exit(asyncio.run(_check(part, asked, _Wish(seed, repeat, entries, files, output))))


def _compared(old: Path, new: Path, output: Output) -> int:
    """Compare two kept fingerprints; return the exit code."""
    from ahgateway.apps.check.fingerprint import compared, read

    before, after = read(old), read(new)
    differences = compared(before, after)
    both = len(set(before["scenarios"]) & set(after["scenarios"]))
    code = 1 if differences else 0 if both else 3
    if output is Output.JSON:
        print_json({"kind": "compare", "scenarios": both, "exit": code, "differences": _told(differences)})
        return code
    for each in differences:
        typer.echo(f"{each.scenario:28} {each.text}")
    typer.echo(f"{both} scenarios in both, {len(differences)} differ")
    return code


def _told(differences: list[Difference]) -> list[dict[str, Any]]:
    return [{"scenario": each.scenario, "text": each.text, "change": each.change} for each in differences]


class _Files:
    """What is written behind a run, and read for it."""

    def __init__(
        self,
        junit: Path | None,
        html: Path | None,
        fingerprint: Path | None,
        against: Path | None,
        history: Path | None,
        *,
        is_part: bool,
    ) -> None:
        from ahgateway.apps.check.fingerprint import read

        written = {"--junit": junit, "--html": html, "--fingerprint": fingerprint, "--history": history}
        for option, path in written.items():
            _check_place(option, path)
        self.junit, self.html, self.fingerprint = junit, html, fingerprint
        self.against, self.history, self.is_part = against, history, is_part
        self.before = None if against is None else read(against)


@dataclass(frozen=True, slots=True)
class _Wish:
    """How scenarios are run, and what becomes of their results."""

    seed: int
    repeat: int
    known: tuple[KnownForm, ...]
    files: _Files
    output: Output


async def _check(scenarios: list[Scenario], asked: Asked, wish: _Wish) -> int:
    """Run what the ground can carry out, however it ends; return the exit code."""
    from ahgateway.apps.check.suite import unused
    from ahgateway.cli.interrupt import stop_event
    from ahgateway.clock import WallClock

    if not scenarios:
        typer.echo("nothing was checked: this shard is empty", err=True)
        return 3
    utc_ns = WallClock().utc_ns()
    async with ground(asked) as bench:
        part, left_out = runnable(scenarios, bench)
        for name, reason in left_out:
            typer.echo(f"note: {name} is left out: {reason}", err=True)
        with stop_event() as stop:
            found, floor = await _carried_out(part, bench, wish, utc_ns, stop)
        for entry in unused(wish.known, found):
            typer.echo(f"note: known difference `{entry.scenario}` of {entry.owner} was not seen", err=True)
        rest = f", {len(left_out)} left out" if left_out else ""
        claim = _claim(found, floor, rest, is_whole=not stop.is_set())
        return _closed(found, floor, bench, claim, wish, utc_ns, is_whole=not stop.is_set())


async def _carried_out(
    scenarios: list[Scenario], bench: Ground, wish: _Wish, utc_ns: int, stop: asyncio.Event
) -> tuple[list[Result], Floor]:
    """Try the bench, then run each scenario; a signal ends the one under way, which puts everything back."""
    from datetime import UTC, datetime

    from ahgateway.apps.check.result import Floor
    from ahgateway.apps.check.suite import results
    from ahgateway.clock import SECOND, WallClock

    wall = WallClock()
    floor = Floor(False, "nothing was left to check")
    async for instruction, floor in _until(stop, bench.floors(scenarios, wish.seed, wall)):
        _say_floor(f"bench {instruction}", floor, wish.output)
    found: list[Result] = []
    if floor.is_sound:
        today = datetime.fromtimestamp(utc_ns // SECOND, UTC).date()
        running = results(
            scenarios, bench, wall, seed=wish.seed, repeat=wish.repeat, known=wish.known, today=today
        )  # fmt: skip
        async for result in _until(stop, running):
            found.append(result)
            _say(result, wish.output)
    return found, floor


async def _until(stop: asyncio.Event, items: AsyncIterator[Item]) -> AsyncIterator[Item]:
    """Yield items until there are no more, or cancel the one that is being made once `stop` is set."""
    import asyncio

    stopping = asyncio.ensure_future(stop.wait())
    try:
        while True:
            coming = asyncio.ensure_future(_next(items))
            await asyncio.wait({coming, stopping}, return_when=asyncio.FIRST_COMPLETED)
            if not coming.done():
                coming.cancel()
            try:
                made = await coming
            except asyncio.CancelledError:
                return
            if not made:
                return
            yield made[0]
    finally:
        stopping.cancel()


async def _next(items: AsyncIterator[Item]) -> tuple[Item, ...]:
    async for item in items:
        return (item,)
    return ()


def _closed(
    found: list[Result], floor: Floor, bench: Ground, claim: str, wish: _Wish, utc_ns: int, *, is_whole: bool
) -> int:
    """Write the files, say what came out, return the exit code."""
    from ahgateway.apps.check import fingerprint as prints
    from ahgateway.apps.check.history import sentence
    from ahgateway.apps.check.junit import junit
    from ahgateway.apps.check.page import page
    from ahgateway.apps.check.result import run_exit

    files, seed, output, target = wish.files, wish.seed, wish.output, bench.target
    mine = prints.fingerprint(found, seed, is_repeatable=bench.is_repeatable)
    differences = [] if files.before is None else prints.compared(files.before, mine, is_part=files.is_part)
    code = int(run_exit(found))
    if differences:
        code = 1
    elif not is_whole and code == 0:
        code = 3
    if files.junit is not None:
        _write(files.junit, junit(found if floor.is_sound else [_condemned(floor)], target, utc_ns))
    if files.fingerprint is not None:
        _write(files.fingerprint, prints.text_of(mine))
    past = [] if files.history is None else _past(files.history, found, target, seed, utc_ns)
    if files.html is not None:
        text = page(
            found, floor=floor, target=target, claim=claim, seed=seed, utc_ns=utc_ns,
            against=str(files.against or ""), differences=differences, past=past,
        )  # fmt: skip
        _write(files.html, text)
    if output is Output.JSON:
        print_json(
            {"kind": "run", "claim": claim, "exit": code, "seed": seed, "differences": _told(differences)}
            | _past_json(past)
        )
        return code
    for each in differences:
        typer.echo(f"{each.scenario:28} {each.text}")
    if files.before is not None and not differences:
        typer.echo(f"the same words as in {files.against}")
    for one in past:
        if line := sentence(one):
            typer.echo(f"{one.name:28} {line}")
    typer.echo(claim)
    return code


def _past(path: Path, found: list[Result], target: str, seed: int, utc_ns: int) -> list[Past]:
    from ahgateway import __version__
    from ahgateway.apps.check.history import kept

    return kept(path, found, target, seed, __version__, utc_ns)


def _past_json(past: list[Past]) -> dict[str, Any]:
    told = [
        {"name": each.name, "runs": each.runs, "failed_since": each.failed_since, "flips": each.flips} for each in past
    ]
    return {"history": told} if told else {}


def _condemned(floor: Floor) -> Result:
    from ahgateway.apps.check.result import Result, Verdict

    text = f"the bench fails against itself: {floor.text}"
    return Result("bench/against-itself", "The bench against itself", "", Verdict.ERROR, text)


def _claim(found: list[Result], floor: Floor, rest: str, *, is_whole: bool) -> str:
    if not floor.is_sound:
        return "bench broken: nothing is said of the product"
    kinds = [each.verdict.value for each in found]
    counted = ", ".join(f"{kinds.count(kind)} {kind}" for kind in MARKS if kind in kinds)
    took = f"{sum(each.simulated_s for each in found):.0f} s simulated in {sum(each.wall_s for each in found):.1f} s"
    stopped = "" if is_whole else "stopped before the end: "
    return f"{stopped}{len(found)} scenarios: {counted or 'nothing was checked'}{rest}; {took}"


def _say_floor(name: str, floor: Floor, output: Output) -> None:
    if output is Output.JSON:
        print_json({"kind": "bench", "name": name, "sound": floor.is_sound, "text": floor.text, "noise": floor.noise})
    else:
        typer.echo(f"{name:28} {'sound' if floor.is_sound else 'BROKEN':12} {floor.text}")


def _say(result: Result, output: Output) -> None:
    from ahgateway.apps.check.pace import sentence
    from ahgateway.apps.check.result import State, Verdict

    if output is Output.JSON:
        print_json(_as_json(result))
        return
    typer.echo(f"{result.name:28} {MARKS[result.verdict.value]:12} {result.reason}")
    if result.pace:
        typer.echo(f"{'':30}pace: {sentence(result.pace)}")
    if result.verdict is Verdict.PASS:
        return
    for each in result.outcomes:
        if each.state is not State.MET:
            typer.echo(f"{'':30}{each.state.value} {each.name}: {each.text}")
    for trouble in result.troubles:
        typer.echo(f"{'':30}bench, from {trouble.at_s:.2f} s on: {trouble.text}")


def _as_json(result: Result) -> dict[str, Any]:
    from ahgateway.apps.report import counts_json, number

    return {
        "kind": "scenario",
        "name": result.name,
        "instruction": result.instruction,
        "verdict": result.verdict.value,
        "reason": result.reason,
        "seed": result.seed,
        "expectations": [
            {"name": each.name, "state": each.state.value, "text": each.text, "figure": number(each.figure),
             "at": each.at_s}
            for each in result.outcomes
        ],
        "troubles": [{"at": each.at_s, "text": each.text} for each in result.troubles],
        "counts": counts_json(result.counts),
        "coverage": result.counts.coverage,
        "simulated_s": result.simulated_s,
        "wall_s": round(result.wall_s, 3),
        "pace": {name: number(each) for name, each in result.pace.items()},
    }  # fmt: skip


def _is_wanted(name: str, expression: str) -> bool:
    """`a or b and not c`, each a part of the name."""

    def holds(term: str) -> bool:
        text = term.strip()
        return not holds(text[4:]) if text.startswith("not ") else text in name

    alternatives = re.split(r"\s+or\s+", expression)
    return any(all(holds(term) for term in re.split(r"\s+and\s+", each)) for each in alternatives)


def _shard(scenarios: list[Scenario], text: str | None) -> list[Scenario]:
    from ahgateway.apps.check.suite import sharded
    from ahgateway.errors import ProfileError

    if text is None:
        return scenarios
    match = re.fullmatch(r"(\d+)/(\d+)", text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise ProfileError(f"`{text}` is no shard, allowed are 1/N to N/N", key="--shard")
    return sharded(scenarios, int(match[1]), int(match[2]))


def _check_place(option: str, path: Path | None) -> None:
    """Refuse a place where nothing can be written before a night is spent on what would stand there."""
    from ahgateway.errors import ProfileError

    if path is None:
        return
    if path.is_dir():
        raise ProfileError("is a folder, and a file is written", file=str(path), key=option)
    if not path.parent.is_dir():
        raise ProfileError("its folder does not exist", file=str(path), key=option, hint=f"make {path.parent} first")


def _write(path: Path, text: str) -> None:
    from ahgateway.errors import ProfileError

    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ProfileError(f"cannot be written: {error.strerror}", file=str(path)) from error
