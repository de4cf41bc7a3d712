"""The fault catalogue: every fault in so many dialects and seeds, in each way of seeing executions.

    python tests/bench/bench_faults.py [DIALECTS] [SEEDS] [FAULT] [WAY] [FIRST]

With `turn` for SEEDS each dialect is tried with one of three, another one in each way, and with every third fault: a
ninth of the work that touches every dialect, seed, way and fault. Interrupted, it prints what it has.

Where it is proven on the run itself that nothing in it could have shown more, the line says so: `unseen` when no
execution that changed a word was looked at, `excused` when enumeration finds that the right law can have left every
picture, `tied` when the cause that was named stands beside the true one, and both laws leave every bit of the PLC's own
log, the unseen executions included.

A loop runs well once for each way, law, dialect and seed, then goes wrong in every way there is, each in a process of
its own that begins where it stood; in one more (`none`) nothing goes wrong, but an operator works on it. Prints one
line per fault and law; exits 1 when a fault went free though an execution was looked at whose words it changed, when
one was convicted where nothing was wrong, or when fewer than 95 % of the causes are right within their class.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
import time
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from lockstep.bench_world import World
from lockstep.fault_catalogue import CASES, go_on, go_wrong, label, warm

from ahgateway.codec.ways import Way

BAR = 0.95


@dataclass
class Line:
    """What came of one fault in one law, over all dialects and seeds."""

    runs: int = 0
    changed: int = 0
    unseen: int = 0
    excused: int = 0
    convicted: int = 0
    right: int = 0
    tied: int = 0
    false: int = 0
    cpu_s: float = 0.0
    wrong: Counter[str] = field(default_factory=Counter)

    @property
    def is_good(self) -> bool:
        is_convicted = self.changed - self.unseen - self.excused <= self.convicted
        return is_convicted and not self.false and self.right + self.tied >= BAR * self.convicted


def main() -> int:
    dialects = int(sys.argv[1]) if len(sys.argv) > 1 else 30
    seeds = sys.argv[2] if len(sys.argv) > 2 else "3"
    only = sys.argv[3] if len(sys.argv) > 3 else ""
    ways = [Way(sys.argv[4])] if len(sys.argv) > 4 and sys.argv[4] else list(Way)
    first = int(sys.argv[5]) if len(sys.argv) > 5 else 0
    return sum(_table(way, range(first, first + dialects), seeds, only) for way in ways)


def _table(way: Way, dialects: range, seeds: str, only: str) -> int:
    """Print one way's table; return 1 when it does not hold."""
    lines: dict[tuple[str, str], Line] = defaultdict(Line)
    try:
        _fill(lines, way, dialects, seeds, only)
    except KeyboardInterrupt:
        print("interrupted")  # noqa: T201
    for (name, law), line in sorted(lines.items()):
        counted = (
            f"runs {line.runs:3} changed {line.changed:3} unseen {line.unseen:2} excused {line.excused:2} "
            f"convicted {line.convicted:3} right {line.right:3} tied {line.tied:2}"
        )
        rest = dict(line.wrong.most_common(6)) or ""
        print(f"{way.value:8} {name:24} {law:6} {counted} false {line.false} {line.cpu_s:5.1f} s {rest}")  # noqa: T201
    convicted, right, tied = (
        sum(getattr(each, name) for each in lines.values()) for name in ("convicted", "right", "tied")
    )
    share = (right + tied) / convicted if convicted else 0.0
    print(f"{way.value:8} causes right: {right} and tied {tied} of {convicted}, {share:.1%}", flush=True)  # noqa: T201
    return 0 if all(line.is_good for line in lines.values()) else 1


def _fill(lines: dict[tuple[str, str], Line], way: Way, dialects: range, seeds: str, only: str) -> None:
    for dialect in dialects:
        turn = [(dialect + list(Way).index(way)) % 3]
        for law in sorted({law for name, law in CASES if only in name}):
            for seed in turn if seeds == "turn" else range(int(seeds)):
                world = asyncio.run(warm(law, dialect, seed, way))
                names = [name for name, suited in CASES if suited == law and only in name]
                if not only:
                    _note(lines["none", law], _forked(world, ""), f"dialect {dialect} seed {seed}")
                # Another third of the faults with the next dialect, and with the same one under the next law.
                for name in names[(dialect + len(law)) % 3 :: 3] if seeds == "turn" else names:
                    _note(lines[name, law], _forked(world, name), f"dialect {dialect} seed {seed}")


def _forked(world: World, name: str) -> dict[str, int | str | float]:
    """Let the loop go wrong in a process of its own, so that every fault begins from the same place."""
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        os.close(reader)
        found: dict[str, int | str | float] = {"failed": name}
        try:
            began = time.process_time()
            trial = asyncio.run(go_wrong(world, name) if name else go_on(world))
            found = {
                "changed": trial.changed,
                "seen": trial.seen,
                "convicted": trial.convicted,
                "false": trial.false,
                "is_right": trial.is_right,
                "is_tied": trial.is_tied,
                "is_excused": trial.is_excused,
                "label": label(trial.suspects[0]) if trial.suspects else "",
                "cpu_s": time.process_time() - began,
            }
        finally:
            os.write(writer, json.dumps(found).encode())
            # No clean-up here: files and links are the parent's.
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        answer: dict[str, int | str | float] = json.loads(pipe.read())
    os.waitpid(child, 0)
    if "failed" in answer:
        raise RuntimeError(f"{name}: the trial came to no end")
    return answer


def _note(line: Line, found: dict[str, int | str | float], where: str) -> None:
    line.runs += 1
    line.cpu_s += float(found["cpu_s"])
    line.false += bool(found["false"])
    if found["false"]:
        line.wrong[f"false: {found['label']} ({where})"] += 1
    if not found["changed"]:
        return
    line.changed += 1
    line.convicted += bool(found["convicted"])
    line.unseen += not found["seen"] and not found["convicted"]
    if not found["convicted"]:
        line.excused += bool(found["is_excused"])
        if found["seen"] and not found["is_excused"]:
            line.wrong[f"free ({where}, {found['seen']} of {found['changed']} changed seen)"] += 1
    elif found["is_right"]:
        line.right += 1
    elif found["is_tied"]:
        line.tied += 1
    else:
        line.wrong[f"{found['label']} ({where})"] += 1


if __name__ == "__main__":
    sys.exit(main())
