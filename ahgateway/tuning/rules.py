"""Tuning rules: a model in, gains in standard form out. Each formula with its source.

This file alone holds the formulas. It does not know a controller, nor whether the gains are any good.

θ is the effective dead time: the model's plus half a sampling time, since a held output acts half a sample late. One
dial from 0 (cautious) to 1 (fast), 0.5 is the rule as published: rules with a closed-loop time constant scale it,
the others scale their gain, both by 4^(dial − 0.5), a factor of 2 at each end.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ahgateway.tuning.models import Kind, Model


@dataclass(frozen=True, slots=True)
class Gains:
    """Gains in standard form, MV/PV and s; `ti_s` inf is no integral, `b` the weight of SV in P that the rule wants."""

    kc: float
    ti_s: float
    td_s: float = 0.0
    b: float = 1.0


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule.

    Attributes:
        name: `SIMC PI`.
        source: Where the formula stands.
        gains: `gains(model, theta, factor)`, None where the rule has no answer for this model.
    """

    name: str
    source: str
    gains: Callable[[Model, float, float], Gains | None]


def apply(rule: Rule, model: Model, ts_s: float, dial: float = 0.5) -> Gains | None:
    """Return a rule's gains for a model in a loop sampled every `ts_s` seconds.

    The gain is positive: direction of action is the controller's sign, which follows the sign of the model's gain.

    Args:
        rule: Which rule.
        model: Any of the three; oscillating ones go through the half rule.
        ts_s: Sampling time in s.
        dial: 0 cautious … 1 fast.
    """
    if not 0.0 <= dial <= 1.0:
        raise ValueError(f"the dial goes from 0 to 1: {dial}")
    positive = Model(model.kind, abs(model.gain), model.dead_time_s, model.tau_s, model.zeta)
    theta = positive.dead_time_s + ts_s / 2.0
    gains = rule.gains(positive, theta, 4.0 ** (dial - 0.5))
    if gains is None or not (gains.kc > 0.0 and math.isfinite(gains.kc) and gains.ti_s > 0.0):
        return None
    return gains


def _first(model: Model, theta: float) -> tuple[float, float, float] | None:
    """Gain, lag and dead time of the half-rule model; None for an integrating one."""
    if model.kind is Kind.IPDT:
        return None
    half = model.half_rule()
    return half.gain, half.tau_s, theta + (half.dead_time_s - model.dead_time_s)


def _simc_pi(model: Model, theta: float, factor: float) -> Gains | None:
    if model.kind is Kind.IPDT:
        wanted = theta / factor
        return Gains(1.0 / (model.gain * (wanted + theta)), 4.0 * (wanted + theta))
    first = _first(model, theta)
    assert first is not None
    gain, tau, late = first
    wanted = late / factor
    return Gains(tau / (gain * (wanted + late)), min(tau, 4.0 * (wanted + late)))


def _simc_pid(model: Model, theta: float, factor: float) -> Gains | None:
    if model.kind is not Kind.SOPDT:
        return None
    wanted = theta / factor
    if model.zeta < 1.0:
        # Poles cancelled by the PID's zeros: Ti = 2ζτ, Td = τ/2ζ (Skogestad 2003, §5 on oscillating processes).
        if model.zeta < 0.3:
            return None
        ti = 2.0 * model.zeta * model.tau_s
        return Gains(ti / (model.gain * (wanted + theta)), ti, model.tau_s / (2.0 * model.zeta))
    tau1, tau2 = model.lags_s
    kc, ti, td = tau1 / (model.gain * (wanted + theta)), min(tau1, 4.0 * (wanted + theta)), tau2
    # Series to standard form.
    return Gains(kc * (1.0 + td / ti), ti + td, ti * td / (ti + td))


def _lambda(model: Model, theta: float, factor: float) -> Gains | None:
    first = _first(model, theta)
    if first is None:
        wanted = 3.0 * theta / factor
        return Gains((2.0 * wanted + theta) / (model.gain * (wanted + theta) ** 2), 2.0 * wanted + theta)
    gain, tau, late = first
    wanted = 3.0 * max(tau, late) / factor
    return Gains(tau / (gain * (wanted + late)), tau)


def _amigo_pi(model: Model, theta: float, factor: float) -> Gains | None:
    first = _first(model, theta)
    if first is None:
        return Gains(0.35 / (model.gain * theta) * factor, 13.4 * theta / factor)
    gain, tau, late = first
    kc = 0.15 / gain + (0.35 - late * tau / (late + tau) ** 2) * tau / (gain * late)
    return Gains(kc * factor, 0.35 * late + 13.0 * late * tau**2 / (tau**2 + 12.0 * late * tau + 7.0 * late**2))


def _amigo_pid(model: Model, theta: float, factor: float) -> Gains | None:
    first = _first(model, theta)
    if first is None:
        return Gains(0.45 / (model.gain * theta) * factor, 8.0 * theta / factor, 0.5 * theta, 0.0)
    gain, tau, late = first
    kc = (0.2 + 0.45 * tau / late) / gain
    ti = late * (0.4 * late + 0.8 * tau) / (late + 0.1 * tau)
    return Gains(kc * factor, ti, 0.5 * late * tau / (0.3 * late + tau), 0.0 if late / (late + tau) < 0.5 else 1.0)


def _cohen_coon_pi(model: Model, theta: float, factor: float) -> Gains | None:
    first = _first(model, theta)
    if first is None:
        return None
    gain, tau, late = first
    r = late / tau
    return Gains((0.9 + r / 12.0) / (gain * r) * factor, late * (30.0 + 3.0 * r) / (9.0 + 20.0 * r))


