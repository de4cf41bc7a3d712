"""Ctrl-C at any moment of `tune`, in real processes over a real socket: nothing is left changed in the PLC."""

from __future__ import annotations

import contextlib
import json
import os
import random
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

AHGATEWAY = [sys.executable, "-m", "ahgateway.cli.main"]
PROFILE = """
[station]
name = "Quick"
target = "modbus+tcp://127.0.0.1:1"
unit = 1
device_map = "ah500"
running = "SM400"

[loops.TIC-1]
instruction = "DPIDE"
layout = "manual"
ranges = { pv = [0.0, 200.0], mv = [0.0, 100.0] }
scan_ms_max = 5

[loops.TIC-1.fake]
plant = { kind = "fopdt", gain = 1.5, tau_s = 0.6, dead_time_s = 0.1, bias = 20.0, noise = 0.02, initial = 80.0 }

[loops.TIC-1.fake.initial]
SV = 80.0
CYCLE = 50
Kc_Kp = 0.3
Ti_Ki = 0.5
MV_MAX = 100.0
MV_MIN = 0.0

[loops.TIC-1.write]
SV = { min = 20.0, max = 150.0, step_max = 10.0, interval_s = 0.0 }
Kc_Kp = { min = 0.01, max = 50.0, step_max = 50.0, interval_s = 0.0 }
Ti_Ki = { min = 0.0, max = 50.0, step_max = 50.0, interval_s = 0.0 }
Td_Kd = { min = 0.0, max = 20.0, step_max = 10.0, interval_s = 0.0 }
Tf = { min = 0.0, max = 10.0, step_max = 5.0, interval_s = 0.0 }
MV_MAX = { min = 0.0, max = 100.0, step_max = 100.0, interval_s = 0.0 }
MV_MIN = { min = 0.0, max = 100.0, step_max = 100.0, interval_s = 0.0 }
MOUT = { min = 0.0, max = 100.0, step_max = 20.0, interval_s = 0.0 }
PID_MAN = { interval_s = 0.0 }
PID_MODE = { min = 0, max = 1, step_max = 1, interval_s = 0.0 }
"""
MOMENTS = int(os.environ.get("AHG_MOMENTS", "3"))
LENGTH_S = {"doublet": 9.0, "autotune": 4.5}
"""About how long the whole command runs on two idle cores; later moments find it ended, which is a moment too."""


@pytest.fixture(scope="module")
def plc(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, int]]:
    """A PLC with a quick process in a process of its own; gives its profile and port."""
    profile = tmp_path_factory.mktemp("quick") / "quick.toml"
    profile.write_text(PROFILE, encoding="utf-8")
    process = subprocess.Popen(
        [*AHGATEWAY, "fake", str(profile), "--tcp", "0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    try:
        assert process.stdout is not None
        yield profile, int(process.stdout.readline())
    finally:
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=60)


def settings(port: int) -> tuple[bytes, int]:
    """Words of SV, PID_MODE … MV_MIN (D100…D119, PV left out) and the flags M1…M6, asked for by hand-made frames."""
    with socket.create_connection(("127.0.0.1", port), timeout=60) as line:
        stream = line.makefile("rb")
        line.sendall(struct.pack(">HHHBBHH", 1, 0, 6, 1, 3, 100, 20))
        words = stream.read(9 + 40)[9:]
        line.sendall(struct.pack(">HHHBBHH", 2, 0, 6, 1, 1, 1, 6))
        flags = stream.read(10)[9]
    return words[:4] + words[8:], flags


@pytest.mark.parametrize("experiment", ["doublet", "autotune"])
def test_ctrl_c_at_any_moment_leaves_nothing_changed(plc: tuple[Path, int], tmp_path: Path, experiment: str) -> None:
    profile, port = plc
    before = settings(port)
    moments = random.Random(experiment)
    command = [
        *AHGATEWAY, "tune", str(profile), "--target", f"modbus+tcp://127.0.0.1:{port}?unit=1", "--arm", "TIC-1",
        "--experiment", experiment, "--pv-bounds", "50", "110", "--seconds", "60", "--directory", str(tmp_path),
    ]  # fmt: skip
    for _ in range(MOMENTS):
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(moments.uniform(0.3, LENGTH_S[experiment]))
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=120)
        assert before == settings(port), said
        # While Python itself still starts, Ctrl-C is its own to answer, and nothing has begun.
        assert "Traceback" not in said or process.returncode == -signal.SIGINT
        assert process.returncode in (0, 2, 3, 130, -signal.SIGINT), said
        for path in tmp_path.glob("*.jsonl"):
            last = json.loads(path.read_text(encoding="utf-8").splitlines()[-1])
            assert ("ended", "restored") == (last["kind"], last["how"])


def test_a_ctrl_c_that_python_drops_in_a_callback_of_its_own_is_repeated() -> None:
    """Imports run callbacks in which an exception is only printed; `__del__` is another such place."""
    program = """
import sys, time
from ahgateway.cli import main
sys.unraisablehook = main._ask_again
class Gone:
    def __del__(self):
        raise KeyboardInterrupt
try:
    Gone()
    time.sleep(200.0)
except KeyboardInterrupt:
    print("asked again")
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=100, check=False)
    assert ("asked again\n", "", 0) == (done.stdout, done.stderr, done.returncode)
