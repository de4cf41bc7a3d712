"""The axes on which the manual is silent, each value named; a dialect is a value, kept in the profile.

Enums are integers and every default is 0: the law asks `if dialect.axis:` and computes the default straight through.
The law reads an axis only where it makes a difference, so that what was not read is known to be open.
What each value means, and what brings it to light, stands in `dialect_axes`.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class Freeze(IntEnum):
    """What the integral does beyond a limit (spec A.8/4, ah500 A4)."""

    ALWAYS = 0
    OUTWARD = 1
    NEVER = 2
    BACK_CALCULATED = 3
    PREVIOUS_MV = 4


class RunOff(IntEnum):
    """What PID_RUN = FALSE does to the integral (spec A.8/6, ah500 A13)."""

    KEEP = 0
    CLEAR = 1


class FirstCall(IntEnum):
    """When the very first execution is due (spec A.8/13, ah500 A14)."""

    AT_ONCE = 0
    AFTER_CYCLE = 1


class Direction(IntEnum):
    """Which way PID_DIR acts (ah500 1.8, A26)."""

    AS_NAMED = 0
    INVERTED = 1


class Band(IntEnum):
    """DPID's dead band (ah500 A10)."""

    ZEROED = 0
    SHIFTED = 1
    MV_ZERO = 2
    OFF = 3


class BandEdge(IntEnum):
    """Whether an error of just ERR_DBW is inside DPID's band (ah500 A10)."""

    INCLUSIVE = 0
    STRICT = 1


class CrossBand(IntEnum):
    """DPIDE's dead band (ah500 1.6)."""

    ZERO_CROSS = 0
    PLAIN = 1
    OFF = 2


class CrossEdge(IntEnum):
    """Whether an error of just ERR_DBW is inside DPIDE's band (ah500 A10)."""

    STRICT = 0
    INCLUSIVE = 1


class CrossTouch(IntEnum):
    """Whether an error of exactly 0 counts as passing SV (spec B.5/2, ah500 A11)."""

    COUNTS = 0
    IGNORED = 1


class CrossManual(IntEnum):
    """What manual does to the cross status (ah500 A11)."""

    KEPT = 0
    CLEARED = 1


class CrossD(IntEnum):
    """What D sees while PV has passed SV, with PID_DE off (ah500 A12)."""

    ZEROED = 0
    SUPPRESSED = 1
    TRUE_ERROR = 2


class TsSource(IntEnum):
    """Which interval the instruction computes with (ah500 1.4, A19)."""

    NOMINAL = 0
    MS = 1
    TENTH_MS = 2
    MICROSECOND = 3


class TsUnit(IntEnum):
    """In what unit the interval stands in the formulas (ah500 A1)."""

    SECONDS = 0
    COUNTS = 1
    LEFT_OUT = 2
    TEN_MS = 3
    HUNDRED_MS = 4


class TsScale(IntEnum):
    """How a count becomes seconds (ah500 A22)."""

    DIVIDED = 0
    MULTIPLIED = 1


class Integrator(IntEnum):
    """Integration rule (spec A.8/2, ah500 A3)."""

    RECTANGLE = 0
    TRAPEZOID = 1
    PREVIOUS = 2
    DVP = 3


class IntegralStore(IntEnum):
    """What I_MV+0 holds (spec A.8/1, ah500 A2)."""

    TERM = 0
    SUM = 1
    WITHOUT_KC = 2


class IntegralUsed(IntEnum):
    """Whether the output takes the integral after or before its update (ah500 A3)."""

    NEW = 0
    OLD = 1


class Product(IntEnum):
    """Order of K times E times Ts."""

    KE_TS = 0
    K_ETS = 1
    KTS_E = 2


class Ratio(IntEnum):
    """Dependent form: what is divided by Ti."""

    PRODUCT = 0
    GAIN = 1


class DependentSum(IntEnum):
    """Dependent form of the sum."""

    DISTRIBUTED = 0
    FACTORED = 1


class DerivativeOf(IntEnum):
    """What DPID differentiates (ah500 A6)."""

    ERROR = 0
    PV = 1


