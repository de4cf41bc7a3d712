"""What PID_Temp reads, keeps and publishes. The law stands in `pid_temp.py`.

Tags of the instance data block are named by their last parts: `Heat_PidUpperLimit` is Config.Output.Heat.PidUpperLimit,
`Heat_Gain` is Retain.CtrlParams.Heat.Gain.

Source:
    MANUAL PID control function manual 03/2017, PID_Temp, and TIA Portal help: names, ranges, defaults (spec E.1).
    ASSUMED defaults of Gain, Ti, Td, TdFiltRatio, input limits, CycleTime: read on the PID_Compact page.
"""

from __future__ import annotations

from typing import NamedTuple

from ahgateway.core.controllers.delta import ZERO, operand
from ahgateway.core.controllers.pid_temp_pwm import Pulse
from ahgateway.core.operands import Access, Kind, Operand
from ahgateway.core.real import REAL

FAR = 3.402822e38
"""The library's `no limit`."""

ONE = REAL(1)
HUNDRED = REAL(100)
FULL = REAL(27648)


def _real(
    name: str, default: float, text: str, unit: str = "", low: float | None = None, high: float | None = None
) -> Operand:
    return operand(name, Kind.REAL, default, text, unit=unit, minimum=low, maximum=high)


def _bool(name: str, default: bool, text: str) -> Operand:
    return operand(name, Kind.BOOL, default, text)


def _channel(side: str, lower: float, upper: float) -> tuple[Operand, ...]:
    """The tags that heating and cooling both have."""
    return (
        operand(f"{side}_Select", Kind.INT, 1, "second output: 0 none, 1 PWM, 2 PER", minimum=0, maximum=2),
        _real(f"{side}_PidUpperLimit", upper, "PidOutputSum that gives the upper output; 0 for cooling", "%"),
        _real(f"{side}_PidLowerLimit", lower, "PidOutputSum that gives the lower output; heating: 0 with cooling", "%"),
        _real(f"{side}_UpperScaling", 100.0, f"Output{side} at its upper end"),
        _real(f"{side}_LowerScaling", 0.0, f"Output{side} at its lower end"),
        _real(f"{side}_PwmUpperScaling", 100.0, "pulse width at the upper end", "%", 0.0, 100.0),
        _real(f"{side}_PwmLowerScaling", 0.0, "pulse width at the lower end", "%", 0.0, 100.0),
        _real(f"{side}_PerUpperScaling", 27648.0, "peripheral value at the upper end", "", -32512.0, 32511.0),
        _real(f"{side}_PerLowerScaling", 0.0, "peripheral value at the lower end", "", -32512.0, 32511.0),
        _real(f"{side}_MinimumOnTime", 0.0, "shortest pulse, rounded to calls", "s", 0.0, 100000.0),
        _real(f"{side}_MinimumOffTime", 0.0, "shortest gap, rounded to calls", "s", 0.0, 100000.0),
        _real(f"{side}_PwmPeriode", 0.0, "period of the pulses up to Cycle, rounded to calls; 0 is Cycle", "s", 0.0),
        _real(f"{side}_Gain", 1.0, "proportional gain, positive", "%/PV", 0.0),
        _real(f"{side}_Ti", 20.0, "integral time, 0 switches I off", "s", 0.0, 100000.0),
        _real(f"{side}_Td", 0.0, "derivative time, 0 switches D off", "s", 0.0, 100000.0),
        _real(f"{side}_TdFiltRatio", 0.2, "derivative filter as a share of Td", "", 0.0),
        _real(f"{side}_PWeighting", 1.0, "weight b of the setpoint in P", "", 0.0, 1.0),
        _real(f"{side}_DWeighting", 1.0, "weight c of the setpoint in D", "", 0.0, 1.0),
        _real(f"{side}_Cycle", 1.0, "sampling time of the law, a multiple of CycleTime_Value", "s", 0.0, 100000.0),
        _real(f"{side}_DeadZone", 0.0, "half width of the dead zone", "PV", 0.0),
        _real(f"{side}_ControlZone", FAR, "half width of the control zone; the largest value is off", "PV", 0.0),
    )  # fmt: skip


def _out(name: str, kind: Kind, text: str, unit: str = "") -> Operand:
    return operand(name, kind, None, text, unit=unit, access=Access.OUT)


