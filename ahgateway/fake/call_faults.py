"""Wrong arithmetic on purpose for MELSEC PID, PID_REG_CE and PID_Temp; see `faults` for what a fault is."""

from __future__ import annotations

from typing import Any

from ahgateway.core.controllers.delta import ZERO
from ahgateway.core.controllers.melsec_pid import ACT_REVERSE
from ahgateway.core.controllers.pid_reg_ce import IDLE, PULSE
from ahgateway.core.real import REAL
from ahgateway.fake.faults import Fault, Step, inputs_changed, more

MELSEC = frozenset({"MELSEC_PID"})
PULSED = frozenset({"PID_REG_CE"})
TEMP = frozenset({"PID_Temp"})


def _longer_pulse(step: Step) -> Step:
    """The first pulse of a series lasts one call too long."""

    def wrong(inputs: Any, state: Any, dialect: Any, ts: REAL) -> tuple[Any, Any]:
        after, terms = step(inputs, state, dialect, ts)
        if state.phase == IDLE and after.phase == PULSE:
            return after._replace(ticks=after.ticks + 1), terms
        return after, terms

    return wrong


def _carry_lost(step: Step) -> Step:
    """What a period of pulses owes is not carried to the next one."""

    def wrong(inputs: Any, state: Any, dialect: Any, ts: REAL) -> tuple[Any, Any]:
        after, terms = step(inputs, state, dialect, ts)
        return after._replace(heat=after.heat._replace(carry=ZERO), cool=after.cool._replace(carry=ZERO)), terms

    return wrong


def _wrong_period(step: Step) -> Step:
    def wrong(inputs: Any, state: Any, dialect: Any, ts: REAL) -> tuple[Any, Any]:
        return step(inputs, state, dialect, ts * REAL(1.25))

    return wrong


CALL_FAULTS: dict[str, Fault] = {
    each.name: each
    for each in (
        Fault(
            "kp-1-percent",
            "the gain × 1.01 inside",
            inputs_changed(more("kp", "heat_gain", "cool_gain")),
            MELSEC | PULSED | TEMP,
        ),
        Fault("ti-1-percent", "the integral time × 1.01 inside", inputs_changed(more("heat_ti", "cool_ti")), TEMP),
        Fault("interval-25-percent", "call period × 1.25 inside", _wrong_period, MELSEC | TEMP),
        Fault(
            "act-reversed",
            "ACT.0 is read inverted",
            inputs_changed(lambda inputs: {"act": inputs.act ^ ACT_REVERSE}),
            MELSEC,
        ),
        Fault("input-filter-ignored", "the PV filter is off", inputs_changed(lambda inputs: {"alpha": 0}), MELSEC),
        Fault("pulse-one-call-long", "the first pulse of a series is one call too long", _longer_pulse, PULSED),
        Fault("luft-ignored", "PT_LUFT counts as 0", inputs_changed(lambda inputs: {"pt_luft": ZERO}), PULSED),
        Fault("zone-ignored", "D_ZONE counts as 0", inputs_changed(lambda inputs: {"d_zone": ZERO}), PULSED),
        Fault("carry-lost", "what a period of pulses owes is forgotten", _carry_lost, TEMP),
    )
}
"""Every fault of the three blocks by name."""