class DerivativeProduct(IntEnum):
    """Order inside D."""

    GAIN_FIRST = 0
    SLOPE_FIRST = 1
    RATIO_FIRST = 2


class Filter(IntEnum):
    """How Tf smooths D (spec B.5/1, ah500 A8)."""

    BACKWARD = 0
    FORWARD = 1
    TUSTIN = 2
    ALPHA = 3
    EXACT = 4
    IGNORED = 5


class FilterContent(IntEnum):
    """What the filter remembers (ah500 A8)."""

    TERM = 0
    SLOPE = 1
    INPUT = 2


class TfUnit(IntEnum):
    """Tf in the dependent form (ah500 A9)."""

    SECONDS = 0
    OF_TD = 1


class FirstHistory(IntEnum):
    """What D sees at the first execution (ah500 A14)."""

    FRESH = 0
    STALE = 1


class SumOrder(IntEnum):
    """Order of P, I and D in the sum (ah500 A22)."""

    PI_D = 0
    P_ID = 1
    PD_I = 2


class BiasJoins(IntEnum):
    """Where BIAS joins the sum of two, a pair and one outside (ah500 A22)."""

    LAST = 0
    PAIR = 1
    OUTER = 2
    FIRST = 3
    SECOND = 4


class FreezeTest(IntEnum):
    """What is held against the limits to freeze (ah500 A5)."""

    TOTAL = 0
    WITHOUT_D = 1


class LimitEdge(IntEnum):
    """Whether exactly at a limit counts as beyond (ah500 A5)."""

    BEYOND = 0
    AT = 1


class LimitedOutput(IntEnum):
    """The output when only the last increment went beyond (spec A.8/3)."""

    LIMIT = 0
    RECOMPUTED = 1


class Limits(IntEnum):
    """MV_MAX below MV_MIN (ah500 A20)."""

    EXCHANGED = 0
    WRITTEN_BACK = 1
    AS_WRITTEN = 2


class Clamped(IntEnum):
    """Operands out of range (ah500 A20)."""

    INTERNAL = 0
    WRITTEN_BACK = 1


class KiOff(IntEnum):
    """What an integral gain of 0 does (ah500 A21)."""

    ZEROED = 0
    KEPT = 1
    HELD = 2


class KcOff(IntEnum):
    """What Kc = 0 switches off in the dependent form (ah500 A21)."""

    ALL = 0
    P_ONLY = 1


class RunOffHistory(IntEnum):
    """What PID_RUN = FALSE does to the history (ah500 A13)."""

    FORGOTTEN = 0
    KEPT = 1
    TRACKED = 2


class RunOffFilter(IntEnum):
    """What PID_RUN = FALSE does to D's filter and the cross status (spec B.3)."""

    CLEARED = 0
    KEPT = 1


class RunOffMout(IntEnum):
    """What PID_RUN = FALSE does to MOUT under MOUT_AUTO (ah500 A13)."""

    KEPT = 0
    FOLLOWS = 1


class RunOffScan(IntEnum):
    """When PID_RUN = FALSE acts (spec A.8/11)."""

    WHEN_DUE = 0
    EVERY_SCAN = 1


class RunOn(IntEnum):
    """When the first execution after PID_RUN rises is due (ah500 A14)."""

    GOES_ON = 0
    AT_ONCE = 1
    AFTER_CYCLE = 2


class EnOffTime(IntEnum):
    """Whether time counts while EN is off (spec A.8/12)."""

    STANDS = 0
    RUNS = 1


class EnOnHistory(IntEnum):
    """What EN off does to the history (spec A.8/8)."""

    KEPT = 0
    FORGOTTEN = 1


class StopHistory(IntEnum):
    """What the PLC's STOP does to the history."""

    KEPT = 0
    FORGOTTEN = 1


class ManualIntegral(IntEnum):
    """The integral in manual (spec A.8/5, ah500 A15, A16)."""

    HELD = 0
    RUNS = 1
    TRACKS = 2


class ManualHistory(IntEnum):
    """The history of E and PV in manual (spec A.8/7)."""

    TRACKED = 0
    HELD = 1


class ManualFilter(IntEnum):
    """D's filter in manual (spec B.5/4)."""

    RUNS = 0
    HELD = 1
    CLEARED = 2


