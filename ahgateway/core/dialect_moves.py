"""What an operator does to tell the values of an axis apart, what has to be known before, and what hides it for good.

This file decides no arithmetic and knows no value's meaning, which stands in `dialect_axes`. The three gains are named
`the P gain`, `the I gain` and `the D gain`; `spoken` puts an instruction's own names there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ahgateway.core.dialect import (
    Band,
    CrossBand,
    DerivativeOf,
    Filter,
    FilterContent,
    FormChange,
    FormIntegral,
    Freeze,
    IntegralStore,
    IntegralUsed,
    Integrator,
    ManualIntegral,
    PresetD,
    Transfer,
    Transfer2,
    TsUnit,
)

GAINS = {
    "DPID": {"the P gain": "Kp", "the I gain": "Ki", "the D gain": "Kd"},
    "DPIDE": {"the P gain": "Kc_Kp", "the I gain": "Ti_Ki", "the D gain": "Td_Kd"},
}


@dataclass(frozen=True, slots=True)
class Alike:
    """Values of an axis that leave the same bits in every word while other axes have certain values.

    Attributes:
        given: The other axes and those of their values; all must hold, an axis that the instruction lacks does.
        own: The values that are one then; () for all of them.
        instruction: Where it is so; "" for both.
    """

    given: Mapping[str, tuple[int, ...]]
    own: tuple[int, ...] = ()
    instruction: str = ""


@dataclass(frozen=True, slots=True)
class Move:
    """What brings one axis to light.

    Attributes:
        text: What to do, with which operand, and for how long.
        after: Axes that have to be decided before; while they are open this one's values look alike.
        alike: Where its values cannot be told apart, whatever an operator does.
    """

    text: str
    after: tuple[str, ...] = ()
    alike: tuple[Alike, ...] = ()


def spoken(text: str, instruction: str) -> str:
    """Put an instruction's own names of the gains into a text."""
    for plain, name in GAINS.get(instruction, {}).items():
        text = text.replace(plain, name)
    return text


NO_BAND = (Alike({"cross_band": (CrossBand.OFF,)}),)
NO_STATUS = (Alike({"cross_band": (CrossBand.PLAIN, CrossBand.OFF)}),)
"""Without the zero-cross band the status follows from E alone."""
NO_FILTER = (Alike({"filter": (Filter.IGNORED,)}),)
RUNS_ON = (Alike({"freeze": (Freeze.NEVER, Freeze.PREVIOUS_MV)}),)
"""What does not stop for the sum does not ask how the sum is held against a limit."""
DIRECT: dict[str, tuple[int, ...]] = {"transfer": (Transfer.DIRECT,), "transfer_2": (Transfer2.DIRECT,)}
NO_TRANSFER = (Alike(DIRECT),)
NO_PRESET = (
    Alike(
        {
            "transfer": (Transfer.DIRECT, Transfer.MV_AS_I),
            "transfer_2": (Transfer2.DIRECT,),
            "manual_integral": (ManualIntegral.HELD, ManualIntegral.RUNS),
            "freeze": (Freeze.ALWAYS, Freeze.OUTWARD, Freeze.NEVER, Freeze.PREVIOUS_MV),
        }
    ),
)
"""Nothing is computed back from an MV."""

SLOW = "with a CYCLE of 2 s and pictures every 50 ms, some times, for it must fall early in an interval: "
SIMULATED = "with a PV that you set, its last digit always moving (simulator): "

