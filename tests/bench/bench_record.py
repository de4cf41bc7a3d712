"""Recording's cost beside CSV and Parquet in the same run, and two hundred kills.

Run it as a program: `python tests/bench/bench_record.py [KILLS]`. A hundred DPIDE loops at ten pictures a second with
noisy PV, integrals and MV that follow, constant parameters and an undisturbed clock's jitter. Rounds are interleaved;
ratios are the numbers to keep. What a live run has ready (pictures, verdict texts) is ready here too.
"""

from __future__ import annotations

import csv
import random
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from lockstep.bench_world import DEVICES, bindings
from recording.test_kill import assert_sound, killed

from ahgateway.clock import MILLISECOND, SECOND, VirtualClock
from ahgateway.codec import block
from ahgateway.codec.station import Loop, Station
from ahgateway.codec.words import real_words
from ahgateway.core.controllers import DPIDE
from ahgateway.core.real import REAL
from ahgateway.recording.reader import Recording, Row
from ahgateway.recording.recorder import Recorder

LOOPS = 100
HERTZ = 10
SECONDS = 60
ROUNDS = 3
MATCH = '{"verdict": "MATCH", "proof": "bits", "class": "informative", "count": 1, "reason": ""}'


def station() -> Station:
    loops = tuple(
        Loop(f"TIC-{number}", DPIDE, bindings(DPIDE, 200 * number, 20 * number + 1, 200 * number + 100, {}))
        for number in range(LOOPS)
    )
    return Station("bench", "memory:", 1, DEVICES, loops)


def rows() -> list[Row]:
    """One minute of pictures; the controller's words follow its law, so that they compress no better than in life."""
    rng = random.Random(1)
    found: list[Row] = []
    state = [DPIDE.state() for _ in range(LOOPS)]
    base = block.defaults(DPIDE)
    level = [rng.uniform(20.0, 80.0) for _ in range(LOOPS)]
    dialect, ts = DPIDE.dialect, REAL(0.1)
    with np.errstate(all="ignore"):
        for tick in range(SECONDS * HERTZ):
            for number in range(LOOPS):
                level[number] += rng.gauss(0.0, 0.02)
                inputs = DPIDE.inputs(sv=REAL(50), pv=REAL(level[number]), ti_ki=REAL(0.05))
                state[number], _ = DPIDE.step(inputs, state[number], dialect, ts)
                memory = list(base["I_MV"])
                memory[0:2] = real_words(state[number].i)
                memory[12:14] = real_words(state[number].pv1)
                words = {
                    **base,
                    "SV": real_words(REAL(50)),
                    "PV": real_words(inputs.pv),
                    "Ti_Ki": real_words(inputs.ti_ki),
                    "I_MV": tuple(memory),
                    "MV": real_words(state[number].mv),
                }
                sent = tick * 100 * MILLISECOND + number * 700_000 + rng.randrange(200_000)
                last = sent + 400_000 + rng.randrange(100_000)
                found.append(Row(f"TIC-{number}", tick, sent, last, last + 10**18 + rng.randrange(300), 0, True, words))
    return found


def recorded(found: list[Row], path: Path) -> None:
    clock = VirtualClock()
    tape = Recorder(path, station(), clock, {"ahgateway": "bench"})
    for at, row in enumerate(found, 1):
        tape.row(row)
        tape.verdict(row.loop, row.tick, MATCH)
        if at % (LOOPS * HERTZ) == 0:
            tape.flush()
            clock.advance_ns(SECOND)
    tape.close()


def as_csv(found: list[Row], path: Path) -> None:
    with path.open("w", newline="") as handle:
        writer = csv.writer(handle)
        for row in found:
            reals = np.array([*row.words["PV"], *row.words["MV"], *row.words["I_MV"]], np.uint16).view(np.float32)
            rest = [word for name in row.words for word in row.words[name] if name not in ("PV", "MV", "I_MV")]
            writer.writerow([row.utc_ns, row.loop, row.tick, *map(str, reals), *rest, "MATCH"])


def as_parquet(found: list[Row], path: Path) -> None:
    """Row groups of a minute, zstd: small, and unreadable after a kill."""
    names = list(found[0].words)
    columns = {
        "utc_ns": pa.array([row.utc_ns for row in found]),
        "loop": pa.array([row.loop for row in found]).dictionary_encode(),
        "tick": pa.array([row.tick for row in found]),
    }
    for name in names:
        for place in range(len(found[0].words[name])):
            columns[f"{name}{place}"] = pa.array([row.words[name][place] for row in found], pa.uint16())
    columns["verdict"] = pa.array(["MATCH"] * len(found)).dictionary_encode()
    pq.write_table(pa.table(columns), path, compression="zstd")


def main() -> None:
    kills = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    found = rows()
    writers: dict[str, Callable[[list[Row], Path], None]] = {
        "recording": recorded,
        "csv": as_csv,
        "parquet": as_parquet,
    }
    took: dict[str, list[float]] = {name: [] for name in writers}
    sizes: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        for number in range(ROUNDS):
            for name, write in writers.items():
                path = Path(folder) / f"{number}.{name}"
                start = time.process_time()
                write(found, path)
                took[name].append((time.process_time() - start) / len(found))
                sizes[name] = path.stat().st_size / len(found)
        with Recording(Path(folder) / "0.recording") as recording:
            assert len(found) == sum(1 for _ in recording.rows())
        for name, each in took.items():
            row_us = statistics.median(each) * 1e6
            share = row_us * LOOPS * HERTZ / 1e6
            sys.stdout.write(
                f"{name:10s} {sizes[name]:6.1f} B/row  {row_us:6.2f} us CPU/row  {share:6.2%} of a core at 1000/s\n"
            )
        rng = random.Random(2)
        for seed in range(kills):
            path = Path(folder) / f"kill{seed}.ahrec"
            assert_sound(path, killed(path, seed, rng.randrange(1, 300)))
        sys.stdout.write(f"{kills} kills: every file opened, every commit was there\n")


if __name__ == "__main__":
    main()
