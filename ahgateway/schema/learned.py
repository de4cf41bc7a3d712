"""Put a learned dialect into a profile's text; comments and order of the file stay."""

from __future__ import annotations

from collections.abc import Mapping

import tomlkit

from ahgateway.errors import ProfileError
from ahgateway.schema.profile import parse


def with_dialect(text: str, file: str, loop: str, dialect: Mapping[str, str], evidence: Mapping[str, str | int]) -> str:
    """Return the profile's text with `[loops.LOOP.dialect]` and `[loops.LOOP.evidence]` replaced, checked.

    Args:
        text: The profile as it stands.
        file: Its name in messages.
        loop: The loop's tag.
        dialect: Axis to value.
        evidence: `by`, `date`, `executions`, `firmware`.

    Raises:
        ProfileError: There is no such loop, or the result would not pass the checks of a profile.
    """
    document = tomlkit.parse(text)
    loops = document.get("loops", {})
    if loop not in loops:
        raise ProfileError(f"no loop `{loop}`, it has {', '.join(loops)}", file=file, key="loops")
    for name, values in (("dialect", dialect), ("evidence", evidence)):
        table = tomlkit.table()
        for key, value in values.items():
            table[key] = value
        loops[loop][name] = table
    changed = tomlkit.dumps(document)
    parse(changed, file)
    return changed
