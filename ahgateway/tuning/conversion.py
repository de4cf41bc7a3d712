"""From one controller to another: settings, every approximation as a warning with its size, and when it is exact.

This file alone decides what is lost (spec 7.3). Theory of operation: the source's settings become canonical, are
scaled, and become the target's; those are read back, and what differs is the loss, whichever pair it is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ahgateway.core.controllers import melsec_pid
from ahgateway.core.controllers.pid_temp_operands import FAR
from ahgateway.core.real import REAL
from ahgateway.errors import ProfileError
from ahgateway.tuning.blocks import BLOCKS, INT_MAX, INT_MIN, WHOLE, Block, Given, Params, Use
from ahgateway.tuning.canonical import SAME, Band, Canonical, Scaling

NOTE_MAX = 0.01
"""Relative rounding up to it is said to be a note (spec 7.3)."""
WHOLE_MIN = 1000
"""Fewer whole numbers than this over the range of MV are a rounding to speak of."""
REAL_MAX = float(np.finfo(REAL).max)
EXACT = 1e-6
"""Relative difference below it is the REAL register itself."""


@dataclass(frozen=True, slots=True)
class Loss:
    """One thing that the target does otherwise.

    Attributes:
        code: `W-SIGN`, `W-DSRC`, `W-DFILT`, `W-PVFILT`, `W-WEIGHT`, `W-BIAS`, `W-DBAND`, `W-WINDUP`, `W-QUANT`,
            `W-RANGE`, `W-TS`, `W-MODE`, `W-PULSE`, `W-SPLIT` or `W-AUTOTUNE`.
        text: What, with both values.
        size: How much, in `unit`.
        unit: Unit of `size`.
        is_exact: The output stays the same while it is unlimited.
    """

    code: str
    text: str
    size: float = 0.0
    unit: str = ""
    is_exact: bool = False


@dataclass(frozen=True, slots=True)
class Conversion:
    """One controller rebuilt as another.

    Attributes:
        source: Name of the source's block.
        given: The source's settings, defaults filled in.
        target: Name of the target's block.
        settings: The target's settings, rounded as its registers hold them.
        wanted: The source's canonical set in the target's units.
        reached: The canonical set that the target's settings give back.
        losses: What differs.
        scaling: Ranges on both sides.
    """

    source: str
    given: Params
    target: str
    settings: Params
    wanted: Canonical
    reached: Canonical
    losses: tuple[Loss, ...]
    scaling: Scaling

    @property
    def is_exact(self) -> bool:
        """Tell whether the unlimited output is the same in real arithmetic."""
        return all(loss.is_exact for loss in self.losses)


def block(name: str) -> Block:
    """Return the block of that name, in any case of letters.

    Raises:
        ProfileError: There is none.
    """
    for known, found in BLOCKS.items():
        if known.lower() == name.lower():
            return found
    raise ProfileError(f"`{name}` is no controller we know, known are {', '.join(BLOCKS)}")


def convert(
    source: str,
    given: Given,
    target: str,
    *,
    scaling: Scaling = SAME,
    use_from: Use | None = None,
    use_to: Use | None = None,
    file: str = "",
) -> Conversion:
    """Rebuild one controller as another.

    Args:
        source: Block of the settings.
        given: Settings by the manual's names; what is missing has its default.
        target: Block to write.
        scaling: Ranges of PV and MV on both sides.
        use_from: How the source stands in its plant.
        use_to: How the target will.
        file: Where the settings came from, for messages.

    Raises:
        ProfileError: A block or a setting that is not known, or a source that does not run with its settings.
    """
    use_from, use_to = use_from or Use(), use_to or Use()
    old, new = block(source), block(target)
    params = old.settings(given, file)
    _check_runs(old, params, use_from, file)
    wanted = old.read(params, use_from).scaled(scaling)
    if old.name in ("DPID", "DPIDE") and use_to.dependent is None:
        use_to = replace(use_to, dependent=bool(params.get("PID_EQ", False)))
    settings = {name: rounded(value) for name, value in new.write(wanted, use_to).items()}
    reached = new.read(new.defaults | settings, use_to)
    losses = (
        *_of_source(old, params, use_from),
        *_whole(old, new, scaling),
        *_between(new, settings, wanted, reached, use_to),
        *_series(old, new, use_from, use_to),
    )
    if old.windup != new.windup:
        text = f"beyond a limit {old.name} {old.windup}, {new.name} {new.windup}"
        losses = (*losses, Loss("W-WINDUP", text, is_exact=True))
    return Conversion(old.name, params, new.name, settings, wanted, reached, losses, scaling)


def _check_runs(old: Block, p: Params, use: Use, file: str) -> None:
    """Refuse settings with which the source stands still: there is nothing to rebuild."""
    times = {"PIDINIT": ["TS"], "PID_Temp": ["Heat_Cycle"], "PID_REG_CE": ["DT"]}.get(old.name, [])
    if old.name == "PID_REG_CE" and use.stroke_s is not None:
        times += ["T_PERIOD", "PT_MIN_IMP"]
    for name in times:
        if not p[name] > 0.0:
            raise ProfileError(f"{p[name]:g} is no time above 0: {old.name} does not run", file=file or None, key=name)
    if old.name == "MELSEC_PID":
        fields = melsec_pid.Operands._fields
        words: dict[str, Any] = {name.lower(): int(value) for name, value in p.items() if name.lower() in fields}
        code = melsec_pid.parameter_error(melsec_pid.Operands(**words))
        if code:
            name = ("TS", "ALPHA", "KP", "TI", "KD", "TD")[code - melsec_pid.BAD_TS]
            text = f"{p[name]:g} stops the instruction with error {code:04X}H: there is nothing to rebuild"
            raise ProfileError(text, file=file or None, key=name)


def rounded(value: float | int | bool) -> float | int | bool:
    """Return a setting as its register holds it: REALs in binary32, the largest one in place of what lies beyond."""
    if not isinstance(value, float):
        return value
    return float(REAL(min(max(value, -REAL_MAX), REAL_MAX)))


def _of_source(old: Block, p: Params, use: Use) -> list[Loss]:
    """What the canonical set cannot hold at all."""
    out: list[Loss] = []
    if old.name in ("DPID", "DPIDE") and p["PID_MODE"] == 1:
        out.append(Loss("W-AUTOTUNE", "PID_MODE is 1: the gains are still being sought"))
    if old.name == "DPID" and p["PID_MODE"] == 2:
        text = "PID_MODE is 2: the transfer from manual took the held integral, it will be bumpless"
        out.append(Loss("W-MODE", text))
    if old.name == "MELSEC_PID" and int(p["ACT"]) & 0x10:
        out.append(Loss("W-AUTOTUNE", "ACT bit 4 is on: the gains are still being sought"))
    if old.name == "MELSEC_PID" and old.read(p, use).umax - old.read(p, use).umin < WHOLE_MIN:
        span = old.read(p, use).umax - old.read(p, use).umin
        text = f"SV, PV and MV were whole numbers, {span:g} of them for MV; they no longer are"
        out.append(Loss("W-QUANT", text, 100 / max(span, 1.0), "% of MV"))
    if old.name == "PIDINIT" and min(p["DMVL"], p["DPVL"]) < 2050:
        size = float(min(p["DMVL"], p["DPVL"]))
        out.append(Loss("W-RANGE", f"the limit of change per sample, {size:g}, is not carried over", size, "counts"))
    if old.name == "PID_Temp":
        if p["ActivateCooling"]:
            kind = "a second set of parameters" if p["AdvancedCooling"] else f"a factor of {p['CoolFactor']:g}"
            exact = not p["AdvancedCooling"] and p["CoolFactor"] == 1.0
            size = float(p["CoolFactor"])
            out.append(Loss("W-SPLIT", f"cooling by {kind} must be rebuilt outside", size, "factor", exact))
        if p["Heat_ControlZone"] < 0.99 * FAR:
            size = float(p["Heat_ControlZone"])
            out.append(Loss("W-DBAND", f"the control zone of {size:g} is not carried over", size, "PV"))
    if old.name == "PID_REG_CE" and use.stroke_s is not None:
        out.append(_pulses(p, use))
    return out


def _whole(old: Block, new: Block, scaling: Scaling) -> list[Loss]:
    """Whole numbers of PV and MV over the ranges that were named; nothing where none were."""
    out: list[Loss] = []
    if scaling == SAME:
        return out
    for side, block_, ranges in (
        ("were", old, (scaling.pv_from, scaling.mv_from)), ("become", new, (scaling.pv_to, scaling.mv_to)),
    ):  # fmt: skip
        for name, (low, high) in zip(("PV", "MV"), ranges, strict=True):
            if block_.name in WHOLE and high - low < WHOLE_MIN:
                text = f"{name} {side} whole numbers in {block_.name}, {high - low:g} of them over its range"
                out.append(Loss("W-QUANT", text, 100 / (high - low), f"% of {name}"))
    return out


def _series(old: Block, new: Block, use_from: Use, use_to: Use) -> list[Loss]:
    """Y as an analog output: PID_REG_CE integrates within one series only, so that it holds no MV by itself."""
    for one, use in ((old, use_from), (new, use_to)):
        if one.name == "PID_REG_CE" and old.name != new.name and use.stroke_s is None:
            text = (
                "PID_REG_CE integrates within one series only and begins each at Y = 0, so that it holds no MV at rest"
            )
            return [Loss("W-PULSE", text)]
    return []


def _pulses(p: Params, use: Use) -> Loss:
    text = (
        f"pulses on an actuator of {use.stroke_s:g} s stroke are a linear likeness only: the error grows with |Y|, "
        "the zone, the shortest pulse and backlash"
    )
    if p["TV"] > 0.0 and p["KP"] > 0.0:
        # Spec D.4: D acts from one call to the next, and the call in which a series begins makes its first pulse.
        kick = p["KP"] * p["TV"] / p["DT"]
        text += f"; SV that steps by 1 makes Y jump by {kick:.3g} % in one call: let SV run in a ramp, or set TV to 0"
    return Loss("W-PULSE", text, 1.0, "% of stroke per shortest pulse")


def _between(new: Block, settings: Params, wanted: Canonical, reached: Canonical, use: Use) -> list[Loss]:
    """What differs between the canonical set that was wanted and the one that was reached."""
    out = _structure(new, wanted, reached)
    out += _numbers(new, wanted, reached, use)
    if new.name == "PID_REG_CE" and use.stroke_s is not None:
        out.append(_pulses(settings, use))
    return out


def _structure(new: Block, w: Canonical, r: Canonical) -> list[Loss]:
    out: list[Loss] = []
    if w.sign != r.sign:
        text = f"{new.name} has no negative gain: feed it −PV and −SV with mirrored limits of PV"
        out.append(Loss("W-SIGN", text, 1.0))
    if w.kd > 0.0 and abs(w.c - r.c) > EXACT:
        code = "W-DSRC" if w.c in (0.0, 1.0) else "W-WEIGHT"
        text = f"D sees SV with weight {w.c:g}, in {new.name} with {r.c:g}: only steps of SV differ"
        out.append(Loss(code, text, abs(w.c - r.c), "of SV's step"))
    if w.kp > 0.0 and abs(w.b - r.b) > EXACT:
        remedy = f"; BIAS := −{w.kp:g}·{1.0 - w.b:g}·SV at every scan makes it exact" if new.name == "DPIDE" else ""
        out.append(
            Loss("W-WEIGHT", f"P sees SV with weight {w.b:g}, in {new.name} with {r.b:g}{remedy}", abs(w.b - r.b))
        )
    if w.tau_pv_s > 0.0 and r.tau_pv_s == 0.0:
        text = f"{new.name} has no filter on PV: put one of {w.tau_pv_s:.4g} s before it"
        out.append(Loss("W-PVFILT", text, w.tau_pv_s, "s"))
    if w.bias != r.bias:
        velocity = new.name in ("MELSEC_PID", "PIDINIT")
        where = "put it into the start value of (d)" if velocity else "the integral takes it up"
        held = velocity or w.ki > 0.0
        out.append(Loss("W-BIAS", f"{new.name} has no BIAS, {w.bias:g} is lost: {where}", abs(w.bias), "MV", held))
    if (w.band or r.band) and (w.band_kind is not r.band_kind or abs(w.band - r.band) > EXACT * max(w.band, r.band)):
        has = f"{new.name} has {'none' if r.band_kind is Band.NONE else f'a {r.band_kind.value} one of {r.band:g}'}"
        was = "there was no dead band" if w.band_kind is Band.NONE else f"a {w.band_kind.value} dead band of {w.band:g}"
        out.append(Loss("W-DBAND", f"{was}, {has}", max(w.band, r.band), "PV"))
    if w.kd > 0.0 and (w.tf_s > 0.0) != (r.tf_s > 0.0):
        text = f"the derivative's filter was {w.tf_s:.4g} s, in {new.name} it is {r.tf_s:.4g} s"
        out.append(Loss("W-DFILT", text, abs(w.tf_s - r.tf_s), "s"))
    return out


def _numbers(new: Block, w: Canonical, r: Canonical, use: Use) -> list[Loss]:
    out: list[Loss] = []
    if abs(w.ts_s - r.ts_s) > EXACT * w.ts_s and not (new.name == "PID_REG_CE" and use.stroke_s is not None):
        text = f"the sampling time was {1000 * w.ts_s:g} ms, it becomes {1000 * r.ts_s:g} ms"
        out.append(Loss("W-TS", text, 1000 * abs(w.ts_s - r.ts_s), "ms"))
    if w.kp > 0.0 and r.kp == 0.0:
        out.append(Loss("W-RANGE", f"Kc was {w.kc:.6g}, in {new.name} it is 0: the controller is off", 100.0, "%"))
    lost = max(abs(w.ki - r.ki), abs(w.kd - r.kd))
    if w.kp == 0.0 and lost > EXACT * max(w.ki, w.kd):
        text = f"I or D without P (Ki {w.ki:g}, Kd {w.kd:g}) has no form in {new.name}: the branches are off"
        out.append(Loss("W-RANGE", text, max(w.ki, w.kd)))
    for name, want, have in (
        ("Kc", w.kc, r.kc), ("Ti", w.ti_s, r.ti_s), ("Td", w.td_s, r.td_s), ("Tf", w.tf_s, r.tf_s),
        ("PV filter", w.tau_pv_s, r.tau_pv_s),
    ):  # fmt: skip
        if not (math.isfinite(want) and math.isfinite(have)) or want <= 0.0 or have <= 0.0:
            continue
        share = abs(have - want) / want
        if share > EXACT:
            code = "W-RANGE" if share > 0.2 else "W-QUANT"
            text = f"{name} was {want:.6g}, the registers hold {have:.6g}"
            text += " (up to 1 % a note)" if share <= NOTE_MAX else ""
            out.append(Loss(code, text, 100 * share, "%"))
    for name, want, have in (("upper", w.umax, r.umax), ("lower", w.umin, r.umin)):
        wide = new.name not in ("MELSEC_PID", "PIDINIT") and abs(want) > 1e30
        if not wide and abs(want - have) > EXACT * max(1.0, abs(want)):
            out.append(Loss("W-RANGE", f"the {name} limit was {want:g}, it becomes {have:g}", abs(want - have), "MV"))
    if new.name in ("MELSEC_PID", "PIDINIT"):
        span = min(r.umax, INT_MAX) - max(r.umin, INT_MIN)
        if span < WHOLE_MIN:
            text = f"MV has whole numbers only, {span:g} of them: choose a wider range for it, such as 0…4000"
            out.append(Loss("W-QUANT", text, 100 / max(span, 1.0), "% of MV"))
    return out


def is_whole(target: str, name: str) -> bool:
    """Tell whether a setting stands in an integer register of this block."""
    return isinstance(BLOCKS[target].defaults[name], int) and not isinstance(BLOCKS[target].defaults[name], bool)
