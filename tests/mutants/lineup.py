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

from ahgateway.core.controllers import Controller, delta_terms, dpid, dpide
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
    """Compile the law and its terms with each line of `changes` replaced; AssertionError unless each stands there once.

    A line stands in the law's own file or in that of the terms which both laws share.
    """
    sources = {module: inspect.getsource(module) for module in (law, delta_terms)}
    for old, new in changes:
        counts = {module: source.count(old) for module, source in sources.items()}
        assert sum(counts.values()) == 1, f"{counts}: {old}"
        home = max(counts, key=lambda module: counts[module])
        sources[home] = sources[home].replace(old, new)
    mutants = {}
    for module, source in sources.items():
        mutants[module] = mutant = types.ModuleType(f"{module.__name__}_mutant")
        exec(compile(FUSED, mutant.__name__, "exec"), mutant.__dict__ | {"REAL": REAL}, mutant.__dict__)
        exec(compile(source, mutant.__name__, "exec"), mutant.__dict__)
    mutants[law].__dict__["terms_of"] = mutants[delta_terms]
    return Suspect(mutants[law].step, mutants[law].nominal_ts)


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


TOTAL = "raw = _total(operands, dialect, kc, p, e, after, j, d, inner)"
SUMMED = "raw = terms_of.summed(dialect, p, after, d)"
THIS_ERROR = "== Integrator.DVP:\n        return e\n"

COMMON: dict[str, Changes] = {
    "direction reversed": (
        (
            "return operands.sv - pv if operands.pid_dir != bool",
            "return operands.sv - pv if operands.pid_dir == bool",
        ),
    ),
    "integral never frozen above": (
        (
            "flag.FREEZE_HI if over else flag.FREEZE_LO\n",
            "flag.FREEZE_HI if over else flag.FREEZE_LO\n    if over:\n        return candidate, flags\n",
        ),
    ),
    "integral never frozen below": (
        (
            "flag.FREEZE_HI if over else flag.FREEZE_LO\n",
            "flag.FREEZE_HI if over else flag.FREEZE_LO\n    if under:\n        return candidate, flags\n",
        ),
    ),
    "integral frozen outward only": (("dialect.freeze == Freeze.OUTWARD", "True"),),
    "bumpless transfer ignored": (("if state.man1 and not manual", "if False and not manual"),),
    "manual value not limited": (("mv = limit(mv_min, mout, mv_max)", "mv = mout"),),
    "MOUT does not follow": (("mout = mv\n", "pass\n"),),
    "limits not exchanged": (("if mv_max < mv_min and", "if False and"),),
    "PID_RUN off clears the integral": (
        ("kept = ZERO if dialect.run_off == RunOff.CLEAR else state.i", "kept = ZERO"),
    ),
    "PID_RUN off keeps MV": (("stopped = State(kept, pv1, ZERO,", "stopped = State(kept, pv1, state.mv,"),),
    "limit tested with equality": (
        (
            "over, under = bool(tested > high), bool(tested < low)",
            "over, under = bool(tested >= high), bool(tested < low)",
        ),
    ),
    "Ts before Ki": (("return (k * x) * ts", "return k * (x * ts)"),),
    "forward Euler": ((THIS_ERROR, THIS_ERROR.replace("return e", "return e1")),),
    "trapezoid": ((THIS_ERROR, THIS_ERROR.replace("return e", "return (e + e1) * HALF")),),
}

DPID: dict[str, Changes] = COMMON | {
    "integral added after the output": ((SUMMED, SUMMED.replace("after", "before")),),
    "history of the last run after PID_RUN off": (("e1, pv1 = e, operands.pv\n", "pass\n"),),
    "Ts ten times too short": (("HUNDRED = REAL(100)", "HUNDRED = REAL(1000)"),),
    "derivative of PV": (("if dialect.derivative_of:", "if True:"),),
    "dead band ignored": (("if operands.err_dbw == ZERO:\n        return er", "if True:\n        return er"),),
    "dead band without its edges": (("and not dialect.band_edge", "and dialect.band_edge"),),
    "dead band shifts the error": (("if dialect.band == Band.SHIFTED:", "if True:"),),
    "P and I limited before D": ((SUMMED, "raw = limit(low, p + after, high) + d"),),
    "sum from the right": (("return (p + i) + d", "return p + (i + d)"),),
    "fused integral": (("return i + step, step", "return fused(k * x, ts, i), step"),),
    "slope before Kd": (("return (kd * change) / ts", "return kd * (change / ts)"),),
    "mode 2 counts as 0": (("if mode == 2:", "if False:"),),
    "integral kept without Ki": (
        ("if i == ZERO or not dialect.ki_off:", "if i == ZERO:"),
        ("(i if dialect.ki_off == KiOff.HELD else ZERO)", "i"),
    ),
    "negative gains used": (
        (
            "kp, ki, kd = gain(operands.kp), gain(operands.ki), gain(operands.kd)",
            "kp, ki, kd = operands.kp, gain(operands.ki), gain(operands.kd)",
        ),
    ),
    "D history stands still in manual": (
        (
            "State(i, operands.pv, mv, e, manual, True,",
            "State(i, operands.pv, mv, state.e1 if manual else e, manual, True,",
        ),
    ),
    "transfer forgets D": (("if dialect.preset_d:", "if True:"),),
}

