"""A program that records until it is killed; says on stdout what has been committed, one line per commit.

Run as `python kill_writer.py FILE SEED`. Not a test: `test_kill` and the bench kill it.
"""

from __future__ import annotations

import random
import sys
from pathlib import Path

from lockstep.bench_world import World

from ahgateway.clock import SECOND, VirtualClock
from ahgateway.recording.reader import Row
from ahgateway.recording.recorder import Recorder


def main() -> None:
    path, seed = Path(sys.argv[1]), int(sys.argv[2])
    rng = random.Random(seed)
    station = World().station
    clock = VirtualClock()
    tape = Recorder(path, station, clock, {"ahgateway": "0"})
    widths = {operand.name: max(1, operand.words) for operand in station.loops[0].controller.operands}
    tick = 0
    while True:
        for _ in range(40):
            words = {name: tuple(tick & 0xFFFF for _ in range(width)) for name, width in widths.items()}
            tape.row(Row("L1", tick, tick, tick + 1, tick + 2, 0, True, words))
            tape.verdict("L1", tick, f'{{"verdict": "MATCH", "count": {rng.randrange(3)}}}')
            tick += 1
        tape.note(tick, "x" * rng.randrange(20_000))
        tape.flush()
        clock.advance_ns(SECOND)
        sys.stdout.write(f"{tick}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
