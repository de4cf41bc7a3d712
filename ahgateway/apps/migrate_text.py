"""A migration as people take it away: the settings as a piece of a profile, and everything as a page of text."""

from __future__ import annotations

import numpy as np

from ahgateway.apps.migrate import Migration
from ahgateway.core.controllers import CONTROLLERS, Controller
from ahgateway.core.operands import Kind

FIRST_WORD, FIRST_FLAG = 1000, 1000
"""Where operands are placed when the manual has no example registers for a block."""
LAID_OUT = ("DPID", "DPIDE")


def fragment(found: Migration, name: str) -> str:
    """Return the settings as a piece of a profile; a block that profiles do not know yet becomes a plain table."""
    import tomlkit

    made, loop = found.conversion, tomlkit.key(name).as_string()
    lines = [f"# {made.source} rebuilt as {made.target}: {found.text}"]
    lines += [f"# {loss.code}: {loss.text}" for loss in made.losses]
    settings = [f"{key} = {toml(value)}" for key, value in made.settings.items()]
    if made.target not in CONTROLLERS:
        return "\n".join([*lines, "", f"[{made.target}]", *settings]) + "\n"
    (low, high), (bottom, top) = made.scaling.pv_to, made.scaling.mv_to
    if made.target == "PID_Temp":
        # Its own defaults read Input_PER and take 120 for the highest process value.
        least, most = (-high, -low) if made.wanted.sign != made.reached.sign else (low, high)
        settings += ["InputPerOn = false", f"InputUpperLimit = {most:.9g}", f"InputLowerLimit = {least:.9g}"]
    lines += ["# goes into a profile beside its [station]; `ahgateway profile check` then looks at both"]
    lines += ["", f"[loops.{loop}]", f'instruction = "{made.target}"']
    lines += ['layout = "manual"'] if made.target in LAID_OUT else []
    lines.append(f"ranges = {{ pv = [{low:.9g}, {high:.9g}], mv = [{bottom:.9g}, {top:.9g}] }}")
    if made.target not in LAID_OUT:
        lines += ["", f"[loops.{loop}.operands]   # one after the other; put here where your program has them"]
        lines += _places(CONTROLLERS[made.target])
    return "\n".join([*lines, "", f"[loops.{loop}.fake.initial]", *settings]) + "\n"


def _places(controller: Controller) -> list[str]:
    word, flag, lines = FIRST_WORD, FIRST_FLAG, []
    for row in controller.operands:
        if row.kind is Kind.BOOL:
            lines.append(f'{row.name} = "M{flag}"')
            flag += 1
        else:
            lines.append(f'{row.name} = "D{word}"')
            word += row.words
    return lines


def toml(value: float | int | bool) -> str:
    """Return a setting as TOML holds it; a REAL by the fewest digits that give its bits."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        text = np.format_float_positional(np.float32(value), unique=True, trim="0")
        return text if abs(value) < 1e9 else repr(value)
    return str(value)


def as_text(found: Migration) -> str:
    """Return the migration as a page of text."""
    made = found.conversion
    width = max(len(name) for name in made.settings)
    lines = [f"{made.source} to {made.target}", ""]
    lines += [f"  {name:<{width}}  {toml(value)}" for name, value in made.settings.items()]
    if made.losses:
        lines.append("")
    for loss in made.losses:
        size = f" ({loss.size:.3g} {loss.unit})" if loss.size and loss.unit else ""
        lines.append(f"{loss.code}{size}: {loss.text}")
    process = found.process
    lines += [
        "",
        f"process: {process.kind.value}, K {process.gain:.4g}, dead time {process.dead_time_s:.4g} s, "
        f"τ {process.tau_s:.4g} s ({found.process_text})",
        found.text,
    ]
    return "\n".join(lines)
