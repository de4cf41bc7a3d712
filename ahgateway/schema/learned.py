"""Put a learned dialect into a profile's text; comments and order of the file stay.

What an earlier run decided stays where the newer one does not speak against it: a run decides only what it has seen.
Another firmware is another PLC: where a person typed another one, nothing of the earlier run stays.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import tomlkit

from ahgateway.errors import ProfileError
from ahgateway.schema.profile import parse


class Merged(NamedTuple):
    """A profile with a learned dialect in it.

    Attributes:
        text: The whole profile.
        notes: What became of earlier decisions, a sentence each, for people.
    """

    text: str
    notes: tuple[str, ...]


def with_dialect(
    text: str,
    file: str,
    loop: str,
    decided: Mapping[str, str],
    left: Mapping[str, tuple[str, ...]],
    evidence: Mapping[str, str | int],
) -> Merged:
    """Return the profile's text with `[loops.LOOP.dialect]` and `[loops.LOOP.evidence]` brought up to date, checked.

    Args:
        text: The profile as it stands.
        file: Its name in messages.
        loop: The loop's tag.
        decided: Axis to the value that this run decided.
        left: Axis to every value that this run did not exclude; what it cannot tell at all need not be in it.
        evidence: `by`, `date`, `executions`, `firmware` of this run; an empty firmware was not typed.

    Raises:
        ProfileError: There is no such loop, or the result would not pass the checks of a profile.
    """
    document = tomlkit.parse(text)
    loops = document.get("loops", {})
    if loop not in loops:
        raise ProfileError(f"no loop `{loop}`, it has {', '.join(loops)}", file=file, key="loops")
    possible = {axis: (value,) for axis, value in decided.items()} | dict(left)
    known = document.unwrap()["loops"][loop]
    before, source = known.get("dialect", {}), known.get("evidence", {})
    dates = {axis: source.get("earlier", {}).get(axis, source.get("date", "")) for axis in before}
    fresh: dict[str, Any] = dict(evidence)
    if evidence["firmware"] and source.get("firmware") not in (None, "", evidence["firmware"]):
        notes = [_anew(loop, before, source, str(evidence["firmware"]))]
        before = {}
    else:
        fresh["firmware"] = evidence["firmware"] or source.get("firmware", "")
        gone = [axis for axis, value in before.items() if value not in possible.get(axis, (value,))]
        notes = [_against(loop, axis, before[axis], dates[axis], possible[axis]) for axis in gone]
        if notes:
            notes.append(f"{loop}: if another firmware runs now, say so with --firmware and nothing earlier is kept")
    kept = {axis: value for axis, value in before.items() if value in possible.get(axis, (value,))}
    # What is a number is typed by a person; no run decides it.
    earlier = {
        axis: dates[axis] for axis, value in kept.items() if isinstance(value, str) and decided.get(axis) != value
    }
    if earlier:
        fresh["earlier"] = earlier
        notes.insert(0, f"{loop}: kept from before, where this run says nothing else: {', '.join(earlier)}")
    for name, values in (("dialect", {**decided, **kept}), ("evidence", fresh)):
        if name not in loops[loop]:
            loops[loop][name] = tomlkit.table()
        _fill(loops[loop][name], values)
    changed = tomlkit.dumps(document)
    parse(changed, file)
    return Merged(changed, tuple(notes))


def _against(loop: str, axis: str, value: str, date: str, now: tuple[str, ...]) -> str:
    """Say that this run excludes what was decided before."""
    return f"{loop}: {axis} was {value}{_on(date)}, this run leaves only {' or '.join(now)}: the newer stands"


def _anew(loop: str, before: Mapping[str, str], source: Mapping[str, Any], firmware: str) -> str:
    """Say that nothing of another firmware's dialect is kept."""
    dropped = ", ".join(f"{axis} = {value}" for axis, value in before.items()) or "nothing"
    was = f"{source['firmware']}{_on(source.get('date', ''))}"
    return f"{loop}: firmware was {was} and is {firmware}: the dialect begins anew, dropped: {dropped}"


def _on(date: str) -> str:
    return f" ({date})" if date else ""


def _fill(table: Any, values: Mapping[str, Any]) -> None:
    """Bring a table up to date; what does not change keeps its place and its comment."""
    for key in [key for key in table if key not in values]:
        del table[key]
    for key, value in values.items():
        if key not in table or table[key] != value:
            table[key] = value