class ManualRefresh(IntEnum):
    """When MV follows MOUT in manual (ah500 A18)."""

    EACH_CYCLE = 0
    EACH_SCAN = 1


class MoutAuto(IntEnum):
    """When MOUT_AUTO copies MV (ah500 A17)."""

    AUTOMATIC = 0
    ALWAYS = 1


class Transfer(IntEnum):
    """From manual to automatic in mode 0 (ah500 A15)."""

    BUMPLESS = 0
    DIRECT = 1
    MV_AS_I = 2


class Transfer2(IntEnum):
    """From manual to automatic in mode 2 (spec A.5)."""

    DIRECT = 0
    BUMPLESS = 1


class PresetOrder(IntEnum):
    """Order of the preset's subtraction (ah500 A15)."""

    P_D_BIAS = 0
    SUM = 1
    BIAS_P_D = 2
    D_P_BIAS = 3


class PresetD(IntEnum):
    """Whether the preset takes D off (ah500 A15)."""

    INCLUDED = 0
    LEFT_OUT = 1


class PresetIntegrates(IntEnum):
    """Whether the execution of the transfer integrates too (spec A.3)."""

    NO = 0
    YES = 1


class PresetLimit(IntEnum):
    """Whether the preset is limited (ah500 A15)."""

    FREE = 0
    LIMITED = 1


class Schedule(IntEnum):
    """What an execution that comes late does to the next (ah500 A19)."""

    GRID = 0
    DRIFTING = 1


class BadInput(IntEnum):
    """What an SV, PV, MOUT or BIAS that is no number does (ah500 A23)."""

    HELD = 0
    AS_ZERO = 1
    PROPAGATED = 2


class FormChange(IntEnum):
    """What D sees when PID_DIR, PID_EQ or PID_DE has changed since the last execution (ah500 A24)."""

    KEPT = 0
    RESET = 1
    TURNED = 2
    ONE_CELL = 3


class FormIntegral(IntEnum):
    """What a change of PID_EQ does to I_MV (ah500 A24)."""

    KEPT = 0
    RESCALED = 1
    ZEROED = 2


class CrossJump(IntEnum):
    """Whether a jump from outside on one side to inside on the other passes SV (spec B.4)."""

    COUNTS = 0
    IGNORED = 1


class CrossSv(IntEnum):
    """What a change of SV does to the cross status (spec B.5/3, ah500 A11)."""

    KEPT = 0
    CLEARED = 1


class CrossScan(IntEnum):
    """When the cross status is evaluated (ah500 A11)."""

    EACH_CYCLE = 0
    EACH_SCAN = 1


class PvWord(IntEnum):
    """Which double word of I_MV holds the PV of the last execution (ah500 A27)."""

    MANUAL = 0
    DWORD_1 = 1
    DWORD_2 = 2
    DWORD_3 = 3
    DWORD_4 = 4
    DWORD_5 = 5
    DWORD_6 = 6
    DWORD_7 = 7
    DWORD_8 = 8
    DWORD_9 = 9


class CycleChange(IntEnum):
    """When a CYCLE written in the middle of an interval counts (ah500 A19)."""

    AT_ONCE = 0
    NEXT = 1


class MoutScan(IntEnum):
    """When MOUT_AUTO copies MV into MOUT (ah500 A17)."""

    EACH_EXECUTION = 0
    EACH_SCAN = 1


class RunOffManual(IntEnum):
    """What PID_RUN = FALSE does to the memory that manual came before (spec A.8/9)."""

    KEPT = 0
    FORGOTTEN = 1
    TRACKED = 2


class PresetMv(IntEnum):
    """The MV from which automatic goes on after manual (spec A.8/10, ah500 A15)."""

    REGISTER = 0
    MOUT = 1


