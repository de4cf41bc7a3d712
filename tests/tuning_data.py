"""Records of known processes: a doublet or a closed-loop run with seeded noise, for tests and benches."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ahgateway.tuning.fit import fit
from ahgateway.tuning.models import Model
from ahgateway.tuning.record import Record
from ahgateway.tuning.runner import delta


def doublet(model: Model, *, noise: float = 0.05, step: float = 5.0, count: int = 600, ts_s: float = 0.5, seed: int = 1,
            drift: float = 0.0, quantum: float = 0.0) -> Record:  # fmt: skip
    """MV one step up at 1/8 of the record, two down at 3/8, one up at 5/8; PV starts at 50, MV at 40."""
    mv = np.full(count, 40.0)
    mv[count // 8 : 3 * count // 8] += step
    mv[3 * count // 8 : 5 * count // 8] -= step
    return answered(model, mv, noise=noise, ts_s=ts_s, seed=seed, drift=drift, quantum=quantum)


def answered(model: Model, mv: np.ndarray, *, position: np.ndarray | None = None, noise: float = 0.05,
             ts_s: float = 0.5, seed: int = 1, drift: float = 0.0, quantum: float = 0.0) -> Record:  # fmt: skip
    """PV of a process that stood still at PV 50 and MV 40; `position` is where the valve really was."""
    moved = mv if position is None else position
    plant, state = model.plant(50.0, float(moved[0]))
    pv = [50.0]
    for u in moved[:-1]:
        state, y = plant.step(state, float(u), ts_s)
        pv.append(y)
    t = np.arange(mv.size) * ts_s
    measured = np.array(pv) + drift * t / t[-1] + noise * np.random.default_rng(seed).standard_normal(mv.size)
    if quantum:
        measured = quantum * np.round(measured / quantum)
    return Record(t, np.full(mv.size, 50.0), measured, mv, "test")


def closed(model: Model, gains: dict[str, float], *, noise: float = 0.05, count: int = 800, ts_s: float = 0.5,
           sv_step: float = 5.0, slow: float = 0.0, seed: int = 1) -> Record:  # fmt: skip
    """A DPIDE loop from rest at PV 50, MV 40; SV goes up at 1/8 and back at 1/2; `slow` is a wandering load on PV."""
    rng = np.random.default_rng(seed)
    runner = delta("DPIDE", {"CYCLE": round(1000 * ts_s), "PID_EQ": True, **gains}, 50.0, 50.0, 40.0)
    plant, state = model.plant(50.0, 40.0)
    y, wander, rows = 50.0, 0.0, []
    for index in range(count):
        sv = 50.0 + (sv_step if count // 8 <= index < count // 2 else 0.0)
        wander = 0.95 * wander + slow * rng.standard_normal()
        pv = y + wander + noise * rng.standard_normal()
        mv = runner.execute(sv, pv)
        rows.append((index * ts_s, sv, pv, mv))
        state, y = plant.step(state, mv, ts_s)
    return Record(*np.array(rows).T, "test")


def coverage(model: Model, noise: float, seeds: Iterable[int], count: int = 600, ts_s: float = 0.5
             ) -> tuple[dict[str, float], dict[str, float]]:  # fmt: skip
    """Share of 95 % intervals that hold the truth, and their mean width over that of 1.96 standard deviations."""
    values: dict[str, list[float]] = {}
    claimed: dict[str, list[float]] = {}
    for seed in seeds:
        found = fit(doublet(model, noise=noise, seed=seed, count=count, ts_s=ts_s), model.kind, noise=False)
        for name, half in found.interval.items():
            values.setdefault(name, []).append(float(getattr(found.model, name)))
            claimed.setdefault(name, []).append(half)
    hits, widths = {}, {}
    for name, found_values in values.items():
        inside = np.abs(np.array(found_values) - getattr(model, name)) <= np.array(claimed[name])
        hits[name] = float(np.mean(inside))
        widths[name] = float(np.mean(claimed[name]) / (1.96 * np.std(found_values)))
    return hits, widths
