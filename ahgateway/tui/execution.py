"""One execution as lines: its verdict, then every term, what stands in the PLC beside the reference."""

from __future__ import annotations

from ahgateway.apps.lines import blame_text, clock_time, shown
from ahgateway.apps.monitor import Report
from ahgateway.apps.replay import TermLine
from ahgateway.apps.report import hexadecimal
from ahgateway.core import flags
from ahgateway.core.real import same_bits, ulp_distance
from ahgateway.lockstep.judge import Execution

VALUE_WIDTH = 28


def execution_lines(report: Report, execution: Execution, terms: list[TermLine]) -> list[str]:
    """Return the lines, headings included where there are terms."""
    known = [each.value for each in (execution.proof, execution.weight) if each is not None]
    head = " ".join([clock_time(report.utc_ns), report.loop, "tick", str(report.tick), execution.verdict.value, *known])
    why = blame_text(execution.blame) if execution.blame is not None else execution.reason
    count = f" ×{execution.count}" if execution.count > 1 else ""
    lines = [f"{head}{count}: {why}" if why else f"{head}{count}"]
    if not terms:
        return lines
    lines.append(f"    {'term':<6} {'plc':<{VALUE_WIDTH}} {'ref':<{VALUE_WIDTH}}".rstrip())
    lines.extend(_line(each) for each in terms)
    said = ", ".join(flags.names(getattr(execution.terms, "flags", 0)))
    return [*lines, f"    flags  {said}"] if said else lines


def _line(each: TermLine) -> str:
    ref = f"{shown(each.ref)} ({hexadecimal(each.ref)})"
    if each.plc is None:
        return f"    {each.term:<6} {'-':<{VALUE_WIDTH}} {ref}"
    plc = f"{shown(each.plc)} ({hexadecimal(each.plc)})"
    apart = "" if same_bits(each.plc, each.ref) else f"  {_distance(each)}"
    return f"    {each.term:<6} {plc:<{VALUE_WIDTH}} {ref}{apart}"


def _distance(each: TermLine) -> str:
    assert each.plc is not None
    distance = ulp_distance(each.plc, each.ref)
    return "differs" if distance is None else f"{distance} ULP apart"