MOVES: dict[str, Move] = {
    "freeze": Move(
        "automatic: drive MV into a limit by a large step of SV and, 4 CYCLEs later, back; wait until SV - PV is "
        "small; write MV_MAX well below I_MV and step SV to just past PV, so that SV - PV changes its sign and P + "
        "I_MV stays above MV_MAX, 4 CYCLEs"
    ),
    "run_off": Move("automatic, I_MV not 0: PID_RUN off for 4 CYCLEs and on again"),
    "first_call": Move("no picture shows it: see after a power-up whether MV moves at once or after one CYCLE"),
    "direction": Move("automatic: some executions with SV and PV apart"),
    "band": Move(
        "automatic, ERR_DBW above the noise of PV: step SV so that SV - PV comes from outside to inside, stays there "
        "for 2 CYCLEs, and leaves on the other side"
    ),
    "band_edge": Move(
        SIMULATED + "ERR_DBW = 3; SV - PV = 4 for 2 CYCLEs, then exactly 3 for one execution",
        after=("band",),
        alike=(Alike({"band": (Band.OFF, Band.SHIFTED)}),),
    ),
    "cross_band": Move(
        "automatic, ERR_DBW above the noise of PV: step SV so that SV - PV comes from outside to inside, far from 0, "
        "for 3 CYCLEs, then changes its sign inside, 2 CYCLEs"
    ),
    "cross_edge": Move(
        SIMULATED + "ERR_DBW = 6; SV - PV = 10, 4, -2 (PV has passed SV) for 2 CYCLEs each, then exactly -6 for one "
        "execution, then -7",
        after=("cross_band", "cross_scan"),
        alike=NO_BAND,
    ),
    "cross_touch": Move(
        SIMULATED + "ERR_DBW = 6; SV - PV = 10, then 4 for 2 CYCLEs each, then exactly 0 for one execution, then 2",
        after=("cross_band", "cross_scan"),
        alike=NO_STATUS,
    ),
    "cross_manual": Move(
        SIMULATED + "ERR_DBW = 6; SV - PV = 10, 4, -2 (PV has passed SV), then PID_MAN on and off, 2 CYCLEs each",
        after=("cross_band", "cross_scan", "transfer"),
        alike=NO_STATUS,
    ),
    "cross_d": Move(
        SIMULATED + "ERR_DBW = 6, Td_Kd above 0, PID_DE off; SV - PV = 10, 4, -2, -1, -8, 2 CYCLEs each",
        after=("cross_band", "cross_scan"),
        alike=NO_BAND,
    ),
    "ts_source": Move(
        "automatic, the I gain above 0, SV - PV not 0, a CYCLE that is no multiple of the scan time, pictures faster "
        "than half a scan: 30 executions"
    ),
    "ts_unit": Move("the I gain above 0 and a CYCLE that is neither 10 nor 100 ms; some executions with SV - PV not 0"),
    "ts_scale": Move(
        "write a CYCLE of 7, then 13, for which the two differ in the last bit; 10 executions each",
        after=("ts_unit",),
        alike=(Alike({"ts_unit": (TsUnit.COUNTS, TsUnit.LEFT_OUT, TsUnit.TEN_MS, TsUnit.HUNDRED_MS)}),),
    ),
    "integrator": Move("automatic: some executions with another SV - PV each"),
    "integral_store": Move(
        "the I gain other than 1, some executions; on a DPIDE also with PID_EQ on and Kc_Kp other than 1"
    ),
    "integral_used": Move("automatic: some executions with SV - PV not 0"),
    "product": Move(
        "automatic, odd gains such as 0.37: three odd steps of SV up and down, 6 CYCLEs each, so that I_MV swings "
        "through 0",
        after=("ts_unit", "integrator"),
        alike=(
            Alike({"ts_unit": (TsUnit.LEFT_OUT,)}),
            Alike({"integrator": (Integrator.DVP,)}),
            Alike({"integral_store": (IntegralStore.SUM,)}),
        ),
    ),
    "ratio": Move(
        "PID_EQ on, a short odd Ti_Ki such as 0.9: three odd steps of SV up and down, 6 CYCLEs each, so that I_MV "
        "swings through 0"
    ),
    "dependent_sum": Move(
        "PID_EQ on, a Kc_Kp such as 1.3, no power of 2, and Td_Kd above 0: a dozen odd steps of SV, 2 CYCLEs apart"
    ),
    "derivative_of": Move("automatic, the D gain above 0: step SV, 2 CYCLEs"),
    "derivative_product": Move(
        "automatic, an odd D gain: a dozen odd steps of SV, 2 CYCLEs apart, each so large that D is about as large "
        "as the rest of MV, between the limits",
        after=("derivative_of", "sum_order"),
        alike=(Alike({"ts_unit": (TsUnit.LEFT_OUT,)}, instruction="DPID"),),
    ),
    "filter": Move(
        "automatic, Tf and Td_Kd above 0, PV moving: two steps of SV, 15 executions behind each; what differs in the "
        "last bit alone takes a large D"
    ),
    "filter_content": Move(
        "Tf and Td_Kd above 0: write another Td_Kd while D is not 0, a few CYCLEs behind a step of SV",
        after=("filter",),
        alike=(Alike({"filter": (Filter.IGNORED,)}, (FilterContent.TERM, FilterContent.SLOPE)),),
    ),
    "tf_unit": Move("PID_EQ on, Tf above 0 and Td_Kd other than 1: 15 executions with a moving PV", alike=NO_FILTER),
    "first_history": Move(
        "the D gain above 0, PV moving: PID_RUN off for 4 CYCLEs and on again; `stale` and run_off_history = kept do "
        "the same here, so that both may stay open together",
        after=("filter_content",),
    ),
    "sum_order": Move(
        "automatic, odd gains, the D gain above 0: a dozen odd steps of SV, 2 CYCLEs apart, MV between its limits"
    ),
    "bias_joins": Move(
        "BIAS such as 3.3, odd gains, Td_Kd above 0: a dozen odd steps of SV, 2 CYCLEs apart, MV between its limits",
        after=("sum_order",),
    ),
    "freeze_test": Move(
        "the D gain so large that D alone carries the sum over MV_MAX and back, for 10 executions",
        after=("freeze",),
        alike=RUNS_ON,
    ),
    "limit_edge": Move(
        SIMULATED + "SV - PV = 8, CYCLE 0.5 s, the D gain 0, the P gain 1: the I gain to 0 for 2 CYCLEs, MV_MAX = 16, "
        "then the I gain to 0.5 (Ti_Ki with PID_EQ off): the sum grows by 2 and comes to exactly 16; 12 CYCLEs",
        after=("freeze",),
        alike=RUNS_ON,
    ),
    "limited_output": Move(
        "automatic, the P and the D gain 0: a large SV - PV until MV stands at MV_MAX by integration alone",
        after=("freeze",),
        alike=(Alike({"freeze": (Freeze.NEVER,)}), Alike({"integral_used": (IntegralUsed.OLD,)})),
    ),
    "limits": Move("automatic, MV at rest: write an MV_MAX that is below MV_MIN, 4 CYCLEs; it moves MV"),
    "clamped": Move("on a bench: a gain of -1 or a CYCLE of 0, for 2 CYCLEs"),
    "ki_off": Move("automatic, I_MV not 0: the I gain to 0 for 4 CYCLEs and back; MV jumps"),
    "kc_off": Move("PID_EQ on, I_MV not 0: Kc_Kp = 0 for 3 CYCLEs and back; MV jumps", after=("ki_off",)),
    "run_off_history": Move(
        "the D gain above 0, PV moving: PID_RUN off for 4 CYCLEs and on again; `kept` and first_history = stale do "
        "the same here, so that both may stay open together",
        after=("filter_content",),
    ),
    "run_off_filter": Move(
        "Tf and Td_Kd above 0, D not 0: PID_RUN off for 4 CYCLEs and on again", after=("filter", "filter_content")
    ),
    "run_off_mout": Move("MOUT_AUTO on, MOUT not 0: PID_RUN off for 4 CYCLEs and on again, twice"),
    "run_off_scan": Move(SLOW + "PID_RUN off, 2 CYCLEs"),
    "run_on": Move(
        SLOW + "PID_RUN off, and on again after 2 CYCLEs, a quarter of a CYCLE behind an execution; 3 CYCLEs"
    ),
    "en_off_time": Move(SLOW + "EN off for a quarter of a CYCLE; the profile must name `en`"),
    "en_on_history": Move(
        "the D gain above 0, PV moving: EN off for 4 CYCLEs and on again; the profile must name `en`",
        after=("first_history", "filter_content"),
    ),
    "stop_history": Move(
        "the D gain above 0, PV moving: the PLC to STOP for 4 CYCLEs and to RUN; the profile must name `running`",
        after=("first_history", "filter_content"),
    ),
    "manual_integral": Move("PID_MAN on for 4 CYCLEs with SV - PV not 0"),
    "manual_history": Move(
        "the D gain above 0: PID_MAN on for 6 CYCLEs with a moving PV, then PID_MAN off", after=("transfer",)
    ),
    "manual_filter": Move(
        "Tf and Td_Kd above 0: PID_MAN on for 6 CYCLEs with a moving PV, then PID_MAN off, 8 CYCLEs",
        after=("filter", "filter_content", "transfer"),
    ),
    "manual_refresh": Move(SLOW + "PID_MAN on: another MOUT, 2 CYCLEs"),
    "mout_auto": Move(
        "on a bench: MOUT_AUTO and PID_MAN on, MOUT beyond MV_MAX by 20, 2 CYCLEs later by 30, in turn three times"
    ),
    "transfer": Move(
        "PID_MODE 0, PID_MAN on for 4 CYCLEs, another MOUT, then PID_MAN off with SV - PV not 0, 3 CYCLEs"
    ),
    "transfer_2": Move(
        "PID_MODE 2, PID_MAN on for 4 CYCLEs, another MOUT, then PID_MAN off with SV - PV not 0, 3 CYCLEs"
    ),
    "preset_order": Move(
        "six transfers as for `transfer`, each from another odd MOUT, with P, D and BIAS not 0",
        after=("transfer", "preset_d"),
        alike=(*NO_PRESET, Alike({"preset_d": (PresetD.LEFT_OUT,)}, instruction="DPID")),
    ),
    "preset_d": Move(
        "the D gain above 0, PV moving: a transfer as for `transfer`", after=("transfer",), alike=NO_PRESET
    ),
    "preset_integrates": Move(
        "a transfer as for `transfer`, SV - PV not 0",
        after=("transfer",),
        alike=(Alike({"transfer": (Transfer.DIRECT, Transfer.MV_AS_I), "transfer_2": (Transfer2.DIRECT,)}),),
    ),
    "preset_limit": Move(
        "a transfer as for `transfer`, the P gain times SV - PV larger than MV_MAX - MV_MIN",
        after=("transfer",),
        alike=(Alike({**DIRECT, "manual_integral": (ManualIntegral.HELD, ManualIntegral.RUNS)}),),
    ),
    "schedule": Move(
        "a CYCLE that is no multiple of the scan time, pictures faster than half a scan: 80 executions in automatic"
    ),
    "bad_input": Move("on a bench: write 0x7FC00000 to SV for 4 CYCLEs, then a number again"),
    "form_change": Move(
        "on a bench, automatic, the D gain above 0: six odd steps of SV; then with SV - PV not 0 PID_DIR to its "
        "other value for 3 CYCLEs and back, and on a DPIDE then PID_DE likewise",
        after=("derivative_of",),
        alike=(Alike({"derivative_of": (DerivativeOf.PV,)}, (FormChange.KEPT, FormChange.TURNED), "DPID"),),
    ),
    "form_integral": Move(
        "automatic, I_MV not 0: PID_EQ to its other value for 3 CYCLEs and back; MV jumps",
        after=("integral_store",),
        alike=(Alike({"integral_store": (IntegralStore.TERM,)}, (FormIntegral.KEPT, FormIntegral.RESCALED)),),
    ),
    "cross_jump": Move(
        SIMULATED + "ERR_DBW = 6; SV - PV = 8, then by one step of SV -4, then -5, 2 CYCLEs each",
        after=("cross_band", "cross_scan"),
        alike=NO_STATUS,
    ),
    "cross_sv": Move(
        SIMULATED + "ERR_DBW = 6; SV - PV = 10, 4, -2 (PV has passed SV), then SV 0.5 higher, 2 CYCLEs each",
        after=("cross_band", "cross_scan"),
        alike=NO_STATUS,
    ),
    "cross_scan": Move(
        SIMULATED
        + "ERR_DBW = 6; SV - PV = 10, 4, 3 for 2 CYCLEs each; right after an execution -1 for 50 ms, and back to 2 "
        "before the next, 4 CYCLEs; a long CYCLE makes it easy",
        after=("cross_band",),
        alike=NO_STATUS,
    ),
    "pv_word": Move("some executions with a moving PV"),
    "cycle_change": Move(SLOW + "a CYCLE of a fifth, 3 CYCLEs"),
    "mout_scan": Move(
        "with a CYCLE of 1 to 2 s and pictures faster than half a scan, automatic, MOUT_AUTO on: another MOUT right "
        "after an execution, three times"
    ),
    "run_off_manual": Move(
        "with a CYCLE of 2 s, SV - PV not 0: PID_MAN on, PID_RUN off, PID_MAN off, PID_RUN on, 2 CYCLEs each; then "
        "PID_RUN off, PID_MAN on, and between two executions PID_MAN off and PID_RUN on",
        after=("transfer",),
        alike=NO_TRANSFER,
    ),
    "preset_mv": Move(
        "with a CYCLE of 2 s: PID_MAN on for 2 CYCLEs, then between two executions another MOUT and PID_MAN off",
        after=("transfer",),
        alike=NO_TRANSFER,
    ),
}
