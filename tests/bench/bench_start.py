"""How long `ahgateway --help` takes beside a bare typer program with two commands; the aim is a ratio of 1.2 or less.

Run it as a program: `python tests/bench/bench_start.py`. Runs are interleaved; medians are compared.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time

ROUNDS = 15
BARE = """
import typer
app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
@app.command()
def one() -> None: ...
@app.command()
def two() -> None: ...
app()
"""
OURS = "from ahgateway.cli.main import main; main()"
RATIO_MAX = 1.2


def seconds(program: str) -> float:
    start = time.perf_counter()
    subprocess.run([sys.executable, "-c", program, "--help"], check=True, capture_output=True, timeout=60)
    return time.perf_counter() - start


def main() -> int:
    for program in (BARE, OURS):
        seconds(program)
    took: dict[str, list[float]] = {BARE: [], OURS: []}
    for _ in range(ROUNDS):
        for program, rounds in took.items():
            rounds.append(seconds(program))
    bare, ours = statistics.median(took[BARE]), statistics.median(took[OURS])
    ratio = ours / bare
    sys.stdout.write(f"bare typer {bare * 1e3:.0f} ms, ahgateway --help {ours * 1e3:.0f} ms, ratio {ratio:.2f}\n")
    return 0 if ratio <= RATIO_MAX else 1


if __name__ == "__main__":
    sys.exit(main())
