"""`ahgateway explain`: what a code or an axis of the dialect means, from the same tables that use them."""

from __future__ import annotations

import json
from typing import Annotated, Any

import typer

from ahgateway.cli.view import Output


def explain(
    what: Annotated[
        str | None, typer.Argument(metavar="CODE|CAUSE|AXIS", help="AHG251, gain, or an axis such as filter.")
    ] = None,
    output: Annotated[Output, typer.Option(help="text for people, json for one object.")] = Output.TEXT,
) -> None:
    """Say what a code, a cause of a divergence or an axis of the dialect means; without a name list them all.

    Sends nothing to any PLC.

    Example: ahgateway explain AHG251
    """
    facts = _all() if what is None else _one(what)
    typer.echo(json.dumps(facts, ensure_ascii=False) if output is Output.JSON else _text(facts))


def _all() -> dict[str, Any]:
    from ahgateway.core.dialect_axes import TABLE
    from ahgateway.lockstep.cause_pages import PAGES

    causes = {f"{page.code} {page.name}": page.title for page in PAGES}
    return {"causes": causes, "axes": {axis.name: axis.question for axis in TABLE}}


def _one(what: str) -> dict[str, Any]:
    from dataclasses import asdict

    from ahgateway.apps.commission.catalogue import CATALOGUE
    from ahgateway.core.dialect import AXES
    from ahgateway.core.dialect_axes import BY_NAME as AXIS_PAGES
    from ahgateway.core.dialect_axes import value_name
    from ahgateway.errors import ProfileError
    from ahgateway.lockstep.cause_classes import classes_of
    from ahgateway.lockstep.cause_pages import BY_CODE, BY_NAME
    from ahgateway.schema.findings import near

    page = BY_CODE.get(what.upper()) or BY_NAME.get(what.lower())
    if page is not None:
        return {**asdict(page), "classes": classes_of(page.name)}
    finding = next((kind for kind in CATALOGUE.values() if what.upper() == kind.code), CATALOGUE.get(what.lower()))
    if finding is not None:
        named = {"code": finding.code, "name": finding.name, "what": finding.what}
        return {**named, "why": finding.why, "do": finding.do}
    axis = AXIS_PAGES.get(what.lower())
    if axis is None:
        known = [*BY_CODE, *BY_NAME, *CATALOGUE, *AXIS_PAGES]
        raise ProfileError(f"`{what}` is no code, cause or axis", hint=near(what, known) or "`ahgateway explain` alone")
    values = {value_name(axis.name, number): axis.values[int(number)] for number in AXES[axis.name]}
    return {
        "axis": axis.name,
        "question": axis.question,
        "instructions": "DPID and DPIDE" if axis.instructions == "both" else axis.instructions,
        "values": values,
        "default": next(iter(values)),
        "excitation": axis.excitation,
        "after": ", ".join(axis.after) or "nothing",
        "unseen": "; ".join(axis.unseen()) or "nowhere",
    }


def _text(facts: dict[str, Any]) -> str:
    lines = []
    for name, value in facts.items():
        if isinstance(value, dict):
            lines.append(f"{name}:")
            lines += [f"  {key}: {text}" for key, text in value.items()]
        else:
            lines.append(f"{name}: {value}")
    return "\n".join(lines)
