"""What each axis of a dialect means, for people: its values, its instructions, and what brings it to light.

This file decides no arithmetic. Pages, `explain`, `identify` and messages are made from its table.
The MANUAL is silent on all of them; the candidates stand in spec ah500 §2, controllers §1.1, A.8 and B.5.
"""

from __future__ import annotations

from dataclasses import dataclass

from ahgateway.core.dialect import AXES


@dataclass(frozen=True, slots=True)
class Axis:
    """One open question.

    Attributes:
        name: As in a profile.
        question: What is open, one phrase.
        values: Meaning of each value in the order of its enum, the default first.
        instructions: Where it matters: `both`, `DPID` or `DPIDE`.
        group: Part of the law: error, ts, integral, derivative, sum, limit, manual, transfer, run, schedule or words.
        excitation: What an operator can do to tell its values apart.
    """

    name: str
    question: str
    values: tuple[str, ...]
    instructions: str
    group: str
    excitation: str

    def concerns(self, instruction: str) -> bool:
        """Tell whether an instruction has this question at all."""
        return self.instructions in ("both", instruction)


TABLE: tuple[Axis, ...] = (
    Axis(
        "freeze",
        "What the integral does beyond a limit (spec A.8/4, ah500 A4)",
        (
            "stands still",
            "stands still only when it would go further out",
            "runs on",
            "is computed back from the limit",
            "stands still when MV already stood at a limit before the execution",
        ),
        "both",
        "integral",
        "drive MV into a limit and back out of it by SV; then write MV_MAX below I_MV and let SV - PV change its sign",
    ),
    Axis(
        "run_off",
        "What PID_RUN = FALSE does to the integral (spec A.8/6, ah500 A13)",
        ("kept", "set to 0"),
        "both",
        "run",
        "switch PID_RUN off and on while I_MV is not 0",
    ),
    Axis(
        "first_call",
        "When the very first execution is due (spec A.8/13, ah500 A14)",
        ("at the first call", "after one CYCLE"),
        "both",
        "schedule",
        "no picture shows it: see after a power-up whether MV moves at once or after one CYCLE",
    ),
    Axis(
        "direction",
        "Which way PID_DIR acts (ah500 1.8, A26)",
        ("TRUE: E = SV - PV", "TRUE: E = PV - SV"),
        "both",
        "error",
        "any execution with SV and PV apart",
    ),
    Axis(
        "band",
        "DPID's dead band (ah500 A10)",
        (
            "E is 0 inside and itself outside",
            "outside, E is less by the band",
            "inside, the output is 0 and nothing is integrated",
            "ERR_DBW does nothing",
        ),
        "DPID",
        "error",
        "set ERR_DBW and let PV pass its edge both ways",
    ),
    Axis(
        "band_edge",
        "Whether an error of just ERR_DBW is inside DPID's band (ah500 A10)",
        ("inside", "outside"),
        "DPID",
        "error",
        "let SV - PV be exactly ERR_DBW",
    ),
    Axis(
        "cross_band",
        "DPIDE's dead band (ah500 1.6)",
        ("E is 0 once PV has passed SV inside", "E is 0 anywhere inside", "ERR_DBW does nothing"),
        "DPIDE",
        "error",
        "set ERR_DBW and let PV enter the band from outside",
    ),
    Axis(
        "cross_edge",
        "Whether an error of just ERR_DBW is inside DPIDE's band (ah500 A10)",
        ("outside", "inside"),
        "DPIDE",
        "error",
        "let SV - PV be exactly ERR_DBW while PV has passed SV",
    ),
    Axis(
        "cross_touch",
        "Whether an error of exactly 0 counts as passing SV (spec B.5/2, ah500 A11)",
        ("counts", "does not count"),
        "DPIDE",
        "error",
        "let PV be exactly SV inside the band and turn back",
    ),
    Axis(
        "cross_manual",
        "What manual does to the cross status (ah500 A11)",
        ("nothing", "clears it"),
        "DPIDE",
        "error",
        "switch PID_MAN on and off inside the band with PV past SV",
    ),
    Axis(
        "cross_d",
        "What D sees while PV has passed SV, with PID_DE off (ah500 A12)",
        ("the error that counts, with a step at setting and leaving", "no change", "the true error"),
        "DPIDE",
        "derivative",
        "set ERR_DBW, Td_Kd > 0, PID_DE off, and let PV pass SV inside the band",
    ),
    Axis(
        "ts_source",
        "Which interval the instruction computes with (ah500 1.4, A19)",
        ("CYCLE", "the measured one in whole ms", "the measured one in whole 0.1 ms", "the measured one in whole µs"),
        "both",
        "ts",
        "choose CYCLE so that it is no multiple of the scan time",
    ),
    Axis(
        "ts_unit",
        "In what unit the interval stands in the formulas (ah500 A1)",
        ("s", "the count itself", "it is left out, as if it were 1", "10 ms", "100 ms"),
        "both",
        "ts",
        "executions with Ki above 0 and a CYCLE that is neither 10 nor 100 ms",
    ),
    Axis(
        "ts_scale",
        "How a count becomes seconds (ah500 A22)",
        ("divided by 100, 1000 …", "multiplied by 0.01, 0.001 … as REAL"),
        "both",
        "ts",
        "a CYCLE such as 7 or 13, for which the two differ in the last bit",
    ),
    Axis(
        "integrator",
        "Integration rule (spec A.8/2, ah500 A3)",
        ("this E", "the mean of this E and the last", "the last E", "old DVP: (I + E) times Ts"),
        "both",
        "integral",
        "any two executions with different E",
    ),
    Axis(
        "integral_store",
        "What I_MV+0 holds (spec A.8/1, ah500 A2)",
        ("the term, in MV's unit", "the sum of E times Ts", "dependent form: the term without Kc"),
        "both",
        "integral",
        "Ki other than 1; in the dependent form Kc other than 1",
    ),
    Axis(
        "integral_used",
        "Whether the output takes the integral after or before its update (ah500 A3)",
        ("after", "before"),
        "both",
        "sum",
        "any execution with E not 0",
    ),
    Axis(
        "product",
        "Order of K times E times Ts",
        ("(K*E)*Ts", "K*(E*Ts)", "(K*Ts)*E"),
        "both",
        "integral",
        "executions with odd values, some dozens",
    ),
    Axis(
        "ratio",
        "Dependent form: what is divided by Ti",
        ("the product: (Kc*E*Ts)/Ti", "the gain: (Kc/Ti)*E*Ts"),
        "DPIDE",
        "integral",
        "PID_EQ on and a Ti that is no power of 2",
    ),
    Axis(
        "dependent_sum",
        "Dependent form of the sum",
        ("Kc in every term", "Kc times the bracket; an integral kept in MV's unit stays outside"),
        "DPIDE",
        "sum",
        "PID_EQ on and Kc other than a power of 2",
    ),
    Axis(
        "derivative_of",
        "What DPID differentiates (ah500 A6)",
        ("E", "PV, with the sign of the direction"),
        "DPID",
        "derivative",
        "step SV with Kd above 0",
    ),
    Axis(
        "derivative_product",
        "Order inside D",
        ("(Kd*change)/Ts", "Kd*(change/Ts)", "(Kd/Ts)*change"),
        "both",
        "derivative",
        "executions with odd values and a D about as large as P",
    ),
    Axis(
        "filter",
        "How Tf smooths D (spec B.5/1, ah500 A8)",
        (
            "backward Euler",
            "forward Euler, d + (Ts/Tf)*(slope - d)",
            "trapezoid",
            "d + (Ts/(Tf+Ts))*(slope - d)",
            "exp(-Ts/Tf)",
            "not at all",
        ),
        "DPIDE",
        "derivative",
        "Tf and Td_Kd above 0 and a moving PV",
    ),
    Axis(
        "filter_content",
        "What the filter remembers (ah500 A8)",
        (
            "the D term, gain included",
            "the slope; the gain comes behind it",
            "what is differentiated: E or PV, smoothed",
        ),
        "DPIDE",
        "derivative",
        "change Td_Kd while D is not 0",
    ),
    Axis(
        "tf_unit",
        "Tf in the dependent form (ah500 A9)",
        ("s", "a fraction of Td"),
        "DPIDE",
        "derivative",
        "PID_EQ on, Tf above 0 and Td other than 1",
    ),
    Axis(
        "first_history",
        "What D sees at the first execution (ah500 A14)",
        ("no change", "the change since what was last remembered, 0 after power-up"),
        "both",
        "derivative",
        "switch PID_RUN off and on while PV moves, with the D gain above 0; there it looks like run_off_history",
    ),
    Axis(
        "sum_order",
        "Order of P, I and D in the sum (ah500 A22)",
        ("(P+I)+D", "P+(I+D)", "(P+D)+I"),
        "both",
        "sum",
        "some dozens of executions with P, I and D not 0",
    ),
    Axis(
        "bias_joins",
        "Where BIAS joins the sum of two, a pair and one outside (ah500 A22)",
        ("at the end", "the pair's sum", "the one outside", "the pair's first", "the pair's second"),
        "DPIDE",
        "sum",
        "a BIAS that is not 0",
    ),
    Axis(
        "freeze_test",
        "What is held against the limits to freeze (ah500 A5)",
        ("the whole sum", "the sum without D"),
        "both",
        "limit",
        "let D alone carry the sum over a limit",
    ),
    Axis(
        "limit_edge",
        "Whether exactly at a limit counts as beyond (ah500 A5)",
        ("no", "yes"),
        "both",
        "limit",
        "let the sum be exactly MV_MAX: PV at rest, CYCLE 0.5 s, Ki and the rest sums of powers of 2",
    ),
    Axis(
        "limited_output",
        "The output when only the last increment went beyond (spec A.8/3)",
        ("the limit", "the sum with the integral that stood still"),
        "both",
        "limit",
        "approach a limit by integration alone",
    ),
    Axis(
        "limits",
        "MV_MAX below MV_MIN (ah500 A20)",
        ("exchanged inside", "exchanged in the registers too", "not exchanged"),
        "both",
        "limit",
        "write MV_MAX below MV_MIN",
    ),
    Axis(
        "clamped",
        "Operands out of range (ah500 A20)",
        ("count as clamped inside", "are clamped in the registers too"),
        "both",
        "schedule",
        "write a negative gain or a CYCLE of 0",
    ),
    Axis(
        "ki_off",
        "What an integral gain of 0 does (ah500 A21)",
        ("the integral is set to 0", "I_MV stays, the term is 0", "I_MV stays and counts"),
        "both",
        "sum",
        "set Ki to 0 while I_MV is not 0",
    ),
    Axis(
        "kc_off",
        "What Kc = 0 switches off in the dependent form (ah500 A21)",
        ("the whole bracket", "P; I stays and D runs out"),
        "DPIDE",
        "sum",
        "PID_EQ on, Kc = 0 while I_MV is not 0",
    ),
    Axis(
        "run_off_history",
        "What PID_RUN = FALSE does to the history (ah500 A13)",
        (
            "the next execution starts anew",
            "the next execution sees the change since the last",
            "PV and E go on being recorded",
        ),
        "both",
        "run",
        "switch PID_RUN off and on while PV moves, with Kd above 0",
    ),
    Axis(
        "run_off_filter",
        "What PID_RUN = FALSE does to D's filter and the cross status (spec B.3)",
        ("cleared", "kept"),
        "DPIDE",
        "run",
        "switch PID_RUN off and on with Tf and Td_Kd above 0",
    ),
    Axis(
        "run_off_mout",
        "What PID_RUN = FALSE does to MOUT under MOUT_AUTO (ah500 A13)",
        ("kept", "follows MV to 0"),
        "both",
        "run",
        "switch PID_RUN off twice with MOUT_AUTO on and MOUT not 0",
    ),
    Axis(
        "run_off_scan",
        "When PID_RUN = FALSE acts (spec A.8/11)",
        ("when an execution is due", "at the next scan"),
        "both",
        "schedule",
        "switch PID_RUN off right after an execution, with a CYCLE of seconds",
    ),
    Axis(
        "run_on",
        "When the first execution after PID_RUN rises is due (ah500 A14)",
        ("the schedule goes on", "at once", "after one CYCLE"),
        "both",
        "schedule",
        "switch PID_RUN off and on again some CYCLEs later, halfway between two executions, with a CYCLE of seconds",
    ),
    Axis(
        "en_off_time",
        "Whether time counts while EN is off (spec A.8/12)",
        ("no", "yes"),
        "both",
        "schedule",
        "switch EN off for half a CYCLE of seconds right after an execution; the profile must name `en`",
    ),
    Axis(
        "en_on_history",
        "What EN off does to the history (spec A.8/8)",
        ("kept", "the next execution starts anew"),
        "both",
        "run",
        "switch EN off and on while PV moves, with the D gain above 0, first_history known and `en` in the profile",
    ),
    Axis(
        "stop_history",
        "What the PLC's STOP does to the history",
        ("kept", "the next execution starts anew"),
        "both",
        "run",
        "go to STOP and RUN while PV moves, with the D gain above 0, first_history known and `running` in the profile",
    ),
    Axis(
        "manual_integral",
        "The integral in manual (spec A.8/5, ah500 A15, A16)",
        ("stands", "goes on", "follows the manual MV"),
        "both",
        "manual",
        "stay in manual for some executions with E not 0",
    ),
    Axis(
        "manual_history",
        "The history of E and PV in manual (spec A.8/7)",
        ("goes on", "stands"),
        "both",
        "manual",
        "move PV in manual, then switch to automatic, with Kd above 0",
    ),
    Axis(
        "manual_filter",
        "D's filter in manual (spec B.5/4)",
        ("goes on", "stands", "is cleared"),
        "DPIDE",
        "manual",
        "move PV in manual, then switch to automatic, with Tf and Td_Kd above 0",
    ),
    Axis(
        "manual_refresh",
        "When MV follows MOUT in manual (ah500 A18)",
        ("at each execution", "at each scan"),
        "both",
        "schedule",
        "change MOUT in manual right after an execution, with a CYCLE of seconds",
    ),
    Axis(
        "mout_auto",
        "When MOUT_AUTO copies MV (ah500 A17)",
        ("in automatic", "in manual too"),
        "both",
        "manual",
        "several times a MOUT beyond the limits in manual with MOUT_AUTO on",
    ),
    Axis(
        "transfer",
        "From manual to automatic in mode 0 (ah500 A15)",
        ("the integral is set so that MV goes on", "the integral is taken as it stands", "the integral becomes MV"),
        "both",
        "transfer",
        "switch from manual to automatic in mode 0 with E not 0",
    ),
    Axis(
        "transfer_2",
        "From manual to automatic in mode 2 (spec A.5)",
        ("the integral is taken as it stands", "as in mode 0"),
        "DPID",
        "transfer",
        "switch from manual to automatic in mode 2 with E not 0",
    ),
    Axis(
        "preset_order",
        "Order of the preset's subtraction (ah500 A15)",
        ("((MV-P)-D)-BIAS", "MV-((P+D)+BIAS)", "((MV-BIAS)-P)-D", "((MV-D)-P)-BIAS"),
        "both",
        "transfer",
        "several transfers with P, D and BIAS not 0",
    ),
    Axis(
        "preset_d",
        "Whether the preset takes D off (ah500 A15)",
        ("yes", "no"),
        "both",
        "transfer",
        "a transfer with D not 0",
    ),
    Axis(
        "preset_integrates",
        "Whether the execution of the transfer integrates too (spec A.3)",
        ("no: MV stands", "yes"),
        "both",
        "transfer",
        "a transfer with E not 0",
    ),
    Axis(
        "preset_limit",
        "Whether the preset is limited (ah500 A15)",
        ("no", "to MV_MIN … MV_MAX"),
        "both",
        "transfer",
        "a transfer with a P that is larger than MV_MAX - MV_MIN",
    ),
    Axis(
        "schedule",
        "What an execution that comes late does to the next (ah500 A19)",
        ("the excess is carried over", "the time starts again at 0"),
        "both",
        "schedule",
        "a CYCLE that is no multiple of the scan time, for many executions, with pictures faster than half a scan",
    ),
    Axis(
        "bad_input",
        "What an SV, PV, MOUT or BIAS that is no number does (ah500 A23)",
        ("the execution changes nothing", "it counts as 0", "it is computed with, and what comes of it stays"),
        "both",
        "error",
        "write 0x7FC00000 to SV for some CYCLEs, on a bench",
    ),
    Axis(
        "form_change",
        "What D sees when PID_DIR, PID_EQ or PID_DE has changed since the last execution (ah500 A24)",
        (
            "the change of E or PV as they were recorded",
            "no change",
            "the change, the last E turned to the new PID_DIR",
            "the change against the one word that was differentiated last, E or PV",
        ),
        "both",
        "derivative",
        "switch PID_DIR, then PID_DE, in automatic with the D gain above 0 and SV and PV apart",
    ),
    Axis(
        "form_integral",
        "What a change of PID_EQ does to I_MV (ah500 A24)",
        ("nothing", "it is scaled so that the term stays", "it is set to 0"),
        "DPIDE",
        "integral",
        "switch PID_EQ in automatic while I_MV is not 0",
    ),
    Axis(
        "cross_jump",
        "Whether a jump from outside on one side to inside on the other passes SV (spec B.4)",
        ("yes", "no, PV must have been inside before"),
        "DPIDE",
        "error",
        "let PV jump over SV from outside the band into it, by a step of SV",
    ),
    Axis(
        "cross_sv",
        "What a change of SV does to the cross status (spec B.5/3, ah500 A11)",
        ("nothing", "clears it"),
        "DPIDE",
        "error",
        "change SV by a little while PV has passed SV inside the band",
    ),
    Axis(
        "cross_scan",
        "When the cross status is evaluated (ah500 A11)",
        ("at each execution", "at each scan"),
        "DPIDE",
        "schedule",
        "let PV pass SV and back between two executions, with a CYCLE of seconds",
    ),
    Axis(
        "pv_word",
        "Which double word of I_MV holds the PV of the last execution (ah500 A27)",
        (
            "DPID: the second, DPIDE: the seventh",
            *(f"{number} double {'word' if number == 1 else 'words'} behind the first" for number in range(1, 10)),
        ),
        "both",
        "words",
        "any few executions with a moving PV",
    ),
    Axis(
        "cycle_change",
        "When a CYCLE written in the middle of an interval counts (ah500 A19)",
        ("at once", "from the next interval on"),
        "both",
        "schedule",
        "right after an execution write a much shorter CYCLE than the seconds that it has",
    ),
    Axis(
        "mout_scan",
        "When MOUT_AUTO copies MV into MOUT (ah500 A17)",
        ("at each execution", "at each scan"),
        "both",
        "schedule",
        "with MOUT_AUTO on and a CYCLE of seconds write MOUT often in automatic, with pictures faster than a scan",
    ),
)
"""Every axis, in the order of `Dialect`."""

BY_NAME: dict[str, Axis] = {axis.name: axis for axis in TABLE}


def value_name(axis: str, value: int) -> str:
    """Return how a profile spells a value."""
    return AXES[axis](value).name.lower()


def spelled(dialect: object) -> dict[str, str]:
    """Return the axes of a dialect that differ from the default, as a profile spells them."""
    return {name: value_name(name, value) for name in AXES if (value := int(getattr(dialect, name)))}
