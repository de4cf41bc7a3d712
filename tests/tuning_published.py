"""Ms, margins, overshoot and IAE that papers, books and other programs have published, and what ours says there.

One list, `CASES`, for the test that holds ours to them and for the page `docs/reference/tune-published.md`, which has a
row for each and says where it was read; `python tests/tuning_published.py` prints the rows. Left out, with the reason:

* Skogestad and Grimholt's J of 1.00 for τ = 8 θ (table 5.4) cannot be: table 5.3 has 1.23 as the best for that Ms.
* Shinskey's row for θ = 2 τ (table 4.4) has an IAE below its own Ti/Kc in the unit that fits the others, the largest
  deviation that no controller can prevent, times θ; so the unit must be another there.

How the two programs' loops differ from ours, all of it taken over: that of pidtuner-experiment is one sample later, has
D of PV behind Td/80, leaves the first sample out of its IAE, and its ½ is half the gain, the cautious end of our dial.
That of process-control-toolbox integrates the error up to the execution before, which is a gain less by one
integration; its noise is 0.15 from numpy's generator with seed 7; SV goes from 30 to 50 at 100 s, and at 700 s comes a
load of −12 through the lag but without dead time.

Both programs compute in binary64 and share nothing with ours.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ahgateway.tuning.canonical import standard
from ahgateway.tuning.margins import margins
from ahgateway.tuning.models import Kind, Model
from ahgateway.tuning.predict import Response, judge_load, judge_setpoint, simulate
from ahgateway.tuning.rules import RULES, Gains, apply
from ahgateway.tuning.runner import delta

BY_NAME = {rule.name: rule for rule in RULES}
AT = (0.0, 0.0)
CONTINUOUS = 1e-9
"""Sampling time at which a rule's θ is the dead time alone."""
FAST_S = 0.02
"""Sampling as good as continuous beside θ = 1 s."""
SG12, SHINSKEY96 = "Skogestad and Grimholt 2012", "Shinskey 1996, table 4.4"
PIDTUNER, SHOOTOUT = "pidtuner-experiment", "process-control-toolbox"


@dataclass(frozen=True, slots=True)
class Figure:
    """One published number.

    Attributes:
        rule: Whose it is.
        process: On which process.
        quantity: What it is.
        published: As published.
        ours: What ours says.
        within: Largest difference, in units of the quantity.
        source: Who published it.
    """

    rule: str
    process: str
    quantity: str
    published: float
    ours: float
    within: float
    source: str


Case = Callable[[], Iterator[Figure]]


def row(found: list[Figure]) -> str:
    """A case as a row of the page."""
    first = found[0]
    pairs = " · ".join(f"{each.quantity} {short(each.published)} / {short(each.ours)}" for each in found)
    off = max(abs(each.ours - each.published) / (each.published or 100.0) for each in found)
    sources = ", ".join(dict.fromkeys(each.source for each in found))
    return f"| {first.rule} | {first.process} | {pairs} | {100.0 * off:.2g} % | {sources} |"


def short(value: float) -> str:
    return f"{value:.0f}" if value >= 1000.0 else f"{value:.4g}"


def gains_of(rule: str, model: Model, dial: float = 0.5) -> Gains:
    found = apply(BY_NAME[rule], model, CONTINUOUS, dial)
    assert found is not None
    return found


def text(model: Model) -> str:
    """A process in few signs."""
    if model.kind is Kind.IPDT:
        return f"{model.gain:g} e^(−{model.dead_time_s:g}s)/s"
    lags = "".join(f"({lag:.3g}s+1)" for lag in model.lags_s) if model.tau_s > 0.01 else "1"
    return f"{model.gain:g} e^(−{model.dead_time_s:g}s)/{lags}"


def run(model: Model, gains: Gains, sv: float, load: float, length_s: float, ts_s: float, tf_s: float,
        is_of_pv: bool = True) -> Response:  # fmt: skip
    """A DPIDE in the independent form on the process, from rest."""
    settings = {
        "CYCLE": round(1000.0 * ts_s), "Kc_Kp": gains.kc, "Ti_Ki": gains.kc / gains.ti_s if gains.ti_s else 0.0,
        "Td_Kd": gains.kc * gains.td_s, "Tf": tf_s, "PID_DE": is_of_pv, "MV_MAX": 1e9, "MV_MIN": -1e9,
    }  # fmt: skip
    return simulate(delta("DPIDE", settings, *AT, 0.0), model, AT, sv, load, length_s)


