"""Proposals: every rule's gains in the loop's own form, rounded to its registers, and what the loop will do with them.

This file alone decides the order: rule, form, rounding, and only then margins and prediction, so that what is shown
is what the registers will hold.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from ahgateway.core.dialect import DEFAULT, Dialect
from ahgateway.tuning.blocks import BLOCKS, Block, Params, Use
from ahgateway.tuning.canonical import Canonical, standard
from ahgateway.tuning.conversion import rounded
from ahgateway.tuning.margins import Margins, margins
from ahgateway.tuning.models import Kind, Model
from ahgateway.tuning.predict import Quality, Response, judge_load, judge_setpoint, simulate
from ahgateway.tuning.rules import RULES, Rule, apply
from ahgateway.tuning.runner import Runner, at_rest

FILTER_SHARE = 8.0
"""Tf of a proposal is Td by this: noise is held down, and the phase lost is small."""
EXECUTIONS_MAX = 4000
"""Executions of one prediction; where they end before the loop has settled, a multiple of CYCLE is simulated."""
PACE_MAX = 0.05
"""Longest such multiple, as a share of the dead time: the loop cannot tell it from CYCLE."""
TIMES = ("CYCLE", "TS", "ALPHA", "Heat_Cycle", "CycleTime_Value")
"""Operands that say how often a block is executed, or depend on it."""
MS_WANTED = 1.7
"""Largest Ms of a proposal that is recommended."""
GAIN_NAMES = (
    "Kp", "Ki", "Kd", "Kc_Kp", "Ti_Ki", "Td_Kd", "Tf", "KP", "TI", "TD", "KD",
    "Heat_Gain", "Heat_Ti", "Heat_Td", "Heat_TdFiltRatio",
)  # fmt: skip
"""What a proposal is about, in the blocks' own names."""
FORM_NAMES = ("PID_DIR", "PID_DE", "ACT", "Heat_DWeighting")
"""What a proposal may change besides: direction of action, and whether D sees SV."""
D_OF_PV = {"DPIDE": "PID_DE", "PID_Temp": "Heat_DWeighting"}
"""Blocks that can choose what D acts on, and by which operand; MELSEC's D always is of PV."""
TUNED = ("DPID", "DPIDE", "MELSEC_PID", "PID_Temp")
"""Blocks that rules for PID gains have something to say of."""
ACT_REVERSE = 1


@dataclass(frozen=True, slots=True)
class LoopForm:
    """The loop as it stands: instruction, its settings now, and where it works.

    Attributes:
        instruction: One of `TUNED`.
        settings: Its operands by the manual's names; what is missing has its default.
        at: PV and MV of the operating point.
        sv_step: Size of the setpoint step that is predicted, in PV.
        load_step: Size of the load step that is predicted, in MV.
        dialect: How this PLC discretises.
        writable: Operands that may be written; None where nobody said, and then all.
    """

    instruction: str
    settings: Params
    at: tuple[float, float]
    sv_step: float
    load_step: float
    dialect: Dialect = DEFAULT
    writable: frozenset[str] | None = None


@dataclass(frozen=True, slots=True)
class Proposal:
    """One set of gains and what comes of it.

    Attributes:
        name: The rule, or `present` for what the loop holds now.
        source: Where the formula stands.
        settings: Every operand that would be written, rounded as its register holds it.
        canonical: What these settings mean.
        margins: Of the loop with them.
        setpoint: Prediction after a step of SV.
        load: Prediction after a load step.
        setpoint_trace: The response behind `setpoint`.
        load_trace: The response behind `load`.
        pace_s: Time between the executions that were simulated, in s; CYCLE where these were enough.
    """

    name: str
    source: str
    settings: Params
    canonical: Canonical
    margins: Margins
    setpoint: Quality
    load: Quality
    setpoint_trace: Response
    load_trace: Response
    pace_s: float


def present(loop: LoopForm) -> Canonical:
    """Return what the loop is set to now."""
    block = BLOCKS[loop.instruction]
    return block.read(block.settings(loop.settings), Use())


def action(model: Model, loop: LoopForm) -> int:
    """Direction of action that the process asks for: E = SV − PV for a positive gain."""
    return 1 if model.gain > 0.0 else -1


def proposals(model: Model, loop: LoopForm, dial: float = 0.5, rules: tuple[Rule, ...] = RULES) -> tuple[Proposal, ...]:
    """Return what each rule proposes for this loop, in the rules' order; rules without an answer are left out.

    Args:
        model: The process.
        loop: The loop as it stands.
        dial: 0 cautious … 1 fast.
        rules: Which rules.
    """
    now = present(loop)
    chosen_by = D_OF_PV.get(loop.instruction)
    may_choose = chosen_by is not None and (loop.writable is None or chosen_by in loop.writable)
    out = []
    for rule in rules:
        gains = apply(rule, model, now.ts_s, dial)
        if gains is None:
            continue
        filter_s = gains.td_s / FILTER_SHARE if loop.instruction != "DPID" else 0.0
        wanted = replace(
            standard(gains.kc, gains.ti_s, gains.td_s, tf_s=filter_s),
            c=0.0 if gains.td_s > 0.0 and may_choose else now.c,
            sign=action(model, loop), ts_s=now.ts_s, umin=now.umin, umax=now.umax, bias=now.bias,
            band=now.band, band_kind=now.band_kind, b=now.b, tau_pv_s=now.tau_pv_s,
        )  # fmt: skip
        out.append(evaluate(rule.name, rule.source, wanted, model, loop))
    return tuple(out)


