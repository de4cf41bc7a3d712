"""Many random histories of a link on a faulty line; exits 1 when one breaks a law or memory grows. Needs Linux.

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

TOLD_EVERY = 500_000
"""Frames between two lines of progress; the first of them is the warm-up that memory is measured from."""
GROWTH_MAX_KIB = 2048


def peak_kib() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=10_000_000)
    parser.add_argument("--first", type=int, default=0)
    arguments = parser.parse_args()
    wires, broken, frames, number, told = list(WIRES), 0, 0, 0, 0
    warm_kib = 0
    while frames < arguments.frames:
        seed, wire = arguments.first + number, wires[number % len(wires)]
        history = History(seed, wire)
        for said in broken_laws(history, history.run(), seed):
            broken += 1
            say(said)
        frames += history.frames
        number += 1
        if frames // TOLD_EVERY > told or frames >= arguments.frames:
            told = frames // TOLD_EVERY
            warm_kib = warm_kib or peak_kib()
            spent = time.process_time()
            say(
                f"seeds {arguments.first}…{seed}: {number} histories, {frames} frames, {broken} laws broken, "
                f"{spent:.0f} s of CPU, memory {warm_kib} -> {peak_kib()} KiB"
            )
    return 1 if broken or peak_kib() - warm_kib > GROWTH_MAX_KIB else 0


if __name__ == "__main__":
    raise SystemExit(main())
