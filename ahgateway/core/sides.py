"""Where the words that an execution leaves lie beside what was seen.

`sift` and `ticks` are built on it; all three are copied for each law, compiled or not.
"""

from __future__ import annotations

from typing import Any

from ahgateway.core import flags as flag
from ahgateway.core.real import REAL

NEVER = 2
ZERO = REAL(0)
ONE = REAL(1)

# Filled in for each law by `sieve`.
words: Any = None
content: Any = None
extended: Any = False


def side(after: Any, terms: Any, seen: Any, judged: Any, hides: bool) -> int:
    """Where an execution's words lie: -1 below what was seen, 0 on it, 1 above, NEVER where D has no part in it.

    MV rises with D, and I_MV, where D has a part in it, falls.
    """
    pv, i, mv, mout = words(after, terms)
    if judged[0] and not same(pv, seen[0]):
        return NEVER
    if terms.flags & flag.BUMPLESS and judged[1] and not same(i, seen[1]):
        # Where D has a part in it the sum is MV again but for rounding, which goes to and fro with D.
        return -1 if i > seen[1] else (1 if i < seen[1] else NEVER)
    if judged[2] and not same(mv, seen[2]):
        return -1 if mv < seen[2] else (1 if mv > seen[2] else NEVER)
    if judged[1] and not hides and not same(i, seen[1]):
        return -1 if i > seen[1] else (1 if i < seen[1] else NEVER)
    if judged[3] and not same(mout, seen[3]):
        return -1 if mout < seen[3] else (1 if mout > seen[3] else NEVER)
    return 0


def same(left: Any, right: Any) -> bool:
    """Tell whether two REALs have the same bits, where all NaNs are one."""
    if left == right:
        return bool(left != ZERO or ONE / left == ONE / right)
    return bool(left != left and right != right)


def is_open(lowest: Any, highest: Any) -> bool:
    """Tell whether the content is open."""
    return bool(content(lowest) != content(highest))


def remembers_ts(operands: Any) -> bool:
    """Tell whether the interval leaves something hidden."""
    return bool(extended and operands.td_kd > ZERO)