def of_setpoint(model: Model, gains: Gains, length_s: float = 40.0) -> float:
    return judge_setpoint(run(model, gains, 1.0, 0.0, length_s, FAST_S, 0.0), AT).iae


def of_load(model: Model, gains: Gains, length_s: float = 60.0) -> float:
    return judge_load(run(model, gains, 0.0, 1.0, length_s, FAST_S, 0.0), AT).iae


def robustness(rule: str, model: Model, gains: Gains, wanted: tuple[float, float, float], within: tuple[float, ...],
               source: str, ts_s: float = 1e-3, tf_s: float = 0.0) -> Iterator[Figure]:  # fmt: skip
    """Ms, GM and PM."""
    found = margins(model, standard(gains.kc, gains.ti_s, gains.td_s, ts_s=ts_s, tf_s=tf_s))
    ours = (found.ms, found.gain_margin, found.phase_margin_deg)
    for name, published, own, bar in zip(("Ms", "GM", "PM °"), wanted, ours, within, strict=True):
        yield Figure(rule, text(model), name, published, own, bar, source)


# Skogestad and Grimholt.

DELAY, EQUAL = Model(Kind.FOPDT, 1.0, 1.0, 1e-3), Model(Kind.FOPDT, 1.0, 1.0, 1.0)
LAG, INTEGRATING = Model(Kind.FOPDT, 1.0, 1.0, 8.0), Model(Kind.IPDT, 1.0, 1.0)
BEST = {DELAY: (1.607, 1.607), EQUAL: (2.083, 2.036), LAG: (2.169, 1.135), INTEGRATING: (2.169, 15.09)}
"""Table 5.3: IAE of the best PI loops with Ms 1.59, for SV and for a load; table 5.4's J is normalised by them."""


def best_pi(model: Model, setpoint: tuple[float, float], load: tuple[float, float]) -> Iterator[Figure]:
    """Table 5.3; a printed Kc of 0.50 may be 0.505, and τI 1.04 may be 1.035."""
    wanted = BEST[model]
    up, pushed = of_setpoint(model, Gains(*setpoint)), of_load(model, Gains(*load))
    yield Figure("PI, the best", text(model), "IAE SV", wanted[0], up, 0.015 * wanted[0], f"{SG12}, table 5.3")
    yield Figure(
        "PI, best for load", text(model), "IAE load", wanted[1], pushed, 0.025 * wanted[1], f"{SG12}, table 5.3"
    )


def simc(model: Model, cost: float | None, wanted: tuple[float, float, float]) -> Iterator[Figure]:
    """Tables 5.2 and 5.4, τc = θ: J = ½(IAE/IAE° of SV + IAE/IAE° of the load)."""
    gains = gains_of("SIMC PI", model)
    yield from robustness("SIMC PI", model, gains, wanted, (0.01, 0.01, 0.1), f"{SG12}, table 5.2")
    if cost is not None:
        found = 0.5 * (of_setpoint(model, gains) / BEST[model][0] + of_load(model, gains) / BEST[model][1])
        yield Figure("SIMC PI", text(model), "J of both IAE", cost, found, 0.015, "table 5.4")


def simc_pid(second: float) -> Iterator[Figure]:
    """Its D cancels the second lag, so that what holds for the first alone holds here; the chapter says so itself."""
    middle = math.sqrt(8.0 * second)
    model = Model(Kind.SOPDT, 1.0, 1.0, middle, (8.0 + second) / (2.0 * middle))
    gains = gains_of("SIMC PID", model)
    yield from robustness("SIMC PID", model, gains, (1.59, 3.14, 61.4), (0.01, 0.01, 0.2), f"{SG12}, table 5.2")
    found = judge_setpoint(run(model, gains, 1.0, 0.0, 20.0, 0.01, 0.0, is_of_pv=False), AT).iae
    yield Figure("SIMC PID", text(model), "IAE SV", 2.169, found, 0.02, "table 5.3 for the same loop")


# Closed forms and what papers made their rules for.


