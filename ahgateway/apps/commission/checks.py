"""What a step of commissioning says: checks with an outcome, kept in a file from which tomorrow goes on."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any

from ahgateway.core.verdict import Exit
from ahgateway.errors import ProfileError

FORMAT = 1


class Step(Enum):
    """The steps in their order."""

    LINK = 1
    MAP = 2
    LOOP = 3
    SHADOW = 4
    WIRING = 5

    @property
    def title(self) -> str:
        """What the step does, for people."""
        return _TITLES[self.value - 1]


_TITLES = ("find the link", "settle the map", "read the loop", "shadow it", "prove the wiring")


class Outcome(Enum):
    """How a check ended; the worst decides."""

    PASS = "pass"
    SKIPPED = "skipped"
    INCONCLUSIVE = "inconclusive"
    FAIL = "fail"


@dataclass(frozen=True, slots=True)
class Check:
    """One look at one thing.

    Attributes:
        name: Kind of finding, a key of the catalogue.
        outcome: How it ended.
        text: What was seen, or why it was skipped; one sentence.
        evidence: Numbers behind it, as JSON holds them.
    """

    name: str
    outcome: Outcome
    text: str
    evidence: Mapping[str, Any] = field(default_factory=dict)


def passed(name: str, text: str, **evidence: Any) -> Check:
    """Return a check that found nothing wrong."""
    return Check(name, Outcome.PASS, text, evidence)


def failed(name: str, text: str, **evidence: Any) -> Check:
    """Return a check that found the offence it is named after."""
    return Check(name, Outcome.FAIL, text, evidence)


def judged(name: str, is_good: bool, text: str, **evidence: Any) -> Check:
    """Return a check that passes or fails."""
    return Check(name, Outcome.PASS if is_good else Outcome.FAIL, text, evidence)


def skipped(name: str, reason: str) -> Check:
    """Return a check that was not made, with the reason."""
    return Check(name, Outcome.SKIPPED, reason)


def unclear(name: str, text: str, **evidence: Any) -> Check:
    """Return a check that could not be decided."""
    return Check(name, Outcome.INCONCLUSIVE, text, evidence)


@dataclass(slots=True)
class Progress:
    """What has been done for one loop so far.

    Attributes:
        loop: The loop's tag.
        profile: Hash of the profile's text; another profile starts anew.
        steps: Step to its checks, for the steps that were done.
        times: Step to the UTC in ns at which it ended.
        facts: What later steps and the sheet need: as-found, traces, journal.
    """

    loop: str
    profile: str
    steps: dict[Step, tuple[Check, ...]] = field(default_factory=dict)
    times: dict[Step, int] = field(default_factory=dict)
    facts: dict[str, Any] = field(default_factory=dict)

    @property
    def checks(self) -> list[Check]:
        """Every check in order."""
        return [check for step in Step for check in self.steps.get(step, ())]

    def take(self, step: Step, checks: Iterable[Check], utc_ns: int) -> None:
        """Note what a step found."""
        self.steps[step] = tuple(checks)
        self.times[step] = utc_ns

    def is_done(self, step: Step) -> bool:
        """Tell whether a step need not be done again: something passed, nothing failed or stayed open."""
        outcomes = {check.outcome for check in self.steps.get(step, ())}
        return Outcome.PASS in outcomes and outcomes <= {Outcome.PASS, Outcome.SKIPPED}


def exit_for(checks: Iterable[Check]) -> Exit:
    """Return the exit code: 1 when anything failed, 3 when anything stayed open or nothing was checked, else 0."""
    outcomes = [check.outcome for check in checks]
    if Outcome.FAIL in outcomes:
        return Exit.DIFFERENT
    if Outcome.INCONCLUSIVE in outcomes or Outcome.PASS not in outcomes:
        return Exit.INCONCLUSIVE
    return Exit.PASS


def as_json(progress: Progress) -> dict[str, Any]:
    """Return the progress as JSON holds it."""
    return {
        "format": FORMAT,
        "loop": progress.loop,
        "profile": progress.profile,
        "steps": {
            str(step.value): {
                "title": step.title,
                "utc_ns": progress.times[step],
                "checks": [check_json(check) for check in checks],
            }
            for step, checks in progress.steps.items()
        },
        "facts": progress.facts,
    }


def check_json(check: Check) -> dict[str, Any]:
    """Return one check with its code."""
    from ahgateway.apps.commission.catalogue import CATALOGUE

    kind = CATALOGUE[check.name]
    return {
        "code": kind.code, "name": check.name, "outcome": check.outcome.value, "text": check.text,
        "evidence": dict(check.evidence),
    }  # fmt: skip


def save(progress: Progress, path: Path) -> None:
    """Write the progress so that a kill leaves the old file or the new one, never half of it.

    Raises:
        ProfileError: It cannot be written.
    """
    beside = path.with_name(path.name + ".new")
    try:
        beside.write_text(json.dumps(as_json(progress), ensure_ascii=False, indent=1) + "\n", encoding="utf-8")
        beside.replace(path)
    except OSError as error:
        raise ProfileError(f"cannot be written: {error.strerror}", file=str(path)) from error


def resume(path: Path, loop: str, profile: str) -> Progress:
    """Return what the file holds of this loop and profile, or nothing done yet.

    Raises:
        ProfileError: The file is no progress of commissioning.
    """
    fresh = Progress(loop, profile)
    if not path.exists():
        return fresh
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        if (data["format"], data["loop"], data["profile"]) != (FORMAT, loop, profile):
            return fresh
        for number, step in data["steps"].items():
            checks = [
                Check(each["name"], Outcome(each["outcome"]), each["text"], each["evidence"]) for each in step["checks"]
            ]
            fresh.take(Step(int(number)), checks, int(step["utc_ns"]))
        fresh.facts = dict(data["facts"])
    except OSError as error:
        raise ProfileError(f"cannot be read: {error.strerror}", file=str(path)) from error
    except (ValueError, KeyError, TypeError) as error:
        raise ProfileError(
            f"is no progress of `commission`: {error}", file=str(path), hint="move it away, or use --fresh"
        ) from error
    return fresh
