"""`can dump` of a recording: the frames that crossed the bus, decoded with the profile that was recorded with them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ahgateway.cli.main import app
from ahgateway.clock import VirtualClock
from ahgateway.errors import AhGatewayError, ProfileError
from ahgateway.recording.recorder import Recorder
from ahgateway.schema.profile import load

RUNNER = CliRunner()
FRAMES = [  # (ms, direction, identifier and bytes as they are packed: 4 bytes of identifier, then the data)
    (0, ">", "00000603 40 00 20 01 00 00 00 00"),
    (1, "<", "00000583 43 00 20 01 00 00 A0 42"),
    (20, "<", "00000080"),
    (21, "<", "00000283 00 00 00 00 C8 00 00 00"),
    (2000, "<", "00000703 05"),
]


def typed(*words: object) -> tuple[int, str, str]:
    """Run a command; an error of ours is raised as it is."""
    done = RUNNER.invoke(app, [str(word) for word in words])
    if isinstance(done.exception, AhGatewayError):
        raise done.exception
    return done.exit_code, done.stdout, done.stderr


def recorded(path: Path, profile: str, frames: list[tuple[int, str, str]]) -> str:
    clock = VirtualClock()
    tape = Recorder(path, load(profile).station(), clock, {"ahgateway": "0"})
    for ms, direction, packed in frames:
        now_ns = clock.now_ns() + ms * 1_000_000
        tape.frame(direction, bytes.fromhex(packed), now_ns, clock.utc_ns() + ms * 1_000_000)
    tape.close()
    return f"replay://{path}"


def test_recorded_frames_are_decoded_with_the_recorded_profile(tmp_path: Path) -> None:
    """80.0 is 0x42A00000; PDO 283h carries D104 to D107, PID_MODE 0 and CYCLE 200."""
    code, out, said = typed("can", "dump", recorded(tmp_path / "a.ahrec", "can", FRAMES))
    assert (0, "5 frames\n") == (code, said)
    lines = out.splitlines()
    assert lines[0].startswith("00:00:00.000000 > 603 [8] 40 00 20 01 00 00 00 00")
    assert lines[0].endswith("node 3 is asked for 0x2000:01")
    assert lines[1].startswith("00:00:00.001000 < 583 [8] 43 00 20 01 00 00 A0 42")
    assert lines[2].endswith("SYNC")
    assert lines[3].endswith("D104 0000 0000 00C8 0000")
    assert lines[4].endswith("node 3 operational")


def test_a_recorded_frame_is_one_json_object(tmp_path: Path) -> None:
    code, out, _ = typed("can", "dump", recorded(tmp_path / "a.ahrec", "can", FRAMES), "--output", "json", "--count", 1)
    frame, summary = (json.loads(line) for line in out.splitlines())
    assert 0 == code
    assert {"kind": "summary", "recorded": 1} == summary
    assert (">", 0x603, "4000200100000000", "SDO request", 3, 1_767_225_600_000_000_000) == tuple(
        frame[key] for key in ("direction", "id", "data", "service", "node", "utc_ns")
    )


def test_the_duration_is_the_recording_s_own(tmp_path: Path) -> None:
    _, out, _ = typed("can", "dump", recorded(tmp_path / "a.ahrec", "can", FRAMES), "--duration", 1)
    assert 4 == len(out.splitlines())


def test_a_recording_without_frames_is_inconclusive_and_says_how_to_keep_them(tmp_path: Path) -> None:
    code, out, said = typed("can", "dump", recorded(tmp_path / "a.ahrec", "can", []))
    assert (3, "", "0 frames; --record-frames keeps them\n") == (code, out, said)


def test_a_recording_of_another_wire_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ProfileError, match=r"a\.ahrec: was made over fake://demo, its frames are no CAN frames"):
        typed("can", "dump", recorded(tmp_path / "a.ahrec", "demo", FRAMES))
