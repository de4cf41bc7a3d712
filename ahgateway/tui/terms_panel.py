"""P, I, D, BIAS and MV: what the PLC shows beside what the reference computed, with the bits that tell them apart."""

from __future__ import annotations

from textwrap import wrap
from typing import Any

from ahgateway.apps.board import Board
from ahgateway.apps.lines import shown
from ahgateway.apps.monitor import Watch
from ahgateway.apps.report import hexadecimal
from ahgateway.core import flags
from ahgateway.core.real import REAL, same_bits, ulp_distance
from ahgateway.lockstep.picture import Picture
from ahgateway.tui.lines_panel import Line, columns, plain

ROWS = ("e", "p", "i", "d", "bias", "raw", "mv")
HIDDEN = "not in memory"
RIGHT = frozenset({1, 2})


def terms_lines(board: Board, watch: Watch, width: int) -> list[Line]:
    """Return the last execution of a loop as lines; a stale side stands in parentheses."""
    follower = watch.follower
    picture, last = follower.picture, follower.last
    is_stale = board.freshness(watch).is_stale
    terms = last.terms if last else None
    rows = [tuple((head, "bold underline") for head in ("term", "PLC", "reference", "compared"))]
    for name in ROWS:
        if terms is not None and not hasattr(terms, name):
            continue
        plc = known_by_plc(picture, name)
        ref = getattr(terms, name) if terms is not None else None
        is_open = last is not None and name in last.open_terms
        left = shown(plc) if plc is not None else ("-" if picture is None else HIDDEN)
        right = "-" if ref is None else f"{'~' if is_open else ''}{shown(ref)}"
        if is_stale:
            left, right = (f"({side})" if side[-1].isdigit() else side for side in (left, right))
        rows.append(((name.upper(), "bold"), (left, ""), (right, ""), compared(plc, ref)))
    said = ", ".join(flags.names(terms.flags)) if terms is not None else ""
    reason = last.reason if last is not None else "no execution seen yet"
    below = "; ".join(part for part in (said, reason) if part)
    # Two lines are always kept, so that nothing below jumps.
    rest = [*wrap(below, max(20, width)), "", ""][:2]
    return [*columns(rows, RIGHT), *(plain(line) for line in rest)]


def known_by_plc(picture: Picture | None, name: str) -> REAL | None:
    """Return a term as it stands in the PLC's memory, None for what the instruction keeps to itself."""
    if picture is None:
        return None
    seen: Any = {"i": picture.seen.get("I_MV"), "mv": picture.seen.get("MV")}.get(name)
    if seen is None and name == "bias":
        seen = getattr(picture.inputs, "bias", None)
    return seen  # type: ignore[no-any-return]


def compared(plc: REAL | None, ref: REAL | None) -> tuple[str, str]:
    """Say how two REALs differ, with a style: `same bits`, or the distance and both bit patterns."""
    if plc is None or ref is None:
        return "", ""
    if same_bits(plc, ref):
        return "= same bits", "green"
    distance = ulp_distance(plc, ref)
    apart = f"{distance} ULP" if distance is not None else "NaN"
    return f"≠ {apart} {hexadecimal(plc)} {hexadecimal(ref)}", "bold red"
