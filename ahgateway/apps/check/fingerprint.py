"""A run's fingerprint: what every execution of every scenario left, so that two runs, two firmwares, can be compared.

The file holds one CRC32 per change of the words that the instruction writes, in order. Equal files mean equal words;
where they differ, the first change that does is named. It holds no time of day, so that equal runs give equal bytes.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ahgateway.apps.check.result import Result
from ahgateway.errors import ProfileError
from ahgateway.schema import files

KIND = "ahgateway-check-fingerprint"
VERSION = 1


@dataclass(frozen=True, slots=True)
class Difference:
    """One scenario in which two fingerprints differ.

    Attributes:
        scenario: Its name.
        text: What differs, one sentence.
        change: The first change of words that differs, from 1; 0 where one side has no such scenario.
    """

    scenario: str
    text: str
    change: int = 0


def fingerprint(results: Iterable[Result], seed: int, *, is_repeatable: bool = True) -> dict[str, Any]:
    """Return a run as one JSON object; only scenarios of which words were seen have a part in it.

    Of a run in real time, which is not repeatable, it holds what became of each expectation instead of words.
    """
    return {
        "kind": KIND,
        "version": VERSION,
        "seed": seed,
        "of": "words" if is_repeatable else "expectations",
        "scenarios": {each.name: [f"{digest:08x}" for digest in each.digests] for each in results if each.digests},
    }


def text_of(found: dict[str, Any]) -> str:
    """Return the file's text: one scenario a line."""
    scenarios = ",\n".join(f"  {json.dumps(name)}: {json.dumps(each)}" for name, each in found["scenarios"].items())
    head = ", ".join(f"{json.dumps(key)}: {json.dumps(found[key])}" for key in ("kind", "version", "seed", "of"))
    return f'{{{head}, "scenarios": {{\n{scenarios}\n}}}}\n'


def read(path: Path) -> dict[str, Any]:
    """Return the fingerprint in a file.

    Raises:
        ProfileError: It cannot be read, or is none of ours.
    """
    text = files.read(path, str(path))
    try:
        found = json.loads(text)
    except ValueError as error:
        raise ProfileError(f"is no JSON: {error}", file=str(path)) from error
    if not isinstance(found, dict) or found.get("kind") != KIND or not isinstance(found.get("scenarios"), dict):
        raise ProfileError("is no fingerprint of `ahgateway check`", file=str(path), hint="--fingerprint writes one")
    if found.get("version") != VERSION:
        raise ProfileError(f"has version {found.get('version')}, allowed is {VERSION}", file=str(path))
    return found


def compared(before: dict[str, Any], after: dict[str, Any], *, is_part: bool = False) -> list[Difference]:
    """Return the scenarios in which two fingerprints differ; those that only one of them has are among them.

    Args:
        before: The old fingerprint.
        after: The new one.
        is_part: The new one is of a part of the scenarios only: what it does not have is no difference.

    Raises:
        ProfileError: They were taken with different seeds, or one on a fake and one on a real PLC.
    """
    if before["seed"] != after["seed"]:
        raise ProfileError(
            f"the fingerprints were taken with seeds {before['seed']} and {after['seed']}", hint="give the same --seed"
        )
    kinds = [str(each.get("of", "words")) for each in (before, after)]
    if kinds[0] != kinds[1]:
        raise ProfileError(
            f"one fingerprint is of {kinds[0]}, the other of {kinds[1]}",
            hint="words are those of a fake in virtual time, expectations those of a real PLC",
        )
    found = []
    for name in sorted({*before["scenarios"], *after["scenarios"]}):
        one, other = before["scenarios"].get(name), after["scenarios"].get(name)
        if other is None and is_part:
            continue
        if one is None or other is None:
            found.append(Difference(name, f"only the {'new' if one is None else 'old'} fingerprint has it"))
        elif one != other:
            pairs = zip(one, other, strict=False)
            first = next((at for at, (a, b) in enumerate(pairs, 1) if a != b), min(len(one), len(other)) + 1)
            found.append(Difference(name, f"differs from change {first} of {len(one)} on", first))
    return found
