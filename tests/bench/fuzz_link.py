"""Many random histories of a link on a faulty line; says every one that breaks a law and exits 1.

python tests/bench/fuzz_link.py [--histories 100000] [--first 0]
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from transports.faulty_line import WIRES, faults_of


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--histories", type=int, default=100_000)
    parser.add_argument("--first", type=int, default=0)
    arguments = parser.parse_args()
    broken, started = 0, time.perf_counter()
    for number in range(arguments.histories):
        for said in faults_of(arguments.first + number, list(WIRES)[number % len(WIRES)]):
            broken += 1
            sys.stdout.write(said + "\n")
    took = time.perf_counter() - started
    sys.stdout.write(f"{arguments.histories} histories, {broken} laws broken, {took:.0f} s\n")
    return 1 if broken else 0


if __name__ == "__main__":
    raise SystemExit(main())
