"""Siemens PID_Temp: modes, monitoring, errors and warnings round the law; called every CycleTime, the law every Cycle.

This file alone decides which mode is active and what an error does to it. The law stands in `pid_temp_law.py`, the
outputs in `pid_temp_output.py`.

Theory of operation: edges choose the mode; input, setpoint and what the mode uses are checked; an error in automatic
leads to State 5 until it is gone, or to inactive without ActivateRecoverMode; then PidOutputSum comes from the law
(when it is due), ManualValue, SubstituteOutput or nowhere, and the outputs are scaled from it in every call.

Source:
    MANUAL PID control function manual 03/2017, PID_Temp, pp. 425, 426, 437–444: modes, errors, warnings (spec E.7).
    ASSUMED ErrorAck and Reset clear first, what is still pending comes back at once; warnings as `WarningLatch` says.
    ASSUMED Input_PER of 7FFFh and 8000h is invalid (overflow and underflow of the analog input).
    ASSUMED tuning is not modelled: State 1 and 2 hold everything. D is 0 outside automatic (spec E.8).
"""

from __future__ import annotations

from typing import NamedTuple

from ahgateway.core import flags as flag
from ahgateway.core.controllers import pid_temp_law as law
from ahgateway.core.controllers import pid_temp_output as output
from ahgateway.core.controllers.delta import ZERO, finite, limit
from ahgateway.core.controllers.pid_temp_dialect import PidTempDialect, Resume, WarningEdge, WarningLatch
from ahgateway.core.controllers.pid_temp_law import Parts
from ahgateway.core.controllers.pid_temp_operands import OPERANDS, Core, Operands, State, Terms
from ahgateway.core.real import REAL

__all__ = ["OPERANDS", "Core", "Operands", "State", "Terms", "nominal_ts", "recall", "step"]

INACTIVE = 0
PRETUNING = 1
FINE_TUNING = 2
AUTOMATIC = 3
MANUAL = 4
SUBSTITUTE = 5

ERR_INPUT_LIMITS = 0x1
ERR_INPUT_PER = 0x2
ERR_INPUT = 0x200
ERR_OUTPUT = 0x400
ERR_SETPOINT = 0x1000
ERR_MANUAL = 0x10000
ERR_SUBSTITUTE = 0x20000
ERR_DISTURBANCE = 0x40000
STOPS_THE_LAW = ERR_INPUT_PER | ERR_INPUT | ERR_SETPOINT

WARN_SETPOINT = 0x4
WARN_BLOCKED = 0x10
WARN_INPUT = 0x40
WARN_MODE = 0x80
WARN_MANUAL = 0x100
WARN_SUBSTITUTE = 0x1000
WARN_SELECT = 0x4000
WARN_GAIN = 0x40000
GO_BY_THEMSELVES = WARN_SETPOINT | WARN_INPUT | WARN_MANUAL

PER_OVERFLOW = 32767
PER_UNDERFLOW = -32768
DEFAULT_CALL_S = REAL(0.1)


class Seen(NamedTuple):
    """Input and setpoint as the block uses them, with what their checks found."""

    x: REAL
    w: REAL
    pending: int
    warning: int
    setpoint_h: bool
    setpoint_l: bool
    input_h: bool
    input_l: bool


class Acted(NamedTuple):
    """What the active mode did: the core, the parts of the law, and what came up on the way."""

    core: Core
    parts: Parts
    state: int
    calls: int
    executed: bool
    pending: int
    warning: int
    flags: int


def nominal_ts(operands: Operands) -> REAL:
    """Return the call period in s, CycleTime_Value; one that is not positive acts as 0.1 s."""
    period = operands.cycletime_value
    return period if finite(period) and period > ZERO else DEFAULT_CALL_S


def recall(operands: Operands, seen: State) -> tuple[tuple[State, State], ...]:
    """Return nothing: the call counter, the D filter and the pulses cannot be told from outputs."""
    return ()


def requested(operands: Operands, state: State) -> tuple[int, int]:
    """Return the mode that the edges ask for, and a warning where they ask in vain.

    Reset beats ManualEnable beats ModeActivate; while one of the first two is TRUE, ModeActivate changes nothing.
    """
    mode_rises = operands.modeactivate and not state.modeactivate1
    if operands.reset:
        return INACTIVE, (WARN_BLOCKED if mode_rises else 0)
    reset_fell = state.reset1
    if operands.manualenable:
        if not state.manualenable1 or reset_fell:
            return MANUAL, 0
        return state.state, (WARN_BLOCKED if mode_rises else 0)
    if not (mode_rises or reset_fell or state.manualenable1):
        return state.state, 0
    if not INACTIVE <= operands.mode <= MANUAL:
        return state.state, WARN_MODE
    if operands.mode == AUTOMATIC and state.state == SUBSTITUTE:
        return SUBSTITUTE, 0
    return operands.mode, 0


