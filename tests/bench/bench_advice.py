"""Does the advice that `identify` prints for an open axis close it, for each axis and value, on the fake PLC?

Run it as a program: `python tests/bench/bench_advice.py [AXIS …]`. An operator takes the advice on a loop that runs in
this dialect, and the search sees the pictures. It prints a line for each walk and ends with 1 when an axis stays open,
or loses its true value. Values that leave the same bits in this dialect must be left together: those of the table, and
`run_off_history` and `first_history` as a pair where the two do the same.
"""

from __future__ import annotations

import asyncio
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from lockstep.advice import Advice, alike, every, walked

from ahgateway.core.dialect_axes import value_name


def outcome(name: str, advice: Advice, value: int) -> tuple[str, bool]:
    """Walk one; what is left of the axis, and whether that is the truth alone."""
    learned = asyncio.run(walked(name, advice, value))
    axis, truth = advice.axis, value_name(advice.axis, value)
    if learned.found.unexplained is not None:
        return f"NOT EXPLAINED at {learned.found.unexplained.number}", False
    left = learned.found.values[axis]
    extra = " crowded" if learned.found.is_crowded else " cut" if learned.found.is_cut else ""
    decided = learned.decided().get(axis)
    wanted = alike(name, advice, value)
    is_right = decided == truth if len(wanted) == 1 else tuple(left) == wanted
    return f"{decided or ' or '.join(value_name(axis, each) for each in left)}{extra}", is_right


def main() -> int:
    wanted, started = set(sys.argv[1:]), time.process_time()
    total = right = 0
    for name, advice, value in every():
        if wanted and advice.axis not in wanted and name not in wanted:
            continue
        shown, is_right = outcome(name, advice, value)
        total, right = total + 1, right + is_right
        mark = "closed" if is_right else "OPEN OR WRONG"
        sys.stdout.write(f"{name} {advice.axis} = {value_name(advice.axis, value)}: {mark}, {shown}\n")
        sys.stdout.flush()
    sys.stdout.write(f"{right} of {total} walks close their axis; {time.process_time() - started:.0f} s of CPU\n")
    return int(right < total or not total)


if __name__ == "__main__":
    sys.exit(main())
