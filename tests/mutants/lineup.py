"""Wrong controllers: the law's own source with one thing changed, so that a mutant differs in nothing else.

A change that no longer finds its line fails loudly: the line-up must be kept with the law.
"""

from __future__ import annotations

import inspect
import types
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ahgateway.core.controllers import Controller, dpid, dpide
from ahgateway.core.real import REAL

Step = Callable[[Any, Any, Any, REAL], tuple[Any, Any]]
Changes = tuple[tuple[str, str], ...]

FUSED = """
def fused(a: REAL, b: REAL, c: REAL) -> REAL:
    return REAL(float(a) * float(b) + float(c))
"""
"""Multiply and add with one rounding, in binary64."""


@dataclass(frozen=True)
class Suspect:
    """A controller that stands in the line-up, with a step that may remember and its own idea of Ts."""

    step: Step
    nominal_ts: Callable[[Any], REAL]


def changed(law: types.ModuleType, changes: Changes) -> Suspect:
    """Compile the law with each line of `changes` replaced; AssertionError unless each stands there once."""
    source = inspect.getsource(law)
    for old, new in changes:
        assert source.count(old) == 1, f"{source.count(old)} times in {law.__name__}: {old}"
        source = source.replace(old, new)
    mutant = types.ModuleType(f"{law.__name__}_mutant")
    exec(compile(FUSED, mutant.__name__, "exec"), mutant.__dict__ | {"REAL": REAL}, mutant.__dict__)
    exec(compile(source, mutant.__name__, "exec"), mutant.__dict__)
    return Suspect(mutant.step, mutant.nominal_ts)


def one_scan_late(controller: Controller) -> Suspect:
    """Works on the PV of the execution before."""
    held: list[REAL] = []

    def step(operands: Any, state: Any, dialect: Any, ts: REAL) -> tuple[Any, Any]:
        late = operands._replace(pv=held[-1] if held else operands.pv)
        held.append(operands.pv)
        return controller.step(late, state, dialect, ts)

    return Suspect(step, controller.nominal_ts)


def binary64_inside(controller: Controller) -> Suspect:
    """Computes in binary64 and rounds what it leaves behind."""

    def wide(values: Any) -> Any:
        return values._replace(
            **{name: np.float64(v) for name, v in values._asdict().items() if isinstance(v, np.float32)}
        )

    def narrow(values: Any) -> Any:
        return values._replace(**{name: REAL(v) for name, v in values._asdict().items() if isinstance(v, np.floating)})

    def step(operands: Any, state: Any, dialect: Any, ts: REAL) -> tuple[Any, Any]:
        after, terms = controller.step(wide(operands), wide(state), dialect, np.float64(ts))
        return narrow(after), narrow(terms)

    return Suspect(step, controller.nominal_ts)


COMMON: dict[str, Changes] = {
    "direction reversed": (
        ("if operands.pid_dir else pv - operands.sv", "if not operands.pid_dir else pv - operands.sv"),
    ),
    "integral never frozen above": (("flags |= flag.FREEZE_HI\n", "flags |= flag.FREEZE_HI; i = candidate\n"),),
    "integral never frozen below": (("flags |= flag.FREEZE_LO\n", "flags |= flag.FREEZE_LO; i = candidate\n"),),
    "integral frozen outward only": (("dialect.freeze == Freeze.OUTWARD", "True"),),
    "integral added after the output": (("raw = ((p + candidate)", "raw = ((p + i)"),),
    "bumpless transfer ignored": (("elif state.man1 and", "elif False and"),),
    "manual value not limited": (("mv = limit(mv_min, mout, mv_max)", "mv = mout"),),
    "MOUT does not follow": (("mout = mv\n", "pass\n"),),
    "limits not exchanged": (("if mv_max < mv_min:", "if False:"),),
    "PID_RUN off clears the integral": (
        ("kept = ZERO if dialect.run_off == RunOff.CLEAR else state.i", "kept = ZERO"),
    ),
    "PID_RUN off keeps MV": (("stopped = State(kept, state.pv1, ZERO,", "stopped = State(kept, state.pv1, state.mv,"),),
    "history of the last run after PID_RUN off": (("if state.valid else e\n", "\n"),),
    "limit tested with equality": (("if raw > mv_max:", "if raw >= mv_max:"),),
}

