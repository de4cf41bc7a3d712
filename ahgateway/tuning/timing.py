"""When MV really moved, where its samples only bound that: each large move is shifted as PV's answer to it says.

This file alone decides by how much. A slow poll knows a move of MV to a few tenths of a second; left as it is, that
error looks like a richer process or like a valve that sticks. The shift is the most probable one for white noise in PV
and moves that are equally likely anywhere within what is known (a normal law of the same variance).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ahgateway.tuning.fit import driven, fit
from ahgateway.tuning.models import Kind, Model
from ahgateway.tuning.noise import noise
from ahgateway.tuning.record import Array, Record

LARGE = 0.2
"""A move is one of at least this share of MV's range."""
ROUNDS = 3
MOVES_MAX = 30
"""With more moves than that a controller moves MV, and single moves do not count."""


def timed(record: Record, kind: Kind) -> Record:
    """Return the record with its large moves shifted; as it is where their times are known, or no move stands alone.

    Args:
        record: On its even grid.
        kind: The process that answers; the simplest that may be, for a richer one explains the error away.
    """
    moves = np.diff(record.mv)
    places = np.flatnonzero(np.abs(moves) >= LARGE * float(np.ptp(record.mv)))
    if record.timing_s <= 0.0 or not 0 < places.size <= MOVES_MAX:
        return record
    found, near, total = record, None, np.zeros(places.size)
    for _ in range(ROUNDS):
        near = fit(found, kind, noise=False, near=near)
        columns = np.column_stack([_later(near.model, record, int(at), float(moves[at])) for at in places])
        errors = record.pv - record.pv[0] - near.simulated + columns @ total
        weight = (noise(record.pv) or near.spread or 1e-12) * math.sqrt(3.0) / record.timing_s
        normal = columns.T @ columns + weight**2 * np.eye(places.size)
        total = np.clip(np.linalg.solve(normal, columns.T @ errors), -record.timing_s, record.timing_s)
        acted = record.input.copy()
        # One second later is so much less of the move in the interval that it falls into.
        acted[places] -= moves[places] * total / record.ts_s
        found = replace(record, acted=acted)
    return found


def left_by_timing(record: Record, model: Model) -> float:
    """Return the sum of squares in PV² that is left when each move of MV is off by all that its time is unknown by."""
    moves = np.diff(record.mv)
    if record.timing_s <= 0.0 or not np.any(moves):
        return 0.0
    one = _later(model, record, 0, 1.0) * record.timing_s
    return float(moves @ moves) * float(one @ one)


def _later(model: Model, record: Record, place: int, move: float) -> Array:
    """What PV loses for each second that a move comes later."""
    pulse = np.zeros(record.t_s.size)
    pulse[place] = -move / record.ts_s
    return driven(model, pulse, record.ts_s)
