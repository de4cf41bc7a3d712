"""A program that records on a disk that is full: no file of its own may grow beyond a limit of the system.

Run as `python full_writer.py FILE LIMIT`; prints one JSON object. Not a test: `test_full_disk` runs it, on Linux.
"""

from __future__ import annotations

import json
import resource
import sys
from pathlib import Path

from lockstep.bench_world import World

from ahgateway.clock import SECOND, VirtualClock
from ahgateway.recording.reader import Row
from ahgateway.recording.recorder import Recorder

SECONDS = 60


def main() -> None:
    path, limit = Path(sys.argv[1]), int(sys.argv[2])
    station = World().station
    clock = VirtualClock()
    tape = Recorder(path, station, clock, {"ahgateway": "0"})
    widths = {operand.name: max(1, operand.words) for operand in station.loops[0].controller.operands}
    kept: list[int] = []
    news: list[str] = []

    def record(tick: int) -> None:
        words = {name: (tick & 0xFFFF,) * width for name, width in widths.items()}
        tape.row(Row("L1", tick, tick, tick + 1, tick + 2, 0, True, words))
        tape.note(tick, "".join(chr(33 + (tick * 7 + place * place) % 90) for place in range(20_000)))
        before = tape.figures.rows
        tape.flush()
        kept.extend([tick] if tape.figures.rows > before else [])
        news.extend(tape.news())
        clock.advance_ns(SECOND)

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    for tick in range(SECONDS):
        record(tick)
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    record(SECONDS)
    tape.close()
    sys.stdout.write(json.dumps({"kept": kept, "news": [*news, *tape.news()], "dropped": tape.figures.dropped}))


if __name__ == "__main__":
    main()