def _cohen_coon_pid(model: Model, theta: float, factor: float) -> Gains | None:
    first = _first(model, theta)
    if first is None:
        return None
    gain, tau, late = first
    r = late / tau
    ti, td = late * (32.0 + 6.0 * r) / (13.0 + 8.0 * r), 4.0 * late / (11.0 + 2.0 * r)
    return Gains((4.0 / 3.0 + r / 4.0) / (gain * r) * factor, ti, td)


def _slope(model: Model, theta: float) -> tuple[float, float, float]:
    """a = R·L, lag (inf for IPDT) and dead time: what step-response rules start from."""
    first = _first(model, theta)
    if first is None:
        return model.gain * theta, math.inf, theta
    gain, tau, late = first
    return gain * late / tau, tau, late


def _chr_load_pi(model: Model, theta: float, factor: float) -> Gains | None:
    a, _, late = _slope(model, theta)
    return Gains(0.6 / a * factor, 4.0 * late)


def _chr_load_pid(model: Model, theta: float, factor: float) -> Gains | None:
    a, _, late = _slope(model, theta)
    return Gains(0.95 / a * factor, 2.4 * late, 0.42 * late)


def _chr_setpoint_pi(model: Model, theta: float, factor: float) -> Gains | None:
    a, tau, _ = _slope(model, theta)
    return Gains(0.35 / a * factor, 1.2 * tau) if math.isfinite(tau) else None


def _chr_setpoint_pid(model: Model, theta: float, factor: float) -> Gains | None:
    a, tau, late = _slope(model, theta)
    return Gains(0.6 / a * factor, tau, 0.5 * late) if math.isfinite(tau) else None


def _zn_pi(model: Model, theta: float, factor: float) -> Gains | None:
    a, _, late = _slope(model, theta)
    return Gains(0.9 / a * factor, late / 0.3)


def _zn_pid(model: Model, theta: float, factor: float) -> Gains | None:
    a, _, late = _slope(model, theta)
    return Gains(1.2 / a * factor, 2.0 * late, 0.5 * late)


def ultimate(model: Model, theta: float) -> tuple[float, float] | None:
    """Return the gain in MV/PV and the period in s at which P control alone oscillates; None where it never does."""
    held = Model(model.kind, model.gain, theta, model.tau_s, model.zeta)
    if theta <= 0.0:
        return None
    omega = np.geomspace(1e-3, math.pi, 20000) / theta
    phase = np.unwrap(np.angle(held.response(omega)))
    beyond = np.flatnonzero(phase <= -math.pi)
    if not beyond.size or beyond[0] == 0:
        return None
    crossing = float(np.interp(math.pi, -phase[: beyond[0] + 1], omega[: beyond[0] + 1]))
    return 1.0 / float(abs(held.response(np.array([crossing]))[0])), 2.0 * math.pi / crossing


def _tyreus_luyben_pi(model: Model, theta: float, factor: float) -> Gains | None:
    found = ultimate(model, theta)
    return Gains(found[0] / 3.2 * factor, 2.2 * found[1]) if found else None


def _tyreus_luyben_pid(model: Model, theta: float, factor: float) -> Gains | None:
    found = ultimate(model, theta)
    return Gains(found[0] / 2.2 * factor, 2.2 * found[1], found[1] / 6.3) if found else None


SIMC = "Skogestad, J. Process Control 13 (2003) 291-309, eq. 23-25"
LAMBDA = "Dahlin 1968; integrating: Tyreus and Luyben 1992 form, Rivera, Morari and Skogestad 1986"
AMIGO = "Åström and Hägglund, J. Process Control 14 (2004) 635-650, and Advanced PID Control (2006), ch. 7"
COHEN = "Cohen and Coon, Trans. ASME 75 (1953) 827-834"
CHR = "Chien, Hrones and Reswick, Trans. ASME 74 (1952) 175-185, 0 % overshoot"
TYREUS = "Tyreus and Luyben, Ind. Eng. Chem. Res. 31 (1992) 2625-2628; PID: Luyben and Luyben 1997"
ZIEGLER = "Ziegler and Nichols, Trans. ASME 64 (1942) 759-768, step response"

RULES: tuple[Rule, ...] = (
    Rule("SIMC PI", SIMC, _simc_pi),
    Rule("SIMC PID", SIMC, _simc_pid),
    Rule("lambda PI", LAMBDA, _lambda),
    Rule("AMIGO PI", AMIGO, _amigo_pi),
    Rule("AMIGO PID", AMIGO, _amigo_pid),
    Rule("CHR load PI", CHR, _chr_load_pi),
    Rule("CHR load PID", CHR, _chr_load_pid),
    Rule("CHR setpoint PI", CHR, _chr_setpoint_pi),
    Rule("CHR setpoint PID", CHR, _chr_setpoint_pid),
    Rule("Tyreus-Luyben PI", TYREUS, _tyreus_luyben_pi),
    Rule("Tyreus-Luyben PID", TYREUS, _tyreus_luyben_pid),
    Rule("Cohen-Coon PI", COHEN, _cohen_coon_pi),
    Rule("Cohen-Coon PID", COHEN, _cohen_coon_pid),
    Rule("Ziegler-Nichols PI", ZIEGLER, _zn_pi),
    Rule("Ziegler-Nichols PID", ZIEGLER, _zn_pid),
)
"""Every rule, cautious families first; names are stable."""
