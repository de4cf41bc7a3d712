"""`ahgateway replay`: walk a recording execution by execution, PLC beside reference, and judge it again."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Annotated

import typer

from ahgateway.cli.repro import Repro
from ahgateway.cli.view import Output

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from ahgateway.apps.monitor import Report
    from ahgateway.apps.replay import Agreement, Changes, Judges, Replay, ReplayMonitor, TermLine
    from ahgateway.codec.station import Loop
    from ahgateway.lockstep.picture import Picture
    from ahgateway.recording.reader import Recording


def replay(
    file: Annotated[str, typer.Argument(help="Recording, as --record made it.")],
    loop: Annotated[list[str] | None, typer.Option(help="Only this loop; may be given several times.")] = None,
    since: Annotated[
        str | None, typer.Option("--from", help="List from here: seconds from the start, or UTC 2026-11-22T03:04:05.")
    ] = None,
    until: Annotated[str | None, typer.Option("--to", help="List up to here, in the same forms.")] = None,
    diverged: Annotated[bool, typer.Option("--diverged", help="List only executions that diverged.")] = False,
    summary: Annotated[bool, typer.Option("--summary", help="List nothing, say only what came out.")] = False,
    dialect: Annotated[
        list[str] | None, typer.Option(help="Judge with this axis=value of the dialect; may be given several times.")
    ] = None,
    tolerance: Annotated[
        float | None, typer.Option(help="Judge with this tolerance of I and MV, in MV's unit.", min=0.0)
    ] = None,
    ulp: Annotated[int | None, typer.Option(help="Judge with this tolerance in ULP.", min=0)] = None,
    bulk: Annotated[
        bool, typer.Option("--bulk", help="Step the law along the whole recording, compiled; count, list nothing.")
    ] = False,
    one_part: Annotated[
        bool, typer.Option("--one-part", help="Read this part alone, not the parts of its run behind it.")
    ] = False,
    output: Annotated[Output, typer.Option(help="text for people, json for one object per line.")] = Output.TEXT,
    coverage: Annotated[
        float, typer.Option(help="Smallest share of executions proven by bits for exit code 0.", min=0.0, max=1.0)
    ] = 0.0,
    repro: Repro = None,
) -> None:
    """Follow a recording again and list every execution, term by term, PLC beside reference.

    The whole recording is followed, with the parts of its run behind it; --from, --to and --diverged choose what is
    listed. Without other dialects or tolerances the verdicts are held against those of then; another reference than
    then is named. Exit codes as monitor's.

    Example: ahgateway replay demo.ahrec --loop TIC-101 --diverged
    """
    from ahgateway.apps.replay import Changes
    from ahgateway.codec.station import Tolerance

    limits = None if tolerance is None and ulp is None else Tolerance(ulp or 0, tolerance or 0.0)
    changes = Changes(_axes(dialect or []), limits)
    if bulk:
        raise typer.Exit(_bulk(file, one_part, tuple(loop or ()), changes, output))
    listing = _Listing(output, since, until, diverged, summary)
    raise typer.Exit(_replay(file, one_part, tuple(loop or ()), changes, listing, coverage, repro))


@contextlib.contextmanager
def _opened(file: str, one_part: bool) -> Iterator[Recording]:
    """Yield the recording with its parts, and say on stderr when it is more or less than the file that was named."""
    from ahgateway.recording.parts import Parts, opened

    with opened(file, is_alone=one_part) as recording:
        number = int(recording.meta.get("part", "1"))
        if number > 1:
            typer.echo(f"begins with part {number}: what the reference knew before stands in earlier parts", err=True)
        if isinstance(recording, Parts):
            last = recording.rest[-1].path
            typer.echo(f"parts {number} to {number + len(recording.rest)} of one run, up to {last}", err=True)
        yield recording


def _replay(
    file: str,
    one_part: bool,
    loops: tuple[str, ...],
    changes: Changes,
    listing: _Listing,
    coverage_min: float,
    repro: str | None,
) -> int:
    from ahgateway.apps.replay import Comparison, Replay, ReplayMonitor, judged_again, judges
    from ahgateway.cli.repro import reproduced
    from ahgateway.cli.run import recorded_clock
    from ahgateway.transports.replay import ReplayLink

    with _opened(file, one_part) as recording:
        again = Replay(recording, judged_again(recording.station, changes), loops)
        clock = recorded_clock(recording, None)
        monitor = ReplayMonitor(again, ReplayLink(recording, clock), clock)
        then = Comparison(again)
        listing.open(again)
        with reproduced(repro, again.station) as divergences:
            for report in again.reports():
                then.take(report)
                listing.show(report)
                divergences.take(report)
        listing.end(monitor, judges(recording), then.result() if changes.are_none else None, coverage_min)
    return int(monitor.outcome(coverage_min))


class _Listing:
    """Prints what was asked for."""

    def __init__(self, output: Output, since: str | None, until: str | None, diverged: bool, summary: bool) -> None:
        self._output = output
        self._since = since
        self._until = until
        self._diverged = diverged
        self._summary = summary
        self._first_ns = 0
        self._last_ns = 1 << 63
        self._held: list[Report] = []
        self._loops: dict[str, Loop] = {}
        self._utc_ns = 0

    def open(self, replay: Replay) -> None:
        """Work out the times now that the recording is known."""
        from ahgateway.apps.moments import moment_ns

        _, first, _ = replay.recording.totals()
        if self._since is not None:
            self._first_ns = moment_ns(self._since, "--from", first or 0)
        if self._until is not None:
            self._last_ns = moment_ns(self._until, "--to", first or 0)
        self._loops = {name: follower.loop for name, follower in replay.followers.items()}

    def show(self, report: Report) -> None:
        """Print a report when its picture is known: that comes last."""
        from ahgateway.apps.monitor import Sample

        self._utc_ns = report.utc_ns
        if self._summary or not self._first_ns <= report.utc_ns <= self._last_ns:
            self._held.clear()
            return
        if not isinstance(report.event, Sample):
            self._held.append(report)
            return
        for held in self._held:
            self._print(held, report.event.picture)
        self._held.clear()

    def _print(self, report: Report, picture: Picture) -> None:
        from ahgateway.apps.replay import term_lines
        from ahgateway.core.verdict import Verdict
        from ahgateway.lockstep.judge import Execution

        event = report.event
        if self._diverged and not (isinstance(event, Execution) and event.verdict is Verdict.DIVERGED):
            return
        lines = term_lines(self._loops[report.loop], picture, event) if isinstance(event, Execution) else []
        if self._output is Output.JSON:
            _print_json(report, lines)
            return
        from ahgateway.apps.lines import event_line
        from ahgateway.tui.execution import execution_lines

        if isinstance(event, Execution):
            for line in execution_lines(report, event, lines):
                typer.echo(line)
            return
        text = event_line(report)
        if text is not None:
            typer.echo(text)

    def end(self, monitor: ReplayMonitor, who: Judges, then: Agreement | None, coverage_min: float) -> None:
        """Print what came out, and whether it is what came out then."""
        if self._output is Output.JSON:
            from ahgateway.apps.report import summary_json
            from ahgateway.cli.view import print_json

            for watch in monitor.watches:
                print_json(summary_json(monitor, watch.follower, self._utc_ns, coverage_min))
            print_json({"kind": "judges", "same": who.are_same, "then": dict(who.then), "now": dict(who.now)})
            if then is not None:
                print_json(
                    {
                        "kind": "then", "same": then.same, "other": then.other, "only_now": then.only_now,
                        "only_then": then.only_then,
                    }
                )  # fmt: skip
            return
        from ahgateway.apps.lines import summary_lines

        for line in summary_lines(monitor, coverage_min)[:-1]:
            typer.echo(line)
        if not who.are_same:
            typer.echo(f"another reference than then: {_named(who.then)} then, {_named(who.now)} now")
        if then is not None:
            typer.echo(_agreement_line(then))


def _print_json(report: Report, lines: list[TermLine]) -> None:
    from ahgateway.apps.report import as_json, hexadecimal, number
    from ahgateway.cli.view import print_json

    found = as_json(report)
    if found is None:
        return
    if lines:
        found["lines"] = [
            {
                "term": each.term,
                "plc": None if each.plc is None else number(each.plc),
                "ref": number(each.ref),
                "plc_bits": None if each.plc is None else hexadecimal(each.plc),
                "ref_bits": hexadecimal(each.ref),
            }
            for each in lines
        ]
    print_json(found)


def _named(judge: Mapping[str, str]) -> str:
    unsaid = "not said"
    return f"ahgateway {judge['ahgateway']} (core {judge['core'] or unsaid}, judge {judge['judge'] or unsaid})"


def _agreement_line(then: Agreement) -> str:
    if then.is_whole:
        return f"the same verdicts as then: {then.same} of {then.same}"
    text = (
        f"OTHER verdicts than then: {then.same} the same, {then.other} other, {then.only_now} only now, "
        f"{then.only_then} only then"
    )
    if then.first is None:
        return text
    loop, tick, was, now = then.first
    return f"{text}; first {loop} tick {tick}: {was['verdict']} then, {now['verdict']} now"


def _axes(texts: list[str]) -> dict[str, str]:
    from ahgateway.errors import ProfileError

    found = {}
    for text in texts:
        axis, equals, value = text.partition("=")
        if not equals:
            raise ProfileError(f"`{text}` is no axis=value", key="--dialect", hint="such as freeze=outward")
        found[axis.strip()] = value.strip().lower()
    return found


def _bulk(file: str, one_part: bool, loops: tuple[str, ...], changes: Changes, output: Output) -> int:
    from ahgateway.apps.replay_bulk import bulk
    from ahgateway.cli.view import print_json

    with _opened(file, one_part) as recording:
        found = bulk(recording, changes, loops)
    for each in found:
        if output is Output.JSON:
            print_json(each.json())
        else:
            typer.echo(each.line())
    for note in sorted({each.note for each in found if each.note}):
        typer.echo(note, err=True)
    if any(each.differing for each in found):
        return 1
    return 0 if any(each.executions for each in found) else 3
