"""A line drawn in characters: 2 by 4 dots in each cell with Braille, one with plain ASCII; pure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]], np.int64)
BRAILLE = 0x2800
SPAN_MIN = 1e-6
"""A range narrower than this share of its values is widened: noise in the last bit is not drawn as a mountain."""


def value_range(*curves: Array) -> tuple[float, float]:
    """Return lowest and highest finite value of the curves with a margin, never an empty range."""
    values = np.concatenate([curve[np.isfinite(curve)] for curve in curves])
    if not values.size:
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    scale = max(abs(low), abs(high), 1e-3)
    margin = 0.05 * (high - low) if high - low > SPAN_MIN * scale else 0.005 * scale
    return low - margin, high + margin


def dots(
    t_s: Array, y: Array, times: tuple[float, float], values: tuple[float, float], width: int, height: int
) -> NDArray[np.bool_]:
    """Return which dots a curve covers: rows from the top, `4 * height` by `2 * width`.

    Samples are joined by straight lines; a NaN breaks the line. A column covers all that the curve passes in its
    time; one that the curve enters but does not leave holds its samples only.
    """
    columns, rows = 2 * width, 4 * height
    grid = np.zeros((rows, columns), bool)
    if t_s.size == 0:
        return grid
    edges = np.linspace(times[0], times[1], columns + 1)
    at_edges = np.interp(edges, t_s, y, left=np.nan, right=np.nan)
    low = np.minimum(at_edges[:-1], at_edges[1:])
    high = np.maximum(at_edges[:-1], at_edges[1:])
    place = np.searchsorted(edges, t_s, side="right") - 1
    inside = np.isfinite(y) & (place >= 0) & (t_s <= times[1])
    place = np.minimum(place[inside], columns - 1)
    np.fmin.at(low, place, y[inside])
    np.fmax.at(high, place, y[inside])
    drawn = np.isfinite(low)
    scale = rows / (values[1] - values[0])
    top = np.clip(np.floor((values[1] - np.where(drawn, high, values[0])) * scale), 0, rows - 1)
    bottom = np.clip(np.floor((values[1] - np.where(drawn, low, values[0])) * scale), 0, rows - 1)
    row = np.arange(rows)[:, None]
    found: NDArray[np.bool_] = drawn & (row >= top) & (row <= bottom)
    return found


def cells(grid: NDArray[np.bool_], *, plain: bool) -> list[str]:
    """Return a grid of dots as lines of text; `plain` uses `*` instead of Braille."""
    rows, columns = grid.shape
    blocks = grid.reshape(rows // 4, 4, columns // 2, 2).swapaxes(1, 2)
    if plain:
        passed = np.asarray(blocks.any(axis=(2, 3))).tolist()
        return ["".join("*" if cell else " " for cell in line) for line in passed]
    codes = (blocks * DOTS).sum(axis=(2, 3))
    return ["".join(chr(BRAILLE + code) if code else " " for code in line) for line in codes.tolist()]


def marks(
    t_s: Array, y: Array, times: tuple[float, float], values: tuple[float, float], width: int, height: int, sign: str
) -> list[str]:
    """Return a curve as one sign in each cell that it passes: a line that differs by shape, not by colour."""
    grid = dots(t_s, y, times, values, width, height)
    blocks = grid.reshape(height, 4, width, 2).swapaxes(1, 2)
    return ["".join(sign if cell else " " for cell in line) for line in np.asarray(blocks.any(axis=(2, 3))).tolist()]
