"""The causes of a divergence as published classes: a code, what it claims, and what no data could tell it from.

This file alone gives codes; they are never reused. `causes` decides which one speaks for an execution.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CausePage:
    """One published class of causes.

    Attributes:
        code: `AHG2xx`, stable.
        name: As verdicts spell it.
        title: What is claimed, one phrase.
        meaning: What has happened, in sentences.
        evidence: What has to hold before it is named.
        twins: Names of causes that one execution cannot tell from it, and what would.
        action: What to look at.
    """

    code: str
    name: str
    title: str
    meaning: str
    evidence: str
    twins: str
    action: str


PAGES: tuple[CausePage, ...] = (
    CausePage(
        "AHG251",
        "gain",
        "a gain acts with another size than its register shows",
        "The law reproduces the PLC when one operand is taken larger or smaller, or as 0. Its real size is estimated "
        "with the interval of values that leave the same words; every execution makes the interval narrower.",
        "I_MV and MV come out by bits, or within 16 ULP, with one and the same factor, which lies between 0.2 and 5.",
        "cycle: Ki and CYCLE act alike on I_MV alone; a moving D, or a change of either operand, tells them apart.",
        "Does the program scale or copy the gain? Is it another register than the one in the profile?",
    ),
    CausePage(
        "AHG252",
        "cycle",
        "the interval is not the configured CYCLE",
        "The law reproduces the PLC with another Ts. The real CYCLE is estimated with the interval of values that "
        "leave the same words.",
        "I_MV and MV come out by bits, or within 16 ULP, with one and the same Ts at every execution.",
        "gain: see AHG251. dialect: a clock that measures gives another interval at each execution.",
        "Is the instruction in an interval task? Does the profile's CYCLE point to the right register? "
        "Run `ahgateway identify`: the firmware may compute with the measured interval.",
    ),
    CausePage(
        "AHG253",
        "direction",
        "PID_DIR acts the other way round",
        "E has the opposite sign.",
        "All words come out by bits with PID_DIR inverted.",
        "dialect: `direction = inverted` says the same for every execution.",
        "Look at the bit's address; AH500 and AS name the directions differently, only the formula counts.",
    ),
    CausePage(
        "AHG254",
        "mode-change",
        "the instruction was in another mode than its bits say",
        "PID_MAN or PID_RUN had another value while it executed than in the pictures around it.",
        "All words come out by bits with that bit inverted.",
        "Another bit with the same effect on this execution.",
        "Is the bit written in the same scan by the program, before or behind the instruction?",
    ),
    CausePage(
        "AHG255",
        "stale-pv",
        "the PV of an earlier execution was used",
        "MV follows from a PV that the block no longer records.",
        "All words but the recorded PV come out by bits with the older PV.",
        "A frozen converter whose readings happen to repeat.",
        "Is the analogue input slower than CYCLE? Is PV copied behind the instruction?",
    ),
    CausePage(
        "AHG256",
        "clamp",
        "MV lies outside its limits",
        "The law never leaves MV_MIN and MV_MAX but for the 0 of PID_RUN = FALSE.",
        "MV is above the larger or below the smaller limit.",
        "operand-written: somebody writes MV behind the instruction.",
        "Does the program write MV, or add something behind the limiter?",
    ),
    CausePage(
        "AHG257",
        "dialect",
        "the firmware computes in another dialect",
        "One axis of the dialect, set otherwise, reproduces the PLC. After a firmware update this is the usual cause.",
        "All words come out by bits with one other value of one axis, which is named. "
        "For a measured Ts, I_MV alone does, with another interval each time.",
        "Axes that agree on this execution are all named; later executions thin them out.",
        "Run `ahgateway identify`, and compare the firmware with the one in the profile's evidence.",
    ),
    CausePage(
        "AHG258",
        "operand-written",
        "somebody wrote I_MV between two executions",
        "MV agrees with the integral that is shown, but that integral does not follow from the one before.",
        "All words come out by bits from another I_MV before the execution.",
        "integral: a wrong sum and a write look alike in one execution; a wrong sum repeats itself.",
        "Does the program or another master write or clear I_MV?",
    ),
    CausePage(
        "AHG259",
        "integral",
        "the integral drifts",
        "The increments differ from the law's, while the rest of MV is right.",
        "As AHG258, repeatedly.",
        "operand-written: see AHG258. An axis of the integral would be named as dialect.",
        "Run `ahgateway identify`; look for a missed or additional execution.",
    ),
    CausePage(
        "AHG260",
        "missed-execution",
        "an execution is missing, or one came too early",
        "The words follow from another number of executions than the schedule gives.",
        "One execution fewer or more reproduces them.",
        "cycle: when it repeats, the interval is not CYCLE.",
        "Is the instruction skipped by a jump, or is EN gated? Poll faster than CYCLE.",
    ),
    CausePage(
        "AHG261",
        "torn-picture",
        "some words were read before the execution, others behind it",
        "Every 16-bit half holds what it held before, or what the reference predicts. Pictures are bracketed and torn "
        "ones are read again, so this is left only where the PLC itself copies words at different times.",
        "Each half is an old or a predicted one, and it happens now and then, not at each execution.",
        "operand-written: somebody put the old value back.",
        "Bring the words of the loop within one request; does the program copy the block somewhere else?",
    ),
    CausePage(
        "AHG262",
        "link",
        "the link was gone, or a reply was no answer",
        "Nothing was seen of these executions. They are counted as LINK, apart from every verdict on the PLC.",
        "Time-outs, frames that fail their check, a connection that was closed; `--trace` shows every frame.",
        "none: an execution that was not seen is never judged.",
        "Run `ahgateway doctor`; look at wiring, termination, the adapter's latency and other masters on the line.",
    ),
    CausePage(
        "AHG263",
        "firmware-change",
        "the firmware computes in another dialect since a known moment",
        "Executions were proven in the dialect of the profile; from one execution on another value of an axis, or of "
        "two, reproduces the PLC, and the old one no longer does.",
        "At least 20 informative matches before the first divergence, and every execution since in the new dialect.",
        "dialect: only the history before tells them apart.",
        "Was the firmware or the program changed? Run `ahgateway identify` and write the new dialect into the profile.",
    ),
    CausePage(
        "AHG264",
        "rounding",
        "the last bits differ: the operations round otherwise",
        "Every word is the reference's within a few ULP of its largest term, and no axis of the dialect reproduces it. "
        "So it looks when a firmware computes in binary64, fuses multiply and add, cuts off, or has its own order.",
        "All words lie within 8 ULP of the largest term at nearly every execution, what D is a difference of counted "
        "as its gain carries it, and no dialect explains them all.",
        "gain: a factor nearer to 1 than 0.1 % leaves the same words where the loop is at rest.",
        "Run `ahgateway identify`. If nothing survives, judge with `--ulp`, which never counts as proven.",
    ),
    CausePage(
        "AHG299",
        "unknown",
        "nothing that we know reproduces it",
        "No single change of an operand, a mode or the dialect leaves the words that the PLC wrote.",
        "All other causes were tried and failed.",
        "Two causes at once; an arithmetic outside the family.",
        "Keep the recording. Look at the link first: is the picture bracketed, is the line aligned?",
    ),
)
"""Every class in the order of its code."""

BY_CODE: dict[str, CausePage] = {page.code: page for page in PAGES}
BY_NAME: dict[str, CausePage] = {page.name: page for page in PAGES}


def code_of(cause: str) -> str:
    """Return the code of a cause by its name; that of the unknown one for a name without a page."""
    return BY_NAME.get(cause, BY_CODE["AHG299"]).code