OPERANDS: tuple[Operand, ...] = (
    _real("Setpoint", 0.0, "setpoint, limited in all modes", "PV"),
    _real("Input", 0.0, "process value", "PV"),
    operand("Input_PER", Kind.INT, 0, "process value as peripheral integer", minimum=-32768, maximum=32767),
    _real("Disturbance", 0.0, "feed-forward, added before the limits", "%"),
    _bool("ManualEnable", False, "rising edge: manual; falling edge: takes Mode"),
    _real("ManualValue", 0.0, "PidOutputSum in manual, limited", "%"),
    _bool("ErrorAck", False, "rising edge clears ErrorBits and latched warnings"),
    _bool("Reset", False, "rising edge: inactive, clears ErrorBits; falling edge: takes Mode"),
    _bool("ModeActivate", False, "rising edge takes Mode"),
    operand(
        "Mode", Kind.INT, 4, "0 inactive, 1 pretuning, 2 fine tuning, 3 automatic, 4 manual", minimum=0, maximum=4,
        access=Access.IN_OUT,
    ),
    _bool("InputPerOn", True, "TRUE reads Input_PER, FALSE reads Input"),
    _real("InputScaling_UpperPointIn", 27648.0, "Input_PER of the upper point"),
    _real("InputScaling_LowerPointIn", 0.0, "Input_PER of the lower point"),
    _real("InputScaling_UpperPointOut", 100.0, "process value of the upper point", "PV"),
    _real("InputScaling_LowerPointOut", 0.0, "process value of the lower point", "PV"),
    _real("InputUpperLimit", 120.0, "process value limit, exceeding it is error 0001h", "PV"),
    _real("InputLowerLimit", 0.0, "process value limit, falling below it is error 0001h", "PV"),
    _real("InputUpperWarning", FAR, "warning limit; outside the process value limits the limit is used", "PV"),
    _real("InputLowerWarning", -FAR, "warning limit; outside the process value limits the limit is used", "PV"),
    _real("SetpointUpperLimit", FAR, "upper limit of the setpoint", "PV"),
    _real("SetpointLowerLimit", -FAR, "lower limit of the setpoint", "PV"),
    _bool("ActivateCooling", False, "TRUE has a cooling output"),
    _bool("AdvancedCooling", True, "TRUE switches between two parameter sets, FALSE multiplies by CoolFactor"),
    _real("CoolFactor", 1.0, "gain of the heating actuator / gain of the cooling actuator, positive", "", 0.0),
    *_channel("Heat", 0.0, 100.0),
    *_channel("Cool", -100.0, 0.0),
    _real("CycleTime_Value", 0.1, "period at which the block is called", "s", 0.0),
    _real("SubstituteOutput", 0.0, "PidOutputSum while an error is pending, limited", "%"),
    _bool("SetSubstituteOutput", True, "TRUE puts out SubstituteOutput, FALSE the last valid output"),
    _bool("ActivateRecoverMode", True, "FALSE: any error makes the block inactive"),
    operand(
        "IntegralResetMode", Kind.INT, 4, "0 smooth, 1 deleted, 2 held, 3 overwritten, 4 as a setpoint change",
        minimum=0, maximum=4,
    ),
    _real("OverwriteInitialOutputValue", 0.0, "output that IntegralResetMode 3 starts from", "%"),
    operand("IntegralSum", Kind.REAL, 0.0, "PIDCtrl.IntegralSum, may be written", unit="%", access=Access.IN_OUT),
    _out("ScaledInput", Kind.REAL, "process value in use", "PV"),
    _out("PidOutputSum", Kind.REAL, "output of the law", "%"),
    _out("OutputHeat", Kind.REAL, "heating output"),
    _out("OutputCool", Kind.REAL, "cooling output"),
    _out("OutputHeat_PER", Kind.INT, "heating output as peripheral integer"),
    _out("OutputCool_PER", Kind.INT, "cooling output as peripheral integer"),
    _out("OutputHeat_PWM", Kind.BOOL, "heating pulses"),
    _out("OutputCool_PWM", Kind.BOOL, "cooling pulses"),
    _out("SetpointLimit_H", Kind.BOOL, "setpoint at or above its upper limit"),
    _out("SetpointLimit_L", Kind.BOOL, "setpoint at or below its lower limit"),
    _out("InputWarning_H", Kind.BOOL, "process value above its warning limit"),
    _out("InputWarning_L", Kind.BOOL, "process value below its warning limit"),
    _out("State", Kind.INT, "mode that is active; 5 is substitute output with error monitoring"),
    _out("Error", Kind.BOOL, "an error is pending in this call"),
    _out("ErrorBits", Kind.DINT, "errors since the last acknowledgement"),
    _out("Warning", Kind.DINT, "warnings"),
)  # fmt: skip


