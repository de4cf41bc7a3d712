"""`ahgateway read` and `--trace`: devices and operands of the demo's PLC, in every form."""

from __future__ import annotations

import json

import pytest
import typer
from typer.testing import CliRunner

from ahgateway.cli.read import read
from ahgateway.errors import CodecError, ProfileError

app = typer.Typer()
app.command()(read)


def run(*arguments: str) -> str:
    done = CliRunner().invoke(app, list(arguments), catch_exceptions=False)
    assert done.exit_code == 0
    return done.stdout


def values(*arguments: str) -> list[dict[str, object]]:
    return json.loads(run("demo", *arguments, "--output", "json"))["values"]


def test_a_device_is_read_as_the_operand_that_stands_there() -> None:
    assert run("demo", "D100") == "D100  TIC-101 SV  real  80.0 °C  0000 42A0\n"


@pytest.mark.parametrize(
    ("form", "value", "words"),
    [
        ("real", 80.0, [0x0000, 0x42A0]),
        ("dint", 0x42A0_0000, [0x0000, 0x42A0]),
        ("int", 0, [0x0000]),
        ("word", 0, [0x0000]),
        ("bits", [0] * 16, [0x0000]),
    ],
)
def test_the_same_words_in_every_form(form: str, value: object, words: list[int]) -> None:
    (found,) = values("d100", "--as", form)
    assert (value, words, "D100", form) == (found["value"], found["words"], found["device"], found["as"])


def test_a_count_goes_on_by_the_width_of_the_form() -> None:
    found = values("D308", "--as", "real", "--count", "2")
    assert [("D308", "LIC-201 Kp", 4.0), ("D310", "LIC-201 Ki", 0.03999999910593033)] == [
        (each["device"], each["name"], each["value"]) for each in found
    ]


def test_bits_of_words_go_on_into_the_next_word() -> None:
    found = values("D101.14", "--count", "3")  # 0x42A0: bits 15…12 are 0100
    assert [("D101.14", True), ("D101.15", False), ("D102.0", bool)] == [
        (each["device"], each["value"]) if each["device"] != "D102.0" else ("D102.0", type(each["value"]))
        for each in found
    ]


def test_bit_devices_are_on_or_off() -> None:
    assert [("M1", "TIC-101 PID_RUN", True), ("SM400", None, True)] == [
        (each["device"], each["name"], each["value"]) for each in values("M1", "SM400")
    ]


def test_a_loop_shows_every_operand_and_what_the_instruction_keeps() -> None:
    lines = run("demo", "--loop", "LIC-201").splitlines()
    assert 19 == len(lines)
    assert "D300  SV              real   50.0 %                         0000 4248".split() == lines[1].split()
    assert "D306 CYCLE dint 20 × 10 ms 0014 0000".split() == lines[6].split()
    names = [line.split()[1] for line in lines]
    assert ["I_MV", "I_MV[0]", "I_MV[2]", "MV"] == names[-4:]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "say what to read"),
        (("D100", "--loop", "TIC-101"), "say what to read"),
        (("--loop", "TIC-101", "--as", "real"), "belong to devices"),
        (("D100", "--as", "float"), "`float` is not one of real, dint, int, word, bits"),
        (("--loop", "TIC-110"), "TIC-110"),
    ],
)
def test_wrong_usage_is_named(arguments: tuple[str, ...], said: str) -> None:
    with pytest.raises(ProfileError, match=said):
        run("demo", *arguments)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("M1", "--as", "real"), "`M1` is a single bit, it cannot be read as real"),
        (("D29997", "--as", "real", "--count", "2"), "value 2 from `D29997` on, as real, reaches beyond"),
        (("Q7",), "unknown kind of device `Q`"),
    ],
)
def test_what_cannot_be_read_is_named(arguments: tuple[str, ...], said: str) -> None:
    with pytest.raises(CodecError, match=said):
        run("demo", *arguments)


def test_a_trace_holds_every_frame_decoded_behind_what_was_there(tmp_path) -> None:
    path = tmp_path / "frames.txt"
    path.write_text("before\n", encoding="utf-8")
    run("demo", "D100", "--trace", str(path))
    before, head, asked, answered = path.read_text(encoding="utf-8").splitlines()
    assert ("before", "# Demo at fake://demo, unit 1; > out, < in, times in UTC") == (before, head)
    assert asked[15:] == " > 00 01 00 00 00 06 01 03 00 64 00 02  read 2 holding registers from 0x0064 of unit 1"
    assert answered[15:] == " < 00 01 00 00 00 07 01 03 04 00 00 42 a0  unit 1: 0000 42A0"


def test_a_trace_that_cannot_be_written_is_named(tmp_path) -> None:
    with pytest.raises(ProfileError, match="--trace: cannot be written"):
        run("demo", "D100", "--trace", str(tmp_path))
