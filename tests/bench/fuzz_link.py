"""Many random histories of a link on a faulty line; says every one that breaks a law and exits 1. Needs Linux.

python tests/bench/fuzz_link.py [--frames 10000000] [--first 0]
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from transports.faulty_line import WIRES, History, broken_laws


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=10_000_000)
    parser.add_argument("--first", type=int, default=0)
    arguments = parser.parse_args()
    wires, broken, frames, number, started = list(WIRES), 0, 0, 0, time.perf_counter()
    begun_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    while frames < arguments.frames:
        seed, wire = arguments.first + number, wires[number % len(wires)]
        history = History(seed, wire)
        for said in broken_laws(history, history.run(), seed):
            broken += 1
            sys.stdout.write(said + "\n")
        frames += history.frames
        number += 1
    took = time.perf_counter() - started
    peak_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    sys.stdout.write(
        f"{number} histories, {frames} frames, {broken} laws broken, {took:.0f} s, "
        f"memory {begun_kib} -> {peak_kib} KiB\n"
    )
    return 1 if broken else 0


if __name__ == "__main__":
    raise SystemExit(main())
