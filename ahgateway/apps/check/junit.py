"""Results as JUnit XML, in the form that CI systems read (the schema of the Jenkins xUnit plugin).

A failure says that the product differs, an error that the bench or the scenario does; what is inconclusive is an
error too, since a night that proved nothing must not be green. A known difference is skipped, with its reason.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from xml.etree import ElementTree

from ahgateway.apps.check.result import Result, State, Verdict
from ahgateway.clock import SECOND

_NO_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")

ELEMENT = {
    Verdict.FAIL: "failure",
    Verdict.ERROR: "error",
    Verdict.INCONCLUSIVE: "error",
    Verdict.KNOWN: "skipped",
}
"""Verdict to the element of a test case that says it; PASS has none."""


def junit(results: Sequence[Result], target: str, utc_ns: int) -> str:
    """Return the results as one XML document with one suite.

    Args:
        results: In the order in which they ran.
        target: What they ran on.
        utc_ns: When the run began.
    """
    kinds = [ELEMENT.get(each.verdict, "") for each in results]
    counts = {
        "tests": len(results),
        "failures": kinds.count("failure"),
        "errors": kinds.count("error"),
        "skipped": kinds.count("skipped"),
    }
    numbers = {key: str(count) for key, count in counts.items()}
    took = f"{sum(each.wall_s for each in results):.3f}"
    root = ElementTree.Element("testsuites", {"name": "ahgateway check", "time": took} | _without_skipped(numbers))
    when = datetime.fromtimestamp(utc_ns // SECOND, UTC).strftime("%Y-%m-%dT%H:%M:%S")
    suite = ElementTree.SubElement(
        root,
        "testsuite",
        {"name": "ahgateway check", "time": took, "timestamp": when, "hostname": "localhost"} | numbers,
    )
    properties = ElementTree.SubElement(suite, "properties")
    ElementTree.SubElement(properties, "property", {"name": "target", "value": _clean(target)})
    for each in results:
        _case(suite, each)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _without_skipped(numbers: dict[str, str]) -> dict[str, str]:
    return {key: number for key, number in numbers.items() if key != "skipped"}


def _case(suite: ElementTree.Element, result: Result) -> None:
    folder, _, name = result.name.rpartition("/")
    attributes = {"name": _clean(name), "classname": _clean(folder or "scenarios"), "time": f"{result.wall_s:.3f}"}
    case = ElementTree.SubElement(suite, "testcase", attributes)
    kind = ELEMENT.get(result.verdict)
    if kind == "skipped":
        ElementTree.SubElement(case, kind, {"message": _clean(result.reason)})
    elif kind is not None:
        told = ElementTree.SubElement(case, kind, {"message": _clean(result.reason), "type": result.verdict.value})
        told.text = _clean("\n".join(lines(result)))
    out = ElementTree.SubElement(case, "system-out")
    out.text = _clean("\n".join([result.title, *lines(result)]))


def lines(result: Result) -> list[str]:
    """Return the expectations of a result and the bench's troubles, a line each, without colour."""
    marks = {State.MET: "met", State.VIOLATED: "VIOLATED", State.UNKNOWN: "unknown"}
    found = [f"{marks[each.state]:8} {each.name}: {each.text}" for each in result.outcomes]
    return found + [f"bench    from {each.at_s:.2f} s: {each.text}" for each in result.troubles]


def _clean(text: str) -> str:
    """Take out what XML cannot hold."""
    return _NO_XML.sub("\ufffd", text)