def evaluate(name: str, source: str, wanted: Canonical, model: Model, loop: LoopForm) -> Proposal:
    """Put settings into the loop's form, round them, and find out what they do."""
    block = BLOCKS[loop.instruction]
    now = block.settings(loop.settings)
    form = Use(dependent=bool(now.get("PID_EQ", False)))
    written = {
        key: rounded(value) for key, value in block.write(wanted, form).items() if key in (*GAIN_NAMES, *FORM_NAMES)
    }
    if "ACT" in written:
        # Only the direction is ours, the other bits of ACT are alarms, limits and tuning.
        written["ACT"] = int(now["ACT"]) & ~ACT_REVERSE | int(written["ACT"]) & ACT_REVERSE
    full = now | written
    real = block.read(full, Use())
    paced = full | _paced(model, real, block)
    ts = block.read(paced, Use()).ts_s
    # A held output acts half a sample late: what a longer sample adds to that is taken off the dead time.
    late = replace(model, dead_time_s=max(0.0, model.dead_time_s - 0.5 * (ts - real.ts_s)))
    length = min(horizon_s(model, real), EXECUTIONS_MAX * ts)
    run = _runs(loop, paced)
    pv = loop.at[0]
    setpoint = simulate(run(), late, loop.at, pv + loop.sv_step, 0.0, length)
    load = simulate(run(), late, loop.at, pv, loop.load_step, length)
    return Proposal(
        name,
        source,
        {key: value for key, value in written.items() if key in GAIN_NAMES or value != now[key]},
        real,
        margins(model, real),
        judge_setpoint(setpoint, loop.at, integral_error(model, real, loop.sv_step, 0.0)),
        judge_load(load, loop.at, integral_error(model, real, 0.0, loop.load_step)),
        setpoint,
        load,
        ts,
    )


def _paced(model: Model, real: Canonical, block: Block) -> Params:
    """The operands that make a block slow enough to be predicted to its end, and no slower than the loop allows."""
    wanted = math.ceil(horizon_s(model, real) / (EXECUTIONS_MAX * real.ts_s))
    times = max(1, min(wanted, int(PACE_MAX * model.dead_time_s / real.ts_s)))
    slower = block.write(replace(real, ts_s=times * real.ts_s), Use())
    return {name: value for name, value in slower.items() if name in TIMES} if times > 1 else {}


def integral_error(model: Model, settings: Canonical, sv: float, load: float) -> float:
    """Return ∫(SV − PV) in PV·s after steps of SV in PV and of the load in MV, for a law with I that meets no limit.

    The integral alone brings MV to its new value, and only the error moves it: IE = ΔMV / Ki (Åström and Hägglund).
    """
    if settings.ki <= 0.0:
        return 0.0
    static = 0.0 if model.kind is Kind.IPDT else 1.0 / abs(model.gain)
    return ((static + settings.kp * (1.0 - settings.b)) * sv - math.copysign(load, load * model.gain)) / settings.ki


def _runs(loop: LoopForm, settings: Mapping[str, float | int | bool]) -> Callable[[], Runner]:
    pv, mv = loop.at
    return lambda: at_rest(loop.instruction, settings, pv, pv, mv, loop.dialect)


def horizon_s(model: Model, settings: Canonical) -> float:
    """How long a loop needs to settle, in s; rather too long."""
    ts = settings.ts_s
    slow = 20.0 * (model.dead_time_s + ts) if model.kind is Kind.IPDT else 10.0 * model.slowness_s
    integral = 0.0
    if settings.ki > 0.0:
        # Where the gain is small the loop is I·K alone, with the time constant (1 + K·Kp)/(K·Ki).
        static = 0.0 if model.kind is Kind.IPDT else 1.0 / (abs(model.gain) * settings.ki)
        integral = 5.0 * (settings.ti_s + static)
    return max(slow, 40.0 * ts, 20.0 * model.dead_time_s, integral)


def recommended(found: tuple[Proposal, ...]) -> Proposal | None:
    """Return the proposal with the smallest load IAE among those with Ms up to `MS_WANTED`; None if there is none."""
    robust = [each for each in found if each.margins.ms <= MS_WANTED and math.isfinite(each.load.iae)]
    return min(robust, key=lambda each: each.load.iae) if robust else None
