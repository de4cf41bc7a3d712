"""The fault catalogue: every fault in so many dialects and seeds, who was convicted, and of what.

    python tests/bench/bench_faults.py [DIALECTS] [SEEDS] [FAULT] [WAY]

Prints one line per fault and law; exits 1 when a fault that changed a bit went free, one was convicted before
anything was wrong, or fewer than 95 % of the causes are right within their class.
"""

from __future__ import annotations

import asyncio
import sys
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from lockstep.fault_catalogue import CASES, is_right, label, tried

from ahgateway.codec.ways import Way


def main() -> int:
    dialects = int(sys.argv[1]) if len(sys.argv) > 1 else 30
    seeds = int(sys.argv[2]) if len(sys.argv) > 2 else 3
    only = sys.argv[3] if len(sys.argv) > 3 else ""
    ways = [Way(sys.argv[4])] if len(sys.argv) > 4 else list(Way)
    return sum(_table(way, dialects, seeds, only) for way in ways)


def _table(way: Way, dialects: int, seeds: int, only: str) -> int:
    """Print one way's table; return 1 when it does not hold."""
    bad = 0
    for name, law in CASES:
        if only not in name:
            continue
        began, changed, convicted, right, false = time.process_time(), 0, 0, 0, 0
        wrong: Counter[str] = Counter()
        for dialect in range(dialects):
            for seed in range(seeds):
                trial = asyncio.run(tried(name, law, dialect, seed, way))
                false += trial.false > 0
                if not trial.changed:
                    continue
                changed += 1
                convicted += trial.convicted > 0
                if is_right(name, trial.suspects):
                    right += 1
                elif trial.convicted:
                    wrong[label(trial.suspects[0])] += 1
                else:
                    wrong[f"free (dialect {dialect} seed {seed}, {trial.changed} changed)"] += 1
        bad += changed - convicted + false + (right < 0.95 * convicted)
        counted = f"runs {dialects * seeds:3} changed {changed:3} convicted {convicted:3} right {right:3} false {false}"
        took = f"{time.process_time() - began:5.1f} s"
        rest = dict(wrong.most_common(5)) or ""
        print(f"{way.value:8} {name:24} {law:6} {counted} {took} {rest}", flush=True)  # noqa: T201
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