DPIDE: dict[str, Changes] = COMMON | {
    "integral added after the output": ((TOTAL, TOTAL.replace("after, j", "before, j_before")),),
    "history of the last run after PID_RUN off": (("fresh = not state.valid and", "fresh = False and"),),
    "Ts ten times too short": (("THOUSAND = REAL(1000)", "THOUSAND = REAL(10000)"),),
    "derivative of E and PV exchanged": (("if not operands.pid_de:", "if operands.pid_de:"),),
    "derivative of PV with the wrong sign": (
        ("return -moved if operands.pid_dir != bool", "return -moved if operands.pid_dir == bool"),
    ),
    "dead band ignored": (("e = ZERO if cross else er\n    e1 = e if", "e = er\n    e1 = e if"),),
    "dead band without zero crossing": (("if cross or dialect.cross_band == CrossBand.PLAIN:", "if True:"),),
    "dead band with its edges": (
        ("(abs(er) == abs(operands.err_dbw) and dialect.cross_edge)", "abs(er) == abs(operands.err_dbw)"),
    ),
    "touching SV is no crossing": (
        ("(er == ZERO or er1 == ZERO) and dialect.cross_touch", "er == ZERO or er1 == ZERO"),
    ),
    "PV moves for D while crossed": (("moved = ZERO if cross else operands.pv - pv1", "moved = operands.pv - pv1"),),
    "BIAS after the limiter": (
        (TOTAL, "raw = limit(low, terms_of.summed(dialect, p, after, d), high) + operands.bias"),
    ),
    "BIAS ignored by the transfer": (("return ((mv - p) - d) - bias", "return (mv - p) - d"),),
    "sum from the right": (
        ("return summed(dialect, p, i, d) + bias\n    first", "return p + (i + (d + bias))\n    first"),
    ),
    "BIAS summed first": (
        ("return summed(dialect, p, i, d) + bias\n    first", "return ((bias + p) + i) + d\n    first"),
    ),
    "fused integral": (("return i + step, step", "return (i + step if dependent else fused(k * x, ts, i)), step"),),
    "fused filter": (("return ((tf * d) + (kd * change)) / span", "return fused(tf, d, kd * change) / span"),),
    "Tf ignored": (
        (
            "_tf(operands, dialect, tf, td_kd), _kd(operands, dialect, kc, td_kd)\n    if",
            "ZERO, _kd(operands, dialect, kc, td_kd)\n    if",
        ),
    ),
    "filter by forward Euler": (
        (
            "return ((tf * d) + (kd * change)) / span",
            "return d + (ts / span) * (((kd * change) / ts) - d)",
        ),
    ),
    "filter stands still in manual": (
        ("if dialect.manual_filter and (content != state.d):", "if True:"),
        ("state.d if dialect.manual_filter == ManualFilter.HELD else ZERO", "state.d"),
    ),
    "PID_RUN off keeps the filter": (("d, cross = ZERO, False\n", "d, cross = state.d, False\n"),),
    "Kc does not scale D": (("return kc * td_kd\n", "return td_kd\n"),),
    "Kc does not scale I": (
        ("gain = ONE if dialect.integral_store == IntegralStore.WITHOUT_KC else kc", "gain = ONE"),
    ),
    "1/Ti taken first": (("product(dialect, gain, x, ts) / k", "(gain * x) * (ts / k)"),),
    "PID_EQ ignored": (("if not dependent:\n        return product(", "if True:\n        return product("),),
    "integral kept while Kc is 0": (
        ("integrating = bool(ti_ki > ZERO and not dead)", "integrating = bool(ti_ki > ZERO)"),
    ),
}

LAWS = {"DPID": (dpid, DPID), "DPIDE": (dpide, DPIDE)}