DPID: dict[str, Changes] = COMMON | {
    "integral added after the output": (("raw = (p + candidate)", "raw = (p + i)"),),
    "Ts ten times too short": (("HUNDRED = REAL(100)", "HUNDRED = REAL(1000)"),),
    "derivative of PV": (("kd * (e - e1)", "kd * ((state.pv1 if state.valid else operands.pv) - operands.pv)"),),
    "dead band ignored": (("if operands.err_dbw != ZERO and", "if False and"),),
    "dead band without its edges": (("abs(er) <= abs", "abs(er) < abs"),),
    "dead band shifts the error": (
        ("    return er\n", "    return er - operands.err_dbw if er > ZERO else er + operands.err_dbw\n"),
    ),
    "P and I limited before D": (("raw = (p + candidate) + d", "raw = limit(mv_min, p + candidate, mv_max) + d"),),
    "sum from the right": (("raw = (p + candidate) + d", "raw = p + (candidate + d)"),),
    "forward Euler": (("increment = (ki * e) * ts", "increment = (ki * e1) * ts"),),
    "trapezoid": (("increment = (ki * e) * ts", "increment = (ki * ((e + e1) * REAL(0.5))) * ts"),),
    "Ts before Ki": (("increment = (ki * e) * ts", "increment = ki * (e * ts)"),),
    "fused integral": (("candidate = i + increment if", "candidate = fused(ki * e, ts, i) if"),),
    "fused P": (("raw = (p + candidate) + d", "raw = fused(kp, e, candidate) + d"),),
    "slope before Kd": (("(kd * (e - e1)) / ts", "kd * ((e - e1) / ts)"),),
    "mode 2 counts as 0": (("operands.pid_mode != 2", "True"),),
    "integral kept without Ki": (
        ("        if ki <= ZERO:\n            i = ZERO\n", ""),
        ("if ki > ZERO else ZERO\n        raw", "if ki > ZERO else i\n        raw"),
    ),
    "negative gains used": (
        (
            "kp, ki, kd = gain(operands.kp), gain(operands.ki), gain(operands.kd)",
            "kp, ki, kd = operands.kp, gain(operands.ki), gain(operands.kd)",
        ),
    ),
    "D history stands still in manual": (
        (
            "State(i, operands.pv, mv, e, manual, True)",
            "State(i, operands.pv, mv, state.e1 if manual else e, manual, True)",
        ),
    ),
    "transfer forgets D": (("i = (state.mv - p) - d", "i = state.mv - p"),),
}

DPIDE: dict[str, Changes] = COMMON | {
    "Ts ten times too short": (("THOUSAND = REAL(1000)", "THOUSAND = REAL(10000)"),),
    "derivative of E and PV exchanged": (("if not operands.pid_de:", "if operands.pid_de:"),),
    "derivative of PV with the wrong sign": (
        ("return -moved if operands.pid_dir else moved", "return moved if operands.pid_dir else -moved"),
    ),
    "dead band ignored": (("e = ZERO if cross else er\n    e1 = state", "e = er\n    e1 = state"),),
    "dead band without zero crossing": (
        ("return bool(cross or er == ZERO or _sign(er) != _sign(er1))", "return True"),
    ),
    "dead band with its edges": (("abs(er) < abs", "abs(er) <= abs"),),
    "touching SV is no crossing": (
        ("cross or er == ZERO or _sign(er) != _sign(er1)", "cross or _sign(er) * _sign(er1) < 0"),
    ),
    "PV moves for D while crossed": (("moved = ZERO if cross else operands.pv - pv1", "moved = operands.pv - pv1"),),
    "BIAS after the limiter": (
        ("raw = ((p + candidate) + d) + bias", "raw = limit(mv_min, (p + candidate) + d, mv_max) + bias"),
    ),
    "BIAS ignored by the transfer": (("i = ((state.mv - p) - d) - bias", "i = (state.mv - p) - d"),),
    "sum from the right": (("raw = ((p + candidate) + d) + bias", "raw = p + (candidate + (d + bias))"),),
    "BIAS summed first": (("raw = ((p + candidate) + d) + bias", "raw = ((bias + p) + candidate) + d"),),
    "forward Euler": (("else (ti_ki * e) * ts", "else (ti_ki * e1) * ts"),),
    "Ts before Ki": (("else (ti_ki * e) * ts", "else ti_ki * (e * ts)"),),
    "fused integral": (
        ("candidate = i + increment", "candidate = fused(ti_ki * e, ts, i) if not operands.pid_eq else i + increment"),
    ),
    "Tf ignored": (("d = ((tf * state.d) + (kd * delta_x)) / (tf + ts)", "d = (kd * delta_x) / ts"),),
    "filter by forward Euler": (
        (
            "d = ((tf * state.d) + (kd * delta_x)) / (tf + ts)",
            "d = state.d + (ts / (tf + ts)) * (((kd * delta_x) / ts) - state.d)",
        ),
    ),
    "filter stands still in manual": (("d if finite(d) else ZERO, er", "state.d if manual else d, er"),),
    "PID_RUN off keeps the filter": (("ZERO, state.e1, ZERO, state.er1", "ZERO, state.e1, state.d, state.er1"),),
    "Kc does not scale D": (("kd = kc * td_kd if operands.pid_eq else td_kd", "kd = td_kd"),),
    "Kc does not scale I": (("(p * ts) / ti_ki", "(e * ts) / ti_ki"),),
    "1/Ti taken first": (("(p * ts) / ti_ki", "p * (ts / ti_ki)"),),
    "PID_EQ ignored": (("increment = (p * ts) / ti_ki if operands.pid_eq else", "increment ="),),
    "integral kept while Kc is 0": (("integrating = ti_ki > ZERO and not dead", "integrating = ti_ki > ZERO"),),
}

LAWS = {"DPID": (dpid, DPID), "DPIDE": (dpide, DPIDE)}