def scaled_input(operands: Operands) -> tuple[REAL, int]:
    """Return the process value and its error: Input as it is, or Input_PER on the line through two points."""
    if not operands.inputperon:
        return operands.input, (0 if finite(operands.input) else ERR_INPUT)
    if operands.input_per in (PER_OVERFLOW, PER_UNDERFLOW):
        return ZERO, ERR_INPUT_PER
    span = operands.inputscaling_upperpointin - operands.inputscaling_lowerpointin
    if not finite(span) or span == ZERO:
        return ZERO, ERR_INPUT_PER
    rise = operands.inputscaling_upperpointout - operands.inputscaling_lowerpointout
    away = REAL(operands.input_per) - operands.inputscaling_lowerpointin
    x = operands.inputscaling_lowerpointout + ((away * rise) / span)
    return x, (0 if finite(x) else ERR_INPUT_PER)


def monitored(operands: Operands, dialect: PidTempDialect) -> Seen:
    """Check input and setpoint, as in every mode."""
    x, pending = scaled_input(operands)
    w, warning = operands.setpoint, 0
    above = below = False
    if pending == 0:
        if x > operands.inputupperlimit or x < operands.inputlowerlimit:
            pending |= ERR_INPUT_LIMITS
        high = _warning_limit(operands, operands.inputupperwarning, operands.inputupperlimit)
        low = _warning_limit(operands, operands.inputlowerwarning, operands.inputlowerlimit)
        reached = bool(x in (high, low)) and dialect.warning_edge == WarningEdge.REACHED
        above = bool(x > high or (reached and x == high))
        below = bool(x < low or (reached and x == low))
        if above or below:
            warning |= WARN_INPUT
    if not finite(w):
        return Seen(x, w, pending | ERR_SETPOINT, warning, False, False, above, below)
    w = limit(operands.setpointlowerlimit, w, operands.setpointupperlimit)
    if w != operands.setpoint:
        warning |= WARN_SETPOINT
    at_high = bool(operands.setpoint >= operands.setpointupperlimit)
    at_low = bool(operands.setpoint <= operands.setpointlowerlimit)
    return Seen(x, w, pending, warning, at_high, at_low, above, below)


def _warning_limit(operands: Operands, warning: REAL, bound: REAL) -> REAL:
    """A warning limit outside the process value limits is replaced by its limit."""
    return warning if operands.inputlowerlimit <= warning <= operands.inputupperlimit else bound


def step(operands: Operands, state: State, dialect: PidTempDialect, ts: REAL) -> tuple[State, Terms]:
    """Advance PID_Temp by one call; equal arguments give equal bits.

    Args:
        operands: Inputs and instance data as the block sees them; nothing needs to be in range.
        state: What the call before left behind; `core.i` may have been written by the user.
        dialect: Choices where the manual is silent.
        ts: Call period in s, positive; the nominal one is `nominal_ts`.

    Returns:
        The next state, and every term with all outputs.
    """
    wanted, warning = requested(operands, state)
    seen = monitored(operands, dialect)
    acted = _act(operands, state, dialect, seen, wanted, ts)
    warning |= seen.warning | acted.warning | _standing_warnings(operands, acted.state)
    acknowledged = (operands.reset and not state.reset1) or (operands.errorack and not state.errorack1)
    errorbits = (0 if acknowledged else state.errorbits) | acted.pending
    latched = ((0 if acknowledged else state.latched) | warning) & ~GO_BY_THEMSELVES
    if latched and dialect.warning_latch == WarningLatch.PRESENT:
        latched = 0
    warning |= latched

    core, parts = acted.core, acted.parts
    out = output.put_out(operands, core.y, acted.state != INACTIVE, state.heat, state.cool, dialect, ts)
    after = State(
        core, acted.state, acted.calls, errorbits, latched, operands.modeactivate, operands.reset,
        operands.manualenable, operands.errorack, out.heat_pulse, out.cool_pulse,
    )  # fmt: skip
    terms = Terms(
        seen.x, seen.w, parts.e, parts.ez, parts.p, core.i, core.d, parts.raw, core.y, out.heat, out.cool,
        out.heat_per, out.cool_per, out.heat_pwm, out.cool_pwm, seen.setpoint_h, seen.setpoint_l, seen.input_h,
        seen.input_l, acted.state, core.cooling, acted.executed, acted.pending, acted.pending != 0, errorbits, warning,
        acted.flags | out.flags,
    )  # fmt: skip
    return after, terms


