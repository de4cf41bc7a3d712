"""Ctrl-C at every exchange and every pause of what `tune` does at a loop: is anything left changed.

    python tests/bench/bench_moments.py [kind …]

Kinds are the experiments, `gains` (the proof of gains) and `rollback`; all of them without a name. Virtual time. Exit
code 1 when a moment left anything changed, or the journal open.
"""

from __future__ import annotations

import asyncio
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from tune_moments import EVERY, Bench, every, stopped, tuned


def say(text: str) -> None:
    """Write a line at once."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def main() -> int:
    """Stop each kind at every moment; return the exit code."""
    result, is_good = tuned(), True
    for kind in sys.argv[1:] or EVERY:
        begun = time.process_time()
        with tempfile.TemporaryDirectory() as folder:
            bench = Bench(kind, Path(folder), result)
            left, count = asyncio.run(counted(bench))
        is_good = is_good and not left and count > 1
        say(
            f"{kind:<9} {count:>5} moments, {len(left)} left something changed, {time.process_time() - begun:.0f} s CPU"
        )
        for line in left:
            say(f"  {line}")
    say("passed" if is_good else "FAILED")
    return 0 if is_good else 1


async def counted(bench: Bench) -> tuple[list[str], int]:
    """What was left, and at how many moments the work was stopped."""
    chosen: list[int] = []

    def choose(passed: list[str]) -> list[int]:
        chosen.extend(every(passed))
        return chosen

    return await stopped(bench, choose), len(chosen)


if __name__ == "__main__":
    sys.exit(main())
