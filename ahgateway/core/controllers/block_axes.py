"""What each axis of MELSEC PID, PID_REG_CE and PID_Temp means for people, and the axes of every instruction.

This file decides no arithmetic. `identify` and messages are made from its table, Delta's stands in `dialect_axes`.
The manuals are silent on all of them; the candidates stand in spec controllers C.7, D.7 and E.3 to E.8.
"""

from __future__ import annotations

from ahgateway.core.dialect_axes import TABLE, Axis


def _axes(instruction: str, *rows: tuple[str, str, tuple[str, ...], str]) -> tuple[Axis, ...]:
    return tuple(Axis(name, about, values, instruction, "block", move) for name, about, values, move in rows)


MELSEC_PID = _axes(
    "MELSEC_PID",
    (
        "number_format",
        "What the sum of the increments is and what (d) shows of it (spec C.7/1)",
        ("REAL, shown as it is", "REAL, (d) rounded half to even", "the sum itself is rounded"),
        "any execution whose increment is no whole number: KP 37, TI above 0, SV and PV apart",
    ),
    (
        "alarm_input",
        "Which PV the input variation alarm watches (spec C.7/2)",
        ("behind the input filter", "before it"),
        "with ALPHA above 0 and ACT.1 on, let PV jump by more than (s3)+20",
    ),
    (
        "variation",
        "Which difference counts as an increase (spec C.7/3)",
        ("new less old", "old less new"),
        "with ACT.1 on, different values in (s3)+20 and +21, let PV jump by more than the smaller one",
    ),
    (
        "destination_written",
        "What becomes of a value that the program writes into (d) while running (spec C.7/4)",
        ("overwritten by the sum", "taken as the sum"),
        "write another value into (d) while the contact is on, between the limits",
    ),
    (
        "action_change",
        "What a change of ACT.0 does to the history (spec C.7/5)",
        ("nothing", "the sign of EV(n-1) and D(n-1) changes"),
        "change ACT.0 while the contact is on and SV and PV are apart",
    ),
    (
        "first_execution",
        "What the history holds when the contact turns on (spec C.3)",
        ("the present values", "zeros"),
        "turn the contact off and on with ALPHA above 0 and PV apart from 0",
    ),
)

PID_REG_CE = _axes(
    "PID_REG_CE",
    (
        "integral_span",
        "What the printed limits 0 and TN of the integral mean (spec D.2)",
        ("a running integral", "one that ends TN after the series began"),
        "let a series last longer than TN with Y below Y_OGR",
    ),
    (
        "pause_from",
        "Which T1 makes a pause (spec D.7/1)",
        ("the series' first", "from the present Y at each pulse end"),
        "with a short TN let Y grow within a series until the pauses change",
    ),
    (
        "short_pulse",
        "Which T1 the pause sees when the first pulse was stretched (spec D.7/3)",
        ("the unstretched", "the stretched"),
        "move SET_POINT so little that T1 is below PT_MIN_IMP, with D_ZONE smaller than that, and wait for a pause",
    ),
    (
        "backlash_pause",
        "Whether PT_LUFT lengthens the T1 that makes the pause (spec D.7/4)",
        ("no", "yes"),
        "with PT_LUFT above 0 move SET_POINT so that the direction changes, and wait for a pause",
    ),
    (
        "first_backlash",
        "Whether the very first pulse is lengthened by PT_LUFT (spec D.7/5)",
        ("no", "yes"),
        "no picture tells, for the last motion is hidden until there is one: measure the first pulse after a "
        "cold start with PT_LUFT above 0, and write the value into the profile",
    ),
    (
        "zone_pulse",
        "What happens to a pulse that is running when the zone is reached (spec D.7/6)",
        ("it is finished", "it is cut"),
        "move SET_POINT onto ACTUAL during a long first pulse",
    ),
    (
        "series_end",
        "What becomes of the integral when a series ends (spec D.7/8)",
        ("cleared", "kept"),
        "with TN above 0 let a series end in the zone, then move SET_POINT again with Y below Y_OGR",
    ),
    (
        "stopped",
        "What OSTANOV means (spec D.7/9)",
        ("no series active, or manual", "no output"),
        "watch a pause",
    ),
    (
        "error_sign",
        "Whether ERROR follows ACTION (spec D.7/10)",
        ("no", "yes"),
        "set ACTION with SET_POINT and ACTUAL apart",
    ),
    (
        "idle_y",
        "What Y shows inside the zone and in manual (spec D.7/11)",
        ("0", "the last demand"),
        "set REG_AVT to FALSE during a series",
    ),
    (
        "no_minimum_pulse",
        "What PT_MIN_IMP of 0 or less is (spec D.6)",
        ("a fault, outputs off", "one call"),
        "set PT_MIN_IMP to 0 with SET_POINT outside the zone",
    ),
)