class Operands(NamedTuple):
    """What the block reads: REALs in the units of the table."""

    setpoint: REAL = ZERO
    input: REAL = ZERO
    input_per: int = 0
    disturbance: REAL = ZERO
    manualenable: bool = False
    manualvalue: REAL = ZERO
    errorack: bool = False
    reset: bool = False
    modeactivate: bool = False
    mode: int = 4
    inputperon: bool = True
    inputscaling_upperpointin: REAL = FULL
    inputscaling_lowerpointin: REAL = ZERO
    inputscaling_upperpointout: REAL = HUNDRED
    inputscaling_lowerpointout: REAL = ZERO
    inputupperlimit: REAL = REAL(120)
    inputlowerlimit: REAL = ZERO
    inputupperwarning: REAL = REAL(FAR)
    inputlowerwarning: REAL = REAL(-FAR)
    setpointupperlimit: REAL = REAL(FAR)
    setpointlowerlimit: REAL = REAL(-FAR)
    activatecooling: bool = False
    advancedcooling: bool = True
    coolfactor: REAL = ONE
    heat_select: int = 1
    heat_pidupperlimit: REAL = HUNDRED
    heat_pidlowerlimit: REAL = ZERO
    heat_upperscaling: REAL = HUNDRED
    heat_lowerscaling: REAL = ZERO
    heat_pwmupperscaling: REAL = HUNDRED
    heat_pwmlowerscaling: REAL = ZERO
    heat_perupperscaling: REAL = FULL
    heat_perlowerscaling: REAL = ZERO
    heat_minimumontime: REAL = ZERO
    heat_minimumofftime: REAL = ZERO
    heat_pwmperiode: REAL = ZERO
    heat_gain: REAL = ONE
    heat_ti: REAL = REAL(20)
    heat_td: REAL = ZERO
    heat_tdfiltratio: REAL = REAL(0.2)
    heat_pweighting: REAL = ONE
    heat_dweighting: REAL = ONE
    heat_cycle: REAL = ONE
    heat_deadzone: REAL = ZERO
    heat_controlzone: REAL = REAL(FAR)
    cool_select: int = 1
    cool_pidupperlimit: REAL = ZERO
    cool_pidlowerlimit: REAL = REAL(-100)
    cool_upperscaling: REAL = HUNDRED
    cool_lowerscaling: REAL = ZERO
    cool_pwmupperscaling: REAL = HUNDRED
    cool_pwmlowerscaling: REAL = ZERO
    cool_perupperscaling: REAL = FULL
    cool_perlowerscaling: REAL = ZERO
    cool_minimumontime: REAL = ZERO
    cool_minimumofftime: REAL = ZERO
    cool_pwmperiode: REAL = ZERO
    cool_gain: REAL = ONE
    cool_ti: REAL = REAL(20)
    cool_td: REAL = ZERO
    cool_tdfiltratio: REAL = REAL(0.2)
    cool_pweighting: REAL = ONE
    cool_dweighting: REAL = ONE
    cool_cycle: REAL = ONE
    cool_deadzone: REAL = ZERO
    cool_controlzone: REAL = REAL(FAR)
    cycletime_value: REAL = REAL(0.1)
    substituteoutput: REAL = ZERO
    setsubstituteoutput: bool = True
    activaterecovermode: bool = True
    integralresetmode: int = 4
    overwriteinitialoutputvalue: REAL = ZERO


class Core(NamedTuple):
    """What one execution of the law leaves to the next.

    Attributes:
        y: PidOutputSum.
        i: IntegralSum, in output units.
        d: Content of the derivative filter, in output units.
        u1: What D differentiated last, in PV units.
        valid: `u1` means something.
        cooling: The cooling parameter set is active.
        outside: PV was outside the control zone.
    """

    y: REAL = ZERO
    i: REAL = ZERO
    d: REAL = ZERO
    u1: REAL = ZERO
    valid: bool = False
    cooling: bool = False
    outside: bool = False


class State(NamedTuple):
    """What one call leaves to the next.

    Attributes:
        core: The law's own.
        state: The active mode, 0…5.
        calls: Calls until the law is due; 0 is now.
        errorbits: Errors since the last acknowledgement.
        latched: Warnings kept until acknowledgement.
        modeactivate1: ModeActivate of the last call; the next three likewise, for their edges.
        heat: Pulse output for heating; `cool` likewise.
    """

    core: Core = Core()
    state: int = 0
    calls: int = 0
    errorbits: int = 0
    latched: int = 0
    modeactivate1: bool = False
    reset1: bool = False
    manualenable1: bool = False
    errorack1: bool = False
    heat: Pulse = Pulse()
    cool: Pulse = Pulse()


class Terms(NamedTuple):
    """Every term of one call; `e`, `ez`, `p`, `raw` are 0 in calls in which the law was not due (`executed`)."""

    scaledinput: REAL
    setpoint: REAL
    e: REAL
    ez: REAL
    p: REAL
    i: REAL
    d: REAL
    raw: REAL
    pidoutputsum: REAL
    outputheat: REAL
    outputcool: REAL
    outputheat_per: int
    outputcool_per: int
    outputheat_pwm: bool
    outputcool_pwm: bool
    setpointlimit_h: bool
    setpointlimit_l: bool
    inputwarning_h: bool
    inputwarning_l: bool
    state: int
    cooling: bool
    executed: bool
    pending: int
    error: bool
    errorbits: int
    warning: int
    flags: int
