"""What one look at MELSEC PID or PID_REG_CE tells of the state that they hide, and when they compute at all.

This file alone decides from where their shadow can start. A start is a set of bounds, lowest and highest state, that
is sure to hold the true one; () says that nothing is known yet.

Theory of operation: MELSEC's work area tells nothing, but a contact that was off makes the next execution start afresh
from (d), and without filter and derivative PV and (d) are the whole state, but for what rounding hides of the sum.
PID_REG_CE counts calls that no output shows; between two series, and in manual, there is nothing to count.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ahgateway.core.controllers import melsec_pid, pid_reg_ce
from ahgateway.core.controllers.delta import ZERO, finite, limit
from ahgateway.core.controllers.melsec_dialect import MelsecDialect, NumberFormat
from ahgateway.core.controllers.pid_reg_ce_dialect import ErrorSign, PulseDialect, SeriesEnd, Stopped
from ahgateway.core.real import REAL

Pairs = tuple[tuple[Any, Any], ...]

HALF = REAL(0.5)
I_BOUND = REAL(1e9)
"""Far above what an integral that no series clears can hold, in units of the error (ASSUMED)."""

NEIGHBOURS = 3
"""How many REALs on either side of SET_POINT - ERROR can give the same ERROR; rounding needs no more near it."""


def always(inputs: Any) -> bool:
    """The block computes in every call."""
    return True


def never(inputs: Any, seen: Mapping[str, Any]) -> bool:
    """The block has no tuner."""
    return False


def melsec_computes(inputs: melsec_pid.Operands) -> bool:
    """Tell whether an execution computes: contact on, parameters legal, no auto-tuning."""
    return bool(inputs.en and not melsec_pid.parameter_error(inputs) and not inputs.act & melsec_pid.ACT_TUNE)


def melsec_tunes(inputs: melsec_pid.Operands, seen: Mapping[str, Any]) -> bool:
    """Tell whether ACT.4 asks for auto-tuning."""
    return bool(inputs.en and inputs.act & melsec_pid.ACT_TUNE)


def melsec(
    inputs: melsec_pid.Operands, shown: Mapping[str, Any], before: Mapping[str, Any] | None, dialect: MelsecDialect
) -> Pairs:
    """Return what MELSEC PID can remember behind an execution that read `inputs` and left `shown`."""
    if not inputs.en:
        afresh = melsec_pid.State()
        return ((afresh, afresh),)
    if inputs.alpha != 0 or inputs.td > 0 or not melsec_computes(inputs):
        return ()
    pv, out = REAL(inputs.pv), REAL(shown["out"])
    ev1 = limit(melsec_pid.INT_MIN, melsec_pid.error(inputs, pv), melsec_pid.INT_MAX)
    reverse = bool(inputs.act & melsec_pid.ACT_REVERSE)
    lost = ZERO if dialect.number_format == NumberFormat.INTEGER_SUM else HALF
    low, high = (melsec_pid.State(mv, ev1, pv, pv, ZERO, pv, out, reverse, True) for mv in (out - lost, out + lost))
    return ((low, high),)


def pid_reg_ce_start(
    inputs: pid_reg_ce.Operands, shown: Mapping[str, Any], before: Mapping[str, Any] | None, dialect: PulseDialect
) -> Pairs:
    """Return what PID_REG_CE can remember where OSTANOV says that no series is active; the last motion may be any."""
    error = shown["error"]
    if not shown["ostanov"] or not finite(error) or dialect.reverse_pause > ZERO:
        return ()
    resting = not inputs.reg_avt or pid_reg_ce.inside_zone(inputs, inputs.d_zone)
    if not resting and dialect.stopped == Stopped.NO_OUTPUT:
        return ()
    e = -error if inputs.action and dialect.error_sign == ErrorSign.FIXED else error
    moving = int(shown["open_out"]) - int(shown["close_out"])
    idle, y = pid_reg_ce.IDLE, shown["y"]
    found = [
        pid_reg_ce.State(idle, 0, 0, 0, last, ZERO, ZERO, e, y, ZERO, 0, 0, True)
        for last in ((moving,) if moving else (-1, 0, 1))
    ]
    if error == ZERO:
        found.append(pid_reg_ce.State())
    if dialect.series_end == SeriesEnd.CLEARED:
        return tuple((state, state) for state in found)
    return tuple((state._replace(i=-I_BOUND), state._replace(i=I_BOUND)) for state in found)


def pid_reg_ce_used(inputs: pid_reg_ce.Operands, shown: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return the inputs with every ACTUAL that gives the ERROR which the block published."""
    error = shown["error"]
    near = inputs.set_point - error
    found = [near]
    for direction in (REAL(-np.inf), REAL(np.inf)):
        value = near
        for _ in range(NEIGHBOURS):
            value = np.nextafter(value, direction)
            found.append(value)
    return tuple(inputs._replace(actual=value) for value in found if inputs.set_point - value == error)


def melsec_rejoin(state: melsec_pid.State, shown: Mapping[str, Any]) -> tuple[melsec_pid.State, melsec_pid.State]:
    """Return the bounds of a state that goes on from (d): rounding hides up to half a unit of the sum."""
    out = REAL(shown["out"])
    return (
        state._replace(mv=out - HALF, out=out),
        state._replace(mv=out + HALF, out=out),
    )
