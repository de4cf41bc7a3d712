"""What each axis of a dialect means, for people: its values and its instructions; `dialect_moves` brings it to light.

This file decides no arithmetic. Pages, `explain`, `identify` and messages are made from its table.
The MANUAL is silent on all of them; the candidates stand in spec ah500 §2, controllers §1.1, A.8 and B.5.
"""

from __future__ import annotations

from dataclasses import dataclass

from ahgateway.core.dialect import AXES
from ahgateway.core.dialect_moves import MOVES, Alike


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
        after: Axes that have to be decided before; while they are open this one's values look alike.
        alike: Where its values cannot be told apart, whatever an operator does.
    """

    name: str
    question: str
    values: tuple[str, ...]
    instructions: str
    group: str
    excitation: str
    after: tuple[str, ...] = ()
    alike: tuple[Alike, ...] = ()

    def concerns(self, instruction: str) -> bool:
        """Tell whether an instruction has this question at all."""
        return self.instructions in ("both", instruction)

    def unseen(self) -> tuple[str, ...]:
        """Say where its values cannot be told apart, a phrase for each."""
        found = []
        for rule in self.alike:
            own = " and ".join(value_name(self.name, value) for value in rule.own) or "all values"
            held = " and ".join(
                f"{name} = {' or '.join(value_name(name, value) for value in values)}"
                for name, values in rule.given.items()
                if not rule.instruction or BY_NAME[name].concerns(rule.instruction)
            )
            found.append(f"{own} are the same{' on a ' + rule.instruction if rule.instruction else ''} with {held}")
        return tuple(found)


def _axis(name: str, question: str, values: tuple[str, ...], instructions: str, group: str) -> Axis:
    """One row of the table, with what tells its values apart."""
    move = MOVES[name]
    return Axis(name, question, values, instructions, group, move.text, move.after, move.alike)


TABLE: tuple[Axis, ...] = (
    _axis(
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
    ),
    _axis(
        "run_off",
        "What PID_RUN = FALSE does to the integral (spec A.8/6, ah500 A13)",
        ("kept", "set to 0"),
        "both",
        "run",
    ),
    _axis(
        "first_call",
        "When the very first execution is due (spec A.8/13, ah500 A14)",
        ("at the first call", "after one CYCLE"),
        "both",
        "schedule",
    ),
    _axis(
        "direction",
        "Which way PID_DIR acts (ah500 1.8, A26)",
        ("TRUE: E = SV - PV", "TRUE: E = PV - SV"),
        "both",
        "error",
    ),
    _axis(
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
    ),
    _axis(
        "band_edge",
        "Whether an error of just ERR_DBW is inside DPID's band (ah500 A10)",
        ("inside", "outside"),
        "DPID",
        "error",
    ),
    _axis(
        "cross_band",
        "DPIDE's dead band (ah500 1.6)",
        ("E is 0 once PV has passed SV inside", "E is 0 anywhere inside", "ERR_DBW does nothing"),
        "DPIDE",
        "error",
    ),
    _axis(
        "cross_edge",
        "Whether an error of just ERR_DBW is inside DPIDE's band (ah500 A10)",
        ("outside", "inside"),
        "DPIDE",
        "error",
    ),
    _axis(
        "cross_touch",
        "Whether an error of exactly 0 counts as passing SV (spec B.5/2, ah500 A11)",
        ("counts", "does not count"),
        "DPIDE",
        "error",
    ),
    _axis(
        "cross_manual",
        "What manual does to the cross status (ah500 A11)",
        ("nothing", "clears it"),
        "DPIDE",
        "error",
    ),
    _axis(
        "cross_d",
        "What D sees while PV has passed SV, with PID_DE off (ah500 A12)",
        ("the error that counts, with a step at setting and leaving", "no change", "the true error"),
        "DPIDE",
        "derivative",
    ),
    _axis(
        "ts_source",
        "Which interval the instruction computes with (ah500 1.4, A19)",
        ("CYCLE", "the measured one in whole ms", "the measured one in whole 0.1 ms", "the measured one in whole µs"),
        "both",
        "ts",
    ),
    _axis(
        "ts_unit",
        "In what unit the interval stands in the formulas (ah500 A1)",
        ("s", "the count itself", "it is left out, as if it were 1", "10 ms", "100 ms"),
        "both",
        "ts",
    ),
    _axis(
        "ts_scale",
        "How a count becomes seconds (ah500 A22)",
        ("divided by 100, 1000 …", "multiplied by 0.01, 0.001 … as REAL"),
        "both",
        "ts",
    ),
    _axis(
        "integrator",
        "Integration rule (spec A.8/2, ah500 A3)",
        ("this E", "the mean of this E and the last", "the last E", "old DVP: (I + E) times Ts"),
        "both",
        "integral",
    ),
    _axis(
        "integral_store",
        "What I_MV+0 holds (spec A.8/1, ah500 A2)",
        ("the term, in MV's unit", "the sum of E times Ts", "dependent form: the term without Kc"),
        "both",
        "integral",
    ),
    _axis(
        "integral_used",
        "Whether the output takes the integral after or before its update (ah500 A3)",
        ("after", "before"),
        "both",
        "sum",
    ),
    _axis(
        "product",
        "Order of K times E times Ts",
        ("(K*E)*Ts", "K*(E*Ts)", "(K*Ts)*E"),
        "both",
        "integral",
    ),
    _axis(
        "ratio",
        "Dependent form: what is divided by Ti",
        ("the product: (Kc*E*Ts)/Ti", "the gain: (Kc/Ti)*E*Ts"),
        "DPIDE",
        "integral",
    ),
    _axis(
        "dependent_sum",
        "Dependent form of the sum",
        ("Kc in every term", "Kc times the bracket; an integral kept in MV's unit stays outside"),
        "DPIDE",
        "sum",
    ),
    _axis(
        "derivative_of",
        "What DPID differentiates (ah500 A6)",
        ("E", "PV, with the sign of the direction"),
        "DPID",
        "derivative",
    ),
    _axis(
        "derivative_product",
        "Order inside D",
        ("(Kd*change)/Ts", "Kd*(change/Ts)", "(Kd/Ts)*change"),
        "both",
        "derivative",
    ),
    _axis(
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
    ),
    _axis(
        "filter_content",
        "What the filter remembers (ah500 A8)",
        (
            "the D term, gain included",
            "the slope; the gain comes behind it",
            "what is differentiated: E or PV, smoothed",
        ),
        "DPIDE",
        "derivative",
    ),
    _axis(
        "tf_unit",
        "Tf in the dependent form (ah500 A9)",
        ("s", "a fraction of Td"),
        "DPIDE",
        "derivative",
    ),
    _axis(
        "first_history",
        "What D sees at the first execution (ah500 A14)",
        ("no change", "the change since what was last remembered, 0 after power-up"),
        "both",
        "derivative",
    ),
    _axis(
        "sum_order",
        "Order of P, I and D in the sum (ah500 A22)",
        ("(P+I)+D", "P+(I+D)", "(P+D)+I"),
        "both",
        "sum",
    ),
    _axis(
        "bias_joins",
        "Where BIAS joins the sum of two, a pair and one outside (ah500 A22)",
        ("at the end", "the pair's sum", "the one outside", "the pair's first", "the pair's second"),
        "DPIDE",
        "sum",
    ),
    _axis(
        "freeze_test",
        "What is held against the limits to freeze (ah500 A5)",
        ("the whole sum", "the sum without D"),
        "both",
        "limit",
    ),
    _axis(
        "limit_edge",
        "Whether exactly at a limit counts as beyond (ah500 A5)",
        ("no", "yes"),
        "both",
        "limit",
    ),
    _axis(
        "limited_output",
        "The output when only the last increment went beyond (spec A.8/3)",
        ("the limit", "the sum with the integral that stood still"),
        "both",
        "limit",
    ),
    _axis(
        "limits",
        "MV_MAX below MV_MIN (ah500 A20)",
        ("exchanged inside", "exchanged in the registers too", "not exchanged"),
        "both",
        "limit",
    ),
    _axis(
        "clamped",
        "Operands out of range (ah500 A20)",
        ("count as clamped inside", "are clamped in the registers too"),
        "both",
        "schedule",
    ),
    _axis(
        "ki_off",
        "What an integral gain of 0 does (ah500 A21)",
        ("the integral is set to 0", "I_MV stays, the term is 0", "I_MV stays and counts"),
        "both",
        "sum",
    ),
    _axis(
        "kc_off",
        "What Kc = 0 switches off in the dependent form (ah500 A21)",
        ("the whole bracket", "P; I stays and D runs out"),
        "DPIDE",
        "sum",
    ),
    _axis(
        "run_off_history",
        "What PID_RUN = FALSE does to the history (ah500 A13)",
        (
            "the next execution starts anew",
            "the next execution sees the change since the last",
            "PV and E go on being recorded",
        ),
        "both",
        "run",
    ),
    _axis(
        "run_off_filter",
        "What PID_RUN = FALSE does to D's filter and the cross status (spec B.3)",
        ("cleared", "kept"),
        "DPIDE",
        "run",
    ),
    _axis(
        "run_off_mout",
        "What PID_RUN = FALSE does to MOUT under MOUT_AUTO (ah500 A13)",
        ("kept", "follows MV to 0"),
        "both",
        "run",
    ),
    _axis(
        "run_off_scan",
        "When PID_RUN = FALSE acts (spec A.8/11)",
        ("when an execution is due", "at the next scan"),
        "both",
        "schedule",
    ),
    _axis(
        "run_on",
        "When the first execution after PID_RUN rises is due (ah500 A14)",
        ("the schedule goes on", "at once", "after one CYCLE"),
        "both",
        "schedule",
    ),
    _axis(
        "en_off_time",
        "Whether time counts while EN is off (spec A.8/12)",
        ("no", "yes"),
        "both",
        "schedule",
    ),
    _axis(
        "en_on_history",
        "What EN off does to the history (spec A.8/8)",
        ("kept", "the next execution starts anew"),
        "both",
        "run",
    ),
    _axis(
        "stop_history",
        "What the PLC's STOP does to the history",
        ("kept", "the next execution starts anew"),
        "both",
        "run",
    ),
    _axis(
        "manual_integral",
        "The integral in manual (spec A.8/5, ah500 A15, A16)",
        ("stands", "goes on", "follows the manual MV"),
        "both",
        "manual",
    ),
    _axis(
        "manual_history",
        "The history of E and PV in manual (spec A.8/7)",
        ("goes on", "stands"),
        "both",
        "manual",
    ),
    _axis(
        "manual_filter",
        "D's filter in manual (spec B.5/4)",
        ("goes on", "stands", "is cleared"),
        "DPIDE",
        "manual",
    ),
    _axis(
        "manual_refresh",
        "When MV follows MOUT in manual (ah500 A18)",
        ("at each execution", "at each scan"),
        "both",
        "schedule",
    ),
    _axis(
        "mout_auto",
        "When MOUT_AUTO copies MV (ah500 A17)",
        ("in automatic", "in manual too"),
        "both",
        "manual",
    ),
    _axis(
        "transfer",
        "From manual to automatic in mode 0 (ah500 A15)",
        ("the integral is set so that MV goes on", "the integral is taken as it stands", "the integral becomes MV"),
        "both",
        "transfer",
    ),
    _axis(
        "transfer_2",
        "From manual to automatic in mode 2 (spec A.5)",
        ("the integral is taken as it stands", "as in mode 0"),
        "DPID",
        "transfer",
    ),
    _axis(
        "preset_order",
        "Order of the preset's subtraction (ah500 A15)",
        ("((MV-P)-D)-BIAS", "MV-((P+D)+BIAS)", "((MV-BIAS)-P)-D", "((MV-D)-P)-BIAS"),
        "both",
        "transfer",
    ),
    _axis(
        "preset_d",
        "Whether the preset takes D off (ah500 A15)",
        ("yes", "no"),
        "both",
        "transfer",
    ),
    _axis(
        "preset_integrates",
        "Whether the execution of the transfer integrates too (spec A.3)",
        ("no: MV stands", "yes"),
        "both",
        "transfer",
    ),
    _axis(
        "preset_limit",
        "Whether the preset is limited (ah500 A15)",
        ("no", "to MV_MIN … MV_MAX"),
        "both",
        "transfer",
    ),
    _axis(
        "schedule",
        "What an execution that comes late does to the next (ah500 A19)",
        ("the excess is carried over", "the time starts again at 0"),
        "both",
        "schedule",
    ),
    _axis(
        "bad_input",
        "What an SV, PV, MOUT or BIAS that is no number does (ah500 A23)",
        ("the execution changes nothing", "it counts as 0", "it is computed with, and what comes of it stays"),
        "both",
        "error",
    ),
    _axis(
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
    ),
    _axis(
        "form_integral",
        "What a change of PID_EQ does to I_MV (ah500 A24)",
        ("nothing", "it is scaled so that the term stays", "it is set to 0"),
        "DPIDE",
        "integral",
    ),
    _axis(
        "cross_jump",
        "Whether a jump from outside on one side to inside on the other passes SV (spec B.4)",
        ("yes", "no, PV must have been inside before"),
        "DPIDE",
        "error",
    ),
    _axis(
        "cross_sv",
        "What a change of SV does to the cross status (spec B.5/3, ah500 A11)",
        ("nothing", "clears it"),
        "DPIDE",
        "error",
    ),
    _axis(
        "cross_scan",
        "When the cross status is evaluated (ah500 A11)",
        ("at each execution", "at each scan"),
        "DPIDE",
        "schedule",
    ),
    _axis(
        "pv_word",
        "Which double word of I_MV holds the PV of the last execution (ah500 A27)",
        (
            "DPID: the second, DPIDE: the seventh",
            *(f"{number} double {'word' if number == 1 else 'words'} behind the first" for number in range(1, 10)),
        ),
        "both",
        "words",
    ),
    _axis(
        "cycle_change",
        "When a CYCLE written in the middle of an interval counts (ah500 A19)",
        ("at once", "from the next interval on"),
        "both",
        "schedule",
    ),
    _axis(
        "mout_scan",
        "When MOUT_AUTO copies MV into MOUT (ah500 A17)",
        ("at each execution", "at each scan"),
        "both",
        "schedule",
    ),
    _axis(
        "run_off_manual",
        "What PID_RUN = FALSE does to the memory that manual came before (spec A.8/9)",
        ("it stays", "it is forgotten: automatic begins without a transfer", "it follows PID_MAN"),
        "both",
        "transfer",
    ),
    _axis(
        "preset_mv",
        "The MV from which automatic goes on, which is 0 right after PID_RUN = FALSE (spec A.8/10, ah500 A15)",
        ("the register of MV", "MOUT, limited"),
        "both",
        "transfer",
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