def _act(operands: Operands, state: State, dialect: PidTempDialect, seen: Seen, wanted: int, ts: REAL) -> Acted:
    """Do what the wanted mode does, or what an error makes of it."""
    pending, idle = seen.pending, law.NOTHING
    disturbance = operands.disturbance
    if wanted == MANUAL and not finite(operands.manualvalue):
        pending |= ERR_MANUAL
    if wanted in (AUTOMATIC, SUBSTITUTE) and not finite(disturbance):
        pending |= ERR_DISTURBANCE
        disturbance = ZERO
    if wanted == INACTIVE or (pending and not operands.activaterecovermode):
        # IntegralResetMode 2 finds the integral again; the heating set is active at every start.
        return Acted(_rest(state.core, ZERO, False), idle, INACTIVE, 0, False, pending, 0, flag.STOPPED)
    if wanted in (PRETUNING, FINE_TUNING):
        return Acted(state.core, idle, wanted, 0, False, pending, 0, flag.AUTOTUNE)
    if wanted == MANUAL:
        y, found, warning = _manual_output(operands)
        core = _rest(state.core, y, state.core.cooling)
        return Acted(core, idle, MANUAL, 0, False, pending | found, warning, flag.MANUAL)
    if pending & STOPS_THE_LAW:
        return _substitute(operands, state.core, pending)
    return _automatic(operands, state, dialect, seen, disturbance, pending, ts)


def _rest(core: Core, y: REAL, cooling: bool) -> Core:
    """The core while the law does not run: the integral is kept, the history is not."""
    return Core(y, core.i, ZERO, core.u1, False, cooling, False)


def _automatic(
    operands: Operands, state: State, dialect: PidTempDialect, seen: Seen, disturbance: REAL, pending: int, ts: REAL
) -> Acted:
    """Execute the law when it is due or automatic mode has just begun."""
    entry = law.STAY
    if state.state == INACTIVE:
        entry = law.START
    elif state.state != AUTOMATIC and not (state.state == SUBSTITUTE and dialect.resume == Resume.INTEGRAL_KEPT):
        entry = law.TRANSFER
    if state.state == AUTOMATIC and state.calls > 0:
        return Acted(state.core, law.NOTHING, AUTOMATIC, state.calls - 1, False, pending, 0, 0)
    core, parts = law.execute(operands, state.core, dialect, seen.w, seen.x, disturbance, entry, ts)
    if parts.failed:
        pending |= ERR_OUTPUT
        if not operands.activaterecovermode:
            return Acted(_rest(state.core, ZERO, False), parts, INACTIVE, 0, True, pending, 0, flag.STOPPED)
        return _substitute(operands, state.core, pending)
    due = output.calls(law.active_set(operands, core.cooling, dialect, ts).cycle, ts, 1) - 1
    return Acted(core, parts, AUTOMATIC, due, True, pending, 0, parts.flags)


def _substitute(operands: Operands, core: Core, pending: int) -> Acted:
    """State 5: SubstituteOutput, or the last valid output."""
    y, found, warning = core.y, 0, 0
    if operands.setsubstituteoutput:
        y, found, warning = _substitute_output(operands)
    rest = _rest(core, y, core.cooling)
    return Acted(rest, law.NOTHING, SUBSTITUTE, 0, False, pending | found, warning, flag.BAD_INPUT)


def _manual_output(operands: Operands) -> tuple[REAL, int, int]:
    """ManualValue within the limits; SubstituteOutput in place of an invalid one, whatever SetSubstituteOutput says."""
    if not finite(operands.manualvalue):
        return _substitute_output(operands)
    low, high = law.limits(operands)
    y = limit(low, operands.manualvalue, high)
    return y, 0, (WARN_MANUAL if y != operands.manualvalue else 0)


def _substitute_output(operands: Operands) -> tuple[REAL, int, int]:
    """SubstituteOutput within the limits; Heat_PidLowerLimit in place of an invalid one."""
    if not finite(operands.substituteoutput):
        return operands.heat_pidlowerlimit, ERR_SUBSTITUTE, 0
    low, high = law.limits(operands)
    y = limit(low, operands.substituteoutput, high)
    return y, 0, (WARN_SUBSTITUTE if y != operands.substituteoutput else 0)


def _standing_warnings(operands: Operands, state: int) -> int:
    """Warnings that come from the configuration: bad gains in automatic, an unknown selection of outputs."""
    warning = 0
    if state == AUTOMATIC and not law.gains_valid(operands):
        warning |= WARN_GAIN
    if not 0 <= operands.heat_select <= output.PER or (
        operands.activatecooling and not 0 <= operands.cool_select <= output.PER
    ):
        warning |= WARN_SELECT
    return warning