class Dialect(NamedTuple):
    """One way to discretise the manual's formulas; `dialect_axes` says what each axis and value means."""

    freeze: Freeze = Freeze.ALWAYS
    run_off: RunOff = RunOff.KEEP
    first_call: FirstCall = FirstCall.AT_ONCE
    direction: Direction = Direction.AS_NAMED
    band: Band = Band.ZEROED
    band_edge: BandEdge = BandEdge.INCLUSIVE
    cross_band: CrossBand = CrossBand.ZERO_CROSS
    cross_edge: CrossEdge = CrossEdge.STRICT
    cross_touch: CrossTouch = CrossTouch.COUNTS
    cross_manual: CrossManual = CrossManual.KEPT
    cross_d: CrossD = CrossD.ZEROED
    ts_source: TsSource = TsSource.NOMINAL
    ts_unit: TsUnit = TsUnit.SECONDS
    ts_scale: TsScale = TsScale.DIVIDED
    integrator: Integrator = Integrator.RECTANGLE
    integral_store: IntegralStore = IntegralStore.TERM
    integral_used: IntegralUsed = IntegralUsed.NEW
    product: Product = Product.KE_TS
    ratio: Ratio = Ratio.PRODUCT
    dependent_sum: DependentSum = DependentSum.DISTRIBUTED
    derivative_of: DerivativeOf = DerivativeOf.ERROR
    derivative_product: DerivativeProduct = DerivativeProduct.GAIN_FIRST
    filter: Filter = Filter.BACKWARD
    filter_content: FilterContent = FilterContent.TERM
    tf_unit: TfUnit = TfUnit.SECONDS
    first_history: FirstHistory = FirstHistory.FRESH
    sum_order: SumOrder = SumOrder.PI_D
    bias_joins: BiasJoins = BiasJoins.LAST
    freeze_test: FreezeTest = FreezeTest.TOTAL
    limit_edge: LimitEdge = LimitEdge.BEYOND
    limited_output: LimitedOutput = LimitedOutput.LIMIT
    limits: Limits = Limits.EXCHANGED
    clamped: Clamped = Clamped.INTERNAL
    ki_off: KiOff = KiOff.ZEROED
    kc_off: KcOff = KcOff.ALL
    run_off_history: RunOffHistory = RunOffHistory.FORGOTTEN
    run_off_filter: RunOffFilter = RunOffFilter.CLEARED
    run_off_mout: RunOffMout = RunOffMout.KEPT
    run_off_scan: RunOffScan = RunOffScan.WHEN_DUE
    run_on: RunOn = RunOn.GOES_ON
    en_off_time: EnOffTime = EnOffTime.STANDS
    en_on_history: EnOnHistory = EnOnHistory.KEPT
    stop_history: StopHistory = StopHistory.KEPT
    manual_integral: ManualIntegral = ManualIntegral.HELD
    manual_history: ManualHistory = ManualHistory.TRACKED
    manual_filter: ManualFilter = ManualFilter.RUNS
    manual_refresh: ManualRefresh = ManualRefresh.EACH_CYCLE
    mout_auto: MoutAuto = MoutAuto.AUTOMATIC
    transfer: Transfer = Transfer.BUMPLESS
    transfer_2: Transfer2 = Transfer2.DIRECT
    preset_order: PresetOrder = PresetOrder.P_D_BIAS
    preset_d: PresetD = PresetD.INCLUDED
    preset_integrates: PresetIntegrates = PresetIntegrates.NO
    preset_limit: PresetLimit = PresetLimit.FREE
    schedule: Schedule = Schedule.GRID
    bad_input: BadInput = BadInput.HELD
    form_change: FormChange = FormChange.KEPT
    form_integral: FormIntegral = FormIntegral.KEPT
    cross_jump: CrossJump = CrossJump.COUNTS
    cross_sv: CrossSv = CrossSv.KEPT
    cross_scan: CrossScan = CrossScan.EACH_CYCLE
    pv_word: PvWord = PvWord.MANUAL
    cycle_change: CycleChange = CycleChange.AT_ONCE
    mout_scan: MoutScan = MoutScan.EACH_EXECUTION
    run_off_manual: RunOffManual = RunOffManual.KEPT
    preset_mv: PresetMv = PresetMv.REGISTER


DEFAULT = Dialect()

AXES: dict[str, type[IntEnum]] = {name: type(value) for name, value in DEFAULT._asdict().items()}
"""Axis name in a profile to its enum; a value is written in lower case, `freeze = "outward"`."""