PID_TEMP = _axes(
    "PID_Temp",
    (
        "dead_zone",
        "What an error outside the dead zone counts as (spec E.4)",
        ("less the zone", "whole"),
        "set DeadZone above 0 and the error beyond it, between the limits",
    ),
    (
        "zone_return",
        "The integral when the process value comes back into the control zone (spec E.4)",
        ("as it was held", "preset for a bumpless return"),
        "set ControlZone so that the process value leaves it, with Ti above 0, and let it come back",
    ),
    (
        "switching",
        "Whether an output of exactly 0 changes the parameter set (spec E.5)",
        ("yes", "no"),
        "with ActivateCooling and AdvancedCooling, start from inactive with the setpoint below the process value",
    ),
    (
        "zone_at_transfer",
        "What becomes of a bumpless preset outside the control zone (spec E.7)",
        ("dropped", "kept"),
        "go from manual to automatic with the process value outside ControlZone and Ti above 0",
    ),
    (
        "resume",
        "How automatic mode goes on after the substitute output (spec E.7)",
        ("bumpless from the present output", "with the integral as it was"),
        "make Setpoint invalid (NaN) for a while in automatic mode",
    ),
    (
        "invalid_gain",
        "The integral while a gain is not positive (spec E.7)",
        ("held", "cleared"),
        "set Gain to 0 for more than one Cycle while IntegralSum is not 0",
    ),
    (
        "warning_edge",
        "Whether a warning limit that is just reached warns (spec E.7)",
        ("no", "yes"),
        "set InputUpperWarning to exactly the process value, with Input held",
    ),
    (
        "warning_latch",
        "How long Warning shows what does not go away by itself (spec E.7)",
        ("as long as its cause", "until Reset or ErrorAck"),
        "activate an invalid Mode, then a valid one",
    ),
    (
        "disturbance_place",
        "Where Disturbance joins the sum (spec E.8)",
        ("before CoolFactor", "behind it"),
        "with CoolFactor in use let Disturbance be other than 0 while the output is negative",
    ),
    (
        "sampling_time",
        "Which time the law takes when Cycle is no multiple of the call period (spec E.3)",
        ("Cycle", "calls times CycleTime"),
        "set Cycle to 1.5 call periods with Ti above 0",
    ),
    (
        "per_rounding",
        "How a peripheral output is rounded (spec E.6)",
        ("half to even", "half away from 0"),
        "with Select 2, PerUpperScaling 100 and PerLowerScaling 0, give ManualValue 12.5 in manual mode",
    ),
    (
        "pwm_inactive",
        "What inactive mode does to carry and phase of the pulses (spec E.6)",
        ("cleared", "kept"),
        "set Select to 0 and back to 1, which clears the pulses, then go inactive and back within a period of them",
    ),
    (
        "pwm_conflict",
        "Which rule wins when both minimum times do not fit into the period (spec E.6)",
        ("the minimum on time", "the minimum off time"),
        "set MinimumOnTime and MinimumOffTime longer than the period together, with the output in the middle, then "
        "Select to 0 and back to 1",
    ),
)

OTHERS: dict[str, tuple[Axis, ...]] = {"MELSEC_PID": MELSEC_PID, "PID_REG_CE": PID_REG_CE, "PID_Temp": PID_TEMP}


def axes_of(instruction: str) -> tuple[Axis, ...]:
    """Return the axes of an instruction in the order of their table."""
    if instruction in OTHERS:
        return OTHERS[instruction]
    return tuple(axis for axis in TABLE if axis.concerns(instruction))
