"""Every finding that commissioning can make: code, name, what it means, what to do. They stand in `findings.toml`.

The page of findings is made of it. Codes are for ever: 1xx link, 2xx map, 3xx loop, 4xx shadow, 5xx wiring; one whose
meaning is gone is never used again.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from importlib.resources import files

from ahgateway.apps.commission.checks import Step


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of finding.

    Attributes:
        code: `AHG201`.
        name: Names the offence; a check that passes has the same name.
        step: Step in which it is made.
        what: What was looked at, and what is wrong when it fails.
        why: Why it matters.
        do: What to do.
    """

    code: str
    name: str
    step: Step
    what: str
    why: str
    do: str


def _read() -> dict[str, Kind]:
    tables = tomllib.loads(files(__package__).joinpath("findings.toml").read_text(encoding="utf-8"))
    # The first digit of a code is the number of the step in which it is made.
    return {name: Kind(name=name, step=Step(int(table["code"][3])), **table) for name, table in tables.items()}


CATALOGUE: dict[str, Kind] = _read()
"""Every kind by its name."""


def page() -> str:
    """Return the page of findings, in Markdown."""
    lines = [
        "# Findings",
        "",
        "What `ahgateway commission` looks at. Each check passes, fails, stays inconclusive or is skipped with a",
        "reason; its code and name are the same in all cases.",
    ]
    for step in Step:
        kinds = [kind for kind in CATALOGUE.values() if kind.step is step]
        if kinds:
            lines += ["", f"## Step {step.value}: {step.title}"]
        for kind in kinds:
            lines += ["", f"### {kind.code} {kind.name}", "", kind.what, "", f"*Why it matters.* {kind.why}", ""]
            lines += [f"*What to do.* {kind.do}"]
    return "\n".join(lines) + "\n"
