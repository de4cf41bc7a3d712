"""Causes that no data can tell apart, published as classes; tests hold the judge to them, pages show them.

A member is a cause and what it concerns: `gain Tf`, `dialect filter`. This file alone says which are one.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CauseClass:
    """One class.

    Attributes:
        name: What its members have in common.
        members: Causes with operand or axis.
        why: Why no recording separates them, one sentence.
        ask: What a person can look at to know, one sentence.
    """

    name: str
    members: tuple[str, ...]
    why: str
    ask: str


CLASSES: tuple[CauseClass, ...] = (
    CauseClass(
        "sign",
        ("direction PID_DIR", "dialect direction"),
        "a bit read inverted and a firmware that takes it inverted give E the same sign at every execution",
        "compare the formula in the manual of that firmware with the bit's address in the profile",
    ),
    CauseClass(
        "dead band",
        ("gain ERR_DBW", "dialect band", "dialect cross_band"),
        "a width that counts as 0 and a firmware without a dead band leave E alone alike",
        "write another ERR_DBW: only a register that is not the operand leaves no trace at any width",
    ),
    CauseClass(
        "derivative's input",
        ("dialect PID_DE", "dialect derivative_of"),
        "the bit read otherwise and the firmware that differentiates the other one compute the same D",
        "turn PID_DE and look whether D changes its kind",
    ),
    CauseClass(
        "derivative's filter",
        ("gain Tf", "dialect filter"),
        "a Tf that acts as 0 and a firmware that ignores it compute the same D",
        "compare the register of Tf with the one in the profile",
    ),
    CauseClass(
        "transfer",
        (
            "dialect transfer",
            "dialect transfer_2",
            "dialect preset_d",
            "dialect preset_order",
            "dialect preset_integrates",
            "dialect preset_limit",
            "dialect preset_mv",
            "dialect run_off_manual",
            "mode-change PID_MAN",
            "operand-written I_MV",
            "integral I_MV",
        ),
        "a transfer is one execution: its preset, one that was left out, and a write to I_MV behind it look alike",
        "repeat the transfer at another error: a write does not follow the formula",
    ),
    CauseClass(
        "interval",
        ("cycle CYCLE", "dialect ts_source", "dialect ts_unit", "dialect ts_scale"),
        "an interval that is the same at each execution is CYCLE's, the unit's or the clock's alike",
        "change CYCLE: a factor stays a factor, a fixed interval does not",
    ),
    CauseClass(
        "integral, once",
        ("operand-written I_MV", "integral I_MV"),
        "one wrong increment and one write between two executions leave the same words",
        "look for a program or another master that writes I_MV; a wrong sum repeats itself",
    ),
    CauseClass(
        "output",
        ("clamp MV", "operand-written MV"),
        "what is added behind the limiter may be the firmware's or the program's",
        "search the program for what writes MV",
    ),
    CauseClass(
        "executions",
        ("missed-execution", "cycle CYCLE"),
        "an instruction that is called twice and one that is due twice as often leave the same words",
        "look at the task's interval, and whether the instruction is called in a loop or by a jump",
    ),
    CauseClass(
        "anti-windup",
        ("dialect freeze", "dialect freeze_test", "dialect limit_edge"),
        "beyond a limit they differ only in executions at its very edge",
        "drive MV into the limit and back with SV, slowly",
    ),
    CauseClass(
        "picture",
        ("torn-picture", "operand-written I_MV", "operand-written MV"),
        "an old word beside new ones was read too early, or somebody put it back",
        "bring the words within one request; what was written then still stands there",
    ),
)
"""Every published class. A dialect and the firmware change that brought it are told apart by history alone."""


def class_of(member: str) -> frozenset[str]:
    """Return all causes that cannot be told from this one, itself included."""
    return frozenset({member}.union(*(each.members for each in CLASSES if member in each.members)))


def classes_of(cause: str) -> dict[str, str]:
    """Return every class in which a cause stands: its members, and why they are one."""
    own = [each for each in CLASSES if any(member.split()[0] == cause for member in each.members)]
    return {each.name: f"{', '.join(each.members)}: {each.why}; {each.ask}" for each in own}
