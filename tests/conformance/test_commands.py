"""The commands as a person types them: real processes, real sockets, real time."""

from __future__ import annotations

import re
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from conformance.peers import AHGATEWAY, followed, plc_process, verdicts
from typer.testing import CliRunner

from ahgateway.cli.main import app

pytestmark = pytest.mark.slow


def run(*arguments: str, timeout_s: float = 200.0) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*AHGATEWAY, *arguments], capture_output=True, text=True, timeout=timeout_s, check=False)


@pytest.fixture
def fake_plc() -> Iterator[str]:
    """The demo's PLC in a process of its own; gives its target."""
    with plc_process("demo") as target:
        yield target


def test_demo_finds_exactly_the_planted_fault_and_its_recording_comes_to_the_same_verdicts(
    patient_machine: None, tmp_path: Path
) -> None:
    """Both ends are in one process: a busy machine makes it longer, not thinner."""
    path = tmp_path / "demo.ahrec"
    done = CliRunner().invoke(app, ["demo", "--record", str(path)])

    assert done.exit_code == 0, done.stdout + done.stderr
    convicted = next(line for line in done.stdout.splitlines() if "DIVERGED:" in line)
    for part in ("TIC-101", "P plc", "ref", "(0x", "cause gain (AHG251): Kc_Kp acts as 2.0", "+1.0"):
        assert part in convicted
    assert "exactly the planted fault was found" in done.stdout
    assert "LIC-201 tick" not in done.stdout
    again = run("replay", str(path), "--diverged")
    assert again.returncode == 1, again.stdout + again.stderr
    listed = next(line for line in again.stdout.splitlines() if "DIVERGED:" in line)
    assert "cause gain (AHG251): Kc_Kp acts as 2.0" in listed
    assert re.fullmatch(r"the same verdicts as then: (\d+) of \1", again.stdout.splitlines()[-1])


def test_demo_ends_cleanly_with_ctrl_c() -> None:
    process = subprocess.Popen([*AHGATEWAY, "demo"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    process.stdout.readline()
    process.send_signal(signal.SIGINT)
    out, said = process.communicate(timeout=60)

    assert process.returncode == 3
    assert "stopped before the end: nothing is claimed" in out
    assert "Traceback" not in said


def test_monitor_follows_a_plc_in_another_process(fake_plc: str) -> None:
    *lines, end = followed(
        "demo", "--target", fake_plc, enough=lambda told: 30 <= verdicts(told, "LIC-201").count("MATCH")
    )
    summaries = {line["loop"]: line for line in lines if line["kind"] == "summary"}
    assert set(summaries) == {"TIC-101", "LIC-201"}
    assert all(line["counts"]["diverged"] == 0 for line in summaries.values())
    assert summaries["LIC-201"]["counts"]["informative"] >= 10
    assert 0 == end["code"], end["said"]


def test_monitor_of_a_wrong_unit_says_so_and_is_inconclusive(fake_plc: str) -> None:
    done = run("monitor", "demo", "--target", fake_plc.replace("unit=1", "unit=9"), "--duration", "2")

    assert done.returncode == 3
    assert "of unit 9" in done.stdout
    assert "check the unit number" in done.stdout


def test_monitor_of_an_unreachable_host_says_so_and_is_inconclusive() -> None:
    done = run("monitor", "demo", "--target", "modbus+tcp://127.0.0.1:9", "--duration", "1")

    assert done.returncode == 3
    assert "connection refused" in done.stdout
    assert "nothing was compared" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("monitor", "nosuch"), "`nosuch` is no file and no shipped name"),
        (("monitor", "demo", "--target", "modbus+tpc://x"), "did you mean `modbus+tcp`?"),
        (("monitor", "demo", "--output", "xml"), "xml"),
        (("fake", "demo", "--tcp", "0", "--fault", "TIC-101:nosuch"), "nosuch"),
    ],
)
def test_wrong_usage_is_named_and_ends_with_2(arguments: tuple[str, ...], said: str) -> None:
    done = run(*arguments)

    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_a_profile_typo_is_named_with_file_key_and_near_name(tmp_path: Path) -> None:
    profile = tmp_path / "line3.toml"
    profile.write_text(
        '[station]\nname = "L"\ntarget = "modbus+tcp://127.0.0.1:502"\n'
        '[loops.A]\ninstrution = "DPID"\nlayout = "manual"\n',
        encoding="utf-8",
    )
    done = run("monitor", str(profile))

    assert done.returncode == 2
    for part in ("line3.toml", "loops.A", "instrution", "instruction"):
        assert part in done.stderr
