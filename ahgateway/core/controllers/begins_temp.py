"""What one look at PID_Temp tells of the state that it hides.

This file alone decides from where its shadow can start; see `begins` for what a start is.

Theory of operation: State, IntegralSum, PidOutputSum and ErrorBits are published, so inactive and manual mode hide
nothing of the law. In automatic an execution of the law shows itself in IntegralSum or PidOutputSum: from there on the
calls until the next one are known, and with Td only the content of the D filter is open. The phase and carry of pulses
are hidden until the block is inactive: their outputs are veiled, everything else is judged.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ahgateway.core.controllers import pid_temp
from ahgateway.core.controllers import pid_temp_law as law
from ahgateway.core.controllers import pid_temp_output as output
from ahgateway.core.controllers.begins import Pairs
from ahgateway.core.controllers.delta import ZERO, limit
from ahgateway.core.controllers.pid_temp_dialect import PidTempDialect, PwmInactive, WarningLatch, ZoneReturn
from ahgateway.core.controllers.pid_temp_operands import Core, Operands, State
from ahgateway.core.controllers.pid_temp_pwm import Pulse
from ahgateway.core.real import REAL, bits

D_BOUND = REAL(1e6)
"""Far above any content of the D filter that a real loop can hold, in % (ASSUMED)."""

CALLS_MAX = 24
"""More calls per Cycle than this are not enumerated: the start waits for an execution of the law."""

VEIL = Pulse(0, 0, 0, ZERO)
"""Stands for pulses of which phase and carry are not known; no period has 0 calls."""


def tunes(inputs: Operands, seen: Mapping[str, Any]) -> bool:
    """Tell whether State says pretuning or fine tuning."""
    return int(seen["State"]) in (pid_temp.PRETUNING, pid_temp.FINE_TUNING)


def veiled(state: State) -> frozenset[str]:
    """Return the pulse outputs that this state cannot predict."""
    names = []
    if state.heat.calls == 0:
        names.append("OutputHeat_PWM")
    if state.cool.calls == 0:
        names.append("OutputCool_PWM")
    return frozenset(names)


def veil(before: State, after: State) -> State:
    """Keep pulses unknown that were unknown before the step, unless the block has cleared them."""
    none = Pulse()
    heat = VEIL if before.heat.calls == 0 and after.heat != none else after.heat
    cool = VEIL if before.cool.calls == 0 and after.cool != none else after.cool
    return after._replace(heat=heat, cool=cool)


def start(
    inputs: Operands, shown: Mapping[str, Any], before: Mapping[str, Any] | None, dialect: PidTempDialect
) -> Pairs:
    """Return what PID_Temp can remember behind a call that read `inputs` and left `shown`; `before` is one call ago."""
    mode = int(shown["state"])
    if mode in (pid_temp.PRETUNING, pid_temp.FINE_TUNING) or not law.gains_valid(inputs):
        return ()
    sets = (False, True) if law.two_sets(inputs) and mode != pid_temp.INACTIVE else (False,)
    pairs: list[tuple[State, State]] = []
    for cooling in sets:
        if mode == pid_temp.AUTOMATIC:
            found = _automatic(inputs, shown, before, dialect, cooling)
            if not found:
                return ()
        else:
            core = Core(shown["pidoutputsum"], shown["i"], ZERO, ZERO, False, cooling, False)
            found = [(core, core, 0)]
        for low, high, calls in found:
            pairs.append(
                (_state(inputs, shown, dialect, low, mode, calls), _state(inputs, shown, dialect, high, mode, calls))
            )
    return tuple(pairs)


def _state(
    inputs: Operands, shown: Mapping[str, Any], dialect: PidTempDialect, core: Core, mode: int, calls: int
) -> State:
    cleared = mode == pid_temp.INACTIVE and dialect.pwm_inactive == PwmInactive.CLEARED
    heats = inputs.heat_select == output.PWM and not cleared
    cools = inputs.activatecooling and inputs.cool_select == output.PWM and not cleared
    latched = 0
    if dialect.warning_latch == WarningLatch.UNTIL_ACKNOWLEDGED:
        latched = int(shown["warning"]) & ~pid_temp.GO_BY_THEMSELVES
    return State(
        core, mode, calls, int(shown["errorbits"]), latched, inputs.modeactivate, inputs.reset, inputs.manualenable,
        inputs.errorack, VEIL if heats else Pulse(), VEIL if cools else Pulse(),
    )  # fmt: skip


def _automatic(
    inputs: Operands, shown: Mapping[str, Any], before: Mapping[str, Any] | None, dialect: PidTempDialect, cooling: bool
) -> list[tuple[Core, Core, int]]:
    """The law's own state in automatic, lowest and highest, with the calls until it is due."""
    ts = pid_temp.nominal_ts(inputs)
    ps = law.active_set(inputs, cooling, dialect, ts)
    count = output.calls(ps.cycle, ts, 1)
    y, i, x = shown["pidoutputsum"], shown["i"], shown["scaledinput"]
    executed = count == 1 or (
        before is not None and (bits(before["pidoutputsum"]) != bits(y) or bits(before["i"]) != bits(i))
    )
    w = limit(inputs.setpointlowerlimit, inputs.setpoint, inputs.setpointupperlimit)
    outside = law.beyond_control_zone(inputs, w, x) != 0
    if not executed:
        if count > CALLS_MAX or ps.td > ZERO or dialect.zone_return == ZoneReturn.PRESET:
            return []
        core = Core(y, i, ZERO, ZERO, False, cooling, outside)
        return [(core, core, calls) for calls in range(count)]
    u = law.dead_zoned(inputs, dialect, w - x) - ((law.ONE - ps.c) * w)
    bound = D_BOUND if ps.td > ZERO else ZERO
    low, high = (Core(y, i, d, u, True, cooling, outside) for d in (-bound, bound))
    return [(low, high, count - 1)]


def used(inputs: Operands, shown: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return the inputs with every process value that gives the ScaledInput which the block published."""
    x = shown["scaledinput"]
    if not inputs.inputperon:
        return (inputs._replace(input=x),)
    span = float(inputs.inputscaling_upperpointin) - float(inputs.inputscaling_lowerpointin)
    rise = float(inputs.inputscaling_upperpointout) - float(inputs.inputscaling_lowerpointout)
    if not np.isfinite(x) or not np.isfinite(span) or not rise:
        return ()
    near = (float(x) - float(inputs.inputscaling_lowerpointout)) * span / rise + float(inputs.inputscaling_lowerpointin)
    if not abs(near) < -pid_temp.PER_UNDERFLOW:
        return ()
    tried = (inputs._replace(input_per=round(near) + away) for away in (0, -1, 1))
    return tuple(each for each in tried if bits(pid_temp.scaled_input(each)[0]) == bits(x))