def direct_synthesis(lag_s: float) -> Iterator[Figure]:
    """λ = 3 max(τ, θ) gives L = e^(−θs)/((λ + θ)s): GM ½π(λ/θ + 1), PM 90° − 1/(λ/θ + 1), IE of SV λ + θ, no swing."""
    model = Model(Kind.FOPDT, 1.5, 1.0, lag_s)
    gains, share = gains_of("lambda PI", model), 3.0 * max(lag_s, 1.0) + 1.0
    form = "closed form of direct synthesis"
    found = margins(model, standard(gains.kc, gains.ti_s, ts_s=1e-3))
    yield Figure("lambda PI", text(model), "GM", 0.5 * math.pi * share, found.gain_margin, 0.02, form)
    yield Figure("lambda PI", text(model), "PM °", 90.0 - math.degrees(1.0 / share), found.phase_margin_deg, 0.1, form)
    yield Figure("lambda PI", text(model), "IAE SV", share, of_setpoint(model, gains, 80.0), 0.01 * share, form)
    whole = gains.ti_s / gains.kc
    yield Figure("lambda PI", text(model), "IAE load", whole, of_load(model, gains, 80.0), 0.01 * whole, form)


def amigo_on_an_integrator(rule: str, within: float) -> Iterator[Figure]:
    gains = gains_of(rule, INTEGRATING)
    found = margins(INTEGRATING, standard(gains.kc, gains.ti_s, gains.td_s, ts_s=1e-3))
    yield Figure(rule, text(INTEGRATING), "Ms", 1.4, found.ms, within, "Åström and Hägglund 2004, made for it")


def amigo_gains(rule: str, lag_s: float, dead_s: float, kc: float, ti: float, td: float) -> Iterator[Figure]:
    """Section 6: the lag-dominated, the balanced and the delay-dominated example, K = 1."""
    model = Model(Kind.FOPDT, 1.0, dead_s, lag_s)
    found = gains_of(rule, model)
    for name, published, ours in (("K", kc, found.kc), ("Ti", ti, found.ti_s), ("Td", td, found.td_s)):
        yield Figure(rule, text(model), name, published, ours, 5e-3 * published, "Åström and Hägglund 2004, section 6")


def two_decibels() -> Iterator[Figure]:
    """Largest closed-loop log modulus of an integrator with dead time."""
    gains, omega = gains_of("Tyreus-Luyben PI", INTEGRATING), np.geomspace(1e-3, 4.0, 20000)
    loop = gains.kc * (1.0 + 1.0 / (1j * omega * gains.ti_s)) * INTEGRATING.response(omega)
    peak = float(20.0 * np.log10(np.max(np.abs(loop / (1.0 + loop)))))
    yield Figure("Tyreus-Luyben PI", text(INTEGRATING), "Lc dB", 2.0, peak, 0.1, "Tyreus and Luyben 1992, made for it")


def quarter(rule: str, model: Model, source: str) -> Iterator[Figure]:
    """What is left of the continuous loop's least damped oscillation after one period."""
    gains = gains_of(rule, model)

    def around(s: complex) -> complex:
        law = gains.kc * (1.0 + 1.0 / (gains.ti_s * s) + gains.td_s * s)
        lag = s if model.kind is Kind.IPDT else model.tau_s * s + 1.0
        return complex(s * (lag + law * model.gain * np.exp(-s * model.dead_time_s)))

    left = []
    for start in (complex(real, imaginary) for real in (-1.0, -0.4, -0.1) for imaginary in np.linspace(0.3, 2.4, 8)):
        s, step = start / model.dead_time_s, 1e-6 / model.dead_time_s
        for _ in range(60):
            s -= around(s) * 2.0 * step / (around(s + step) - around(s - step))
        if abs(around(s)) < 1e-9 and 0.05 < s.imag * model.dead_time_s < 4.0:
            left.append(math.exp(2.0 * math.pi * s.real / s.imag))
    yield Figure(rule, text(model), "decay ratio", 0.25, max(left), 0.012, f"{source}, made for it")


def without_overshoot(rule: str) -> Iterator[Figure]:
    """0 %; the PID rules leave up to 2 % on a lag of 3.3 θ. Where PV does not swing, IAE of a load is Ti/Kc."""
    source = "Chien, Hrones and Reswick 1952"
    model = Model(Kind.FOPDT, 1.0, 1.0, 10.0 / 3.0)
    gains, is_load, is_pi = gains_of(rule, model), "load" in rule, rule.endswith("PI")
    trace = run(model, gains, 0.0 if is_load else 1.0, float(is_load), 50.0, FAST_S, 0.01 * gains.td_s, is_load)
    over = (judge_load if is_load else judge_setpoint)(trace, AT).overshoot_percent
    yield Figure(rule, text(model), "overshoot %", 0.0, over, 0.1 if is_pi else 2.0, f"{source}, made for it")
    if is_pi:
        whole = {"CHR load PI": 4.0 / 0.6 * 0.3, "CHR setpoint PI": 1.2 / 0.35}[rule]
        found = of_load(model, gains, 80.0)
        yield Figure(rule, text(model), "IAE load", whole, found, 0.01 * whole, f"{source}: Ti/Kc of its gains")


# A handbook.


def handbook(ratio: float, reset: float, rate: float, band: float, published: float) -> Iterator[Figure]:
    """The best noninteracting PID after a load: θ/τ, I/θ, D/θ, P."""
    model = Model(Kind.FOPDT, 1.0, 1.0, 1.0 / ratio) if ratio else INTEGRATING
    gains = Gains(100.0 / (band * (ratio or 1.0)), reset, rate)
    found = judge_load(run(model, gains, 0.0, 1.0, 30.0, 0.01, 1e-3 * rate), AT).iae
    unit = 1.0 - math.exp(-ratio) if ratio else 1.0
    yield Figure("PID, the best", text(model), "IAE load/IAE_b", published, found / unit, 0.07, SHINSKEY96)


# Other programs.

EXCHANGER = Model(Kind.FOPDT, 1.0, 13.0, 90.0)
TWO_LAGS = Model(Kind.SOPDT, 1000.0, 0.5, math.sqrt(10.0), 5.5 / math.sqrt(10.0))
FITTED = {
    EXCHANGER: Model(Kind.FOPDT, 0.9999679, 12.93681363724528, 90.03771784977023),
    TWO_LAGS: Model(Kind.FOPDT, 999.9463, 1.5159657698649482, 10.03339347536869),
}
"""The first-order model that the program identified and gave to its rules; its K is not printed, and is that of its
SIMC gain. Tyreus-Luyben takes the process itself."""
STEPS = {EXCHANGER: (2.6, 1417.0), TWO_LAGS: (0.05, 100.0)}
"""Sampling time and length of its simulation, in s; of the second, 152.5 s long, the last third adds nothing."""


def pidtuner(model: Model, rule: str, iae: float, load: float, overshoot: float, ms: float, gm_db: float, pm: float,
             dial: float = 0.5) -> Iterator[Figure]:  # fmt: skip
    (ts_s, length_s), name = STEPS[model], rule if dial == 0.5 else f"{rule}, half the gain"
    gains = gains_of(rule, model if rule.startswith("Tyreus") else FITTED[model], dial)
    wanted, filter_s = (ms, 10.0 ** (gm_db / 20.0), pm), gains.td_s / 80.0
    within = (5e-3 * ms, 2e-3 * wanted[1], 0.1)
    yield from robustness(name, model, gains, wanted, within, PIDTUNER, ts_s / 200.0, filter_s)
    late = replace(model, dead_time_s=model.dead_time_s + ts_s)
    up, pushed = (run(late, gains, *step, length_s, ts_s, filter_s) for step in ((1.0, 0.0), (0.0, 1.0)))
    errors = (np.abs(1.0 - up.pv) * (up.t_s > 0.0), np.abs(pushed.pv))
    for quantity, published, error in zip(("IAE SV", "IAE load"), (iae, load), errors, strict=True):
        own = float(np.trapezoid(error)) * ts_s
        yield Figure(name, text(model), quantity, published, own, 2e-4 * published, PIDTUNER)
    own = judge_setpoint(up, AT).overshoot_percent
    yield Figure(name, text(model), "overshoot %", overshoot, own, 1e-4 * overshoot, PIDTUNER)


def shootout(rule: str, ms: float, gm: float, pm: float, iae: float, overshoot: float, load: float) -> Iterator[Figure]:
    """Its lambda is 3 θ = 45 s, ours 3 τ = 180 s; the gains are those of its λ."""
    model = Model(Kind.FOPDT, 1.5, 15.0, 60.0)
    gains = Gains(60.0 / (1.5 * (45.0 + 15.0)), 60.0) if rule == "lambda PI" else gains_of(rule, model)
    yield from robustness(rule, model, gains, (ms, gm, pm), (0.006, 0.006, 0.55), SHOOTOUT, 5e-3)
    sv, pv = noisy_run(model, gains)
    error = np.abs(sv - pv)
    own = (float(np.trapezoid(error[100:701])), float(np.trapezoid(error[700:])))
    yield Figure(rule, text(model), "IAE SV", iae, own[0], 0.6, SHOOTOUT)
    yield Figure(rule, text(model), "IAE load", load, own[1], 0.6, SHOOTOUT)
    over = 100.0 * float(pv[100:701].max() - 50.0) / float(50.0 - pv[100])
    yield Figure(rule, text(model), "overshoot %", overshoot, over, 0.06, SHOOTOUT)


def noisy_run(model: Model, gains: Gains) -> tuple[np.ndarray, np.ndarray]:
    """SV and measured PV of the shootout's scenario, one second apart, with its noise."""
    noise, ki = np.random.default_rng(7).normal(0.0, 0.15, 1401), gains.kc / gains.ti_s
    settings = {"CYCLE": 1000, "Kc_Kp": gains.kc - ki, "Ti_Ki": ki, "Td_Kd": 0.0, "MV_MAX": 100.0, "MV_MIN": 0.0}
    runner = delta("DPIDE", settings, 30.0, 30.0, 20.0)
    plant, state = model.plant(30.0, 20.0)
    sv = np.where(np.arange(1401) < 100, 30.0, 50.0)
    pv, own, load = np.empty(1401), 30.0, 0.0
    for index in range(1401):
        pv[index] = own + load + noise[index]
        state, own = plant.step(state, runner.execute(float(sv[index]), float(pv[index])), 1.0)
        to = 0.0 if index < 700 else -12.0
        load = to + (load - to) * math.exp(-1.0 / 60.0)
    return sv, pv


CASES: dict[str, Case] = {
    "best PI, dead time": partial(best_pi, DELAY, (0.20, 0.32), (0.20, 0.32)),
    "best PI, equal": partial(best_pi, EQUAL, (0.55, 1.15), (0.50, 1.04)),
    "best PI, lag": partial(best_pi, LAG, (4.0, 8.0), (3.33, 3.65)),
    "best PI, integrating": partial(best_pi, INTEGRATING, (0.50, math.inf), (0.40, 5.8)),
    "SIMC PI, dead time": partial(simc, DELAY, 1.35, (1.59, 3.14, 61.4)),
    "SIMC PI, equal": partial(simc, EQUAL, 1.03, (1.59, 3.14, 61.4)),
    "SIMC PI, integrating": partial(simc, INTEGRATING, 1.43, (1.70, 2.96, 46.9)),
    "SIMC PID, 1 s": partial(simc_pid, 1.0),
    "SIMC PID, 3 s": partial(simc_pid, 3.0),
    "lambda PI, lag": partial(direct_synthesis, 3.0),
    "lambda PI, equal": partial(direct_synthesis, 1.0),
    "AMIGO PI, integrating": partial(amigo_on_an_integrator, "AMIGO PI", 0.02),
    "AMIGO PI, lag": partial(amigo_gains, "AMIGO PI", 1.04, 0.075, 4.13, 0.539, 0.0),
    "AMIGO PID, lag": partial(amigo_gains, "AMIGO PID", 1.04, 0.075, 6.44, 0.361, 0.0367),
    "AMIGO PI, balanced": partial(amigo_gains, "AMIGO PI", 2.90, 1.42, 0.414, 2.66, 0.0),
    "AMIGO PID, balanced": partial(amigo_gains, "AMIGO PID", 2.90, 1.42, 1.12, 2.40, 0.619),
    "AMIGO PID, delay": partial(amigo_gains, "AMIGO PID", 0.0932, 1.01, 0.242, 0.474, 0.119),
    "Tyreus-Luyben PI": two_decibels,
    # Ziegler and Nichols read a rate and a lag off a step response: an integrator with dead time. Cohen and Coon place
    # the leading poles of a lag with dead time.
    "Ziegler-Nichols PI": partial(quarter, "Ziegler-Nichols PI", INTEGRATING, "Ziegler and Nichols 1942"),
    "Ziegler-Nichols PID": partial(quarter, "Ziegler-Nichols PID", INTEGRATING, "Ziegler and Nichols 1942"),
    "Cohen-Coon PI": partial(quarter, "Cohen-Coon PI", replace(EQUAL, tau_s=4.0), "Cohen and Coon 1953"),
    "Cohen-Coon PID": partial(quarter, "Cohen-Coon PID", replace(EQUAL, tau_s=4.0), "Cohen and Coon 1953"),
    "CHR setpoint PI": partial(without_overshoot, "CHR setpoint PI"),
    "CHR setpoint PID": partial(without_overshoot, "CHR setpoint PID"),
    "CHR load PI": partial(without_overshoot, "CHR load PI"),
    "CHR load PID": partial(without_overshoot, "CHR load PID"),
    "handbook 1": partial(handbook, 1.0, 1.17, 0.37, 67, 1.44),
    "handbook 0.5": partial(handbook, 0.5, 1.43, 0.41, 74, 1.61),
    "handbook 0.2": partial(handbook, 0.2, 1.77, 0.41, 76, 1.79),
    "handbook 0": partial(handbook, 0.0, 1.90, 0.48, 78, 1.94),
} | {
    f"{SHOOTOUT}, {row[0]}": partial(shootout, *row)
    for row in (
        ("lambda PI", 1.25, 6.28, 76, 1229, 1.9, 761),
        ("AMIGO PI", 1.25, 6.71, 70, 1209, 3.4, 704),
        ("Tyreus-Luyben PI", 1.58, 3.06, 74, 1096, 1.4, 689),
        ("SIMC PI", 1.59, 3.14, 61, 715, 6.0, 411),
        ("Ziegler-Nichols PI", 2.78, 1.70, 35, 902, 50.4, 234),
        ("Cohen-Coon PI", 3.66, 1.51, 23, 1266, 74.6, 247),
    )
} | {
    f"{PIDTUNER}, {row[0]}, dial {row[7] if len(row) > 7 else 0.5}, {text(model)}": partial(pidtuner, model, *row)
    for model, rows in {
        EXCHANGER: (
            ("SIMC PI", 33.35091, 25.87279, 16.85086, 1.594883, 9.896871, 61.20646),
            ("AMIGO PID", 43.49184, 14.47664, 23.30403, 1.413299, 10.81529, 59.12155),
            ("CHR setpoint PID", 31.29869, 21.56066, 7.195941, 1.616880, 8.464484, 72.82876),
            ("CHR load PID", 54.91703, 7.153490, 96.29100, 2.181815, 5.504996, 41.76472),
            ("Tyreus-Luyben PID", 30.66600, 20.70184, 15.94625, 2.148439, 5.468966, 73.19932),
            ("Ziegler-Nichols PID", 377.7653, 40.65886, 138.5729, 3.490949, 2.967766, 37.71220),
            ("Ziegler-Nichols PID", 54.11873, 10.07797, 61.35206, 1.560629, 8.988366, 41.09502, 0.0),
            # Sampled so slowly this loop runs away, there as here; Ms and margins are those of the continuous one.
            ("Cohen-Coon PID", 592918.3, 60352.78, 454709.3, 4.059255, 2.647705, 26.22839),
        ),
        TWO_LAGS: (
            ("SIMC PI", 3.390593, 3031.768, 5.115270, 1.396338, 16.25572, 63.50520),
            ("AMIGO PID", 4.898022, 1765.990, 19.89230, 1.177822, 21.79600, 60.17468),
            ("CHR setpoint PID", 3.740338, 2526.474, 4.781574, 1.181028, 19.57234, 75.17247),
            ("CHR load PID", 3.858139, 653.6907, 37.97745, 1.405400, 16.48838, 47.24857),
            ("Tyreus-Luyben PID", 2.538097, 915.9161, 13.14958, 1.548664, 11.11640, 56.19700),
            ("Cohen-Coon PID", 3.283931, 398.8413, 47.23062, 1.645346, 13.76289, 40.86959),
            ("Ziegler-Nichols PID", 5.438054, 1161.303, 40.92402, 1.422621, 19.73733, 43.30424, 0.0),
        ),
    }.items()
    for row in rows
}  # fmt: skip

if __name__ == "__main__":
    for case in CASES.values():
        sys.stdout.write(row(list(case())) + "\n")
