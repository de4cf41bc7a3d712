"""The allow-list of a profile: what may be written, and what no limit makes right."""

from __future__ import annotations

import pytest

from ahgateway.codec.devices import Device
from ahgateway.codec.station import WriteLimit
from ahgateway.errors import ProfileError
from ahgateway.schema.profile import parse

HEAD = '[station]\nname = "S"\ntarget = "fake://x"\n'
LOOP = '[loops.A]\ninstruction = "DPID"\nlayout = "manual"\n'


def test_what_is_listed_may_be_written_within_its_limits() -> None:
    text = (
        HEAD + LOOP + "[loops.A.write]\nSV = { min = 1.0, max = 2.5, step_max = 0.5 }\nPID_MAN = { interval_s = 3 }\n"
    )
    loop = parse(text, "p").station().loops[0]
    assert {"SV": WriteLimit(1.0, 2.5, 0.5, 1.0), "PID_MAN": WriteLimit(interval_s=3.0)} == dict(loop.writes)


def test_without_a_list_nothing_may_be_written() -> None:
    assert {} == dict(parse(HEAD + LOOP, "p").station().loops[0].writes)


def test_the_scratch_words_are_a_word_device() -> None:
    text = HEAD + 'scratch = "D900"\n' + LOOP
    assert Device("D", 900) == parse(text, "p").station().scratch
    with pytest.raises(ProfileError, match=r"station\.scratch: `M5` is no word"):
        parse(text.replace("D900", "M5"), "p")


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ("SVV = {}", "write.SVV: DPID has no such operand"),
        ("MV = { min = 0.0, max = 1.0, step_max = 1.0 }", "MV is written by the instruction itself"),
        ("I_MV = { min = 0.0, max = 1.0, step_max = 1.0 }", "I_MV is written by the instruction itself"),
        ("PV = { min = 0.0, max = 1.0, step_max = 1.0 }", 'only on a station of kind = "bench"'),
        ("PID_RUN = {}", 'only on a station of kind = "bench"'),
        ("SV = { min = 0.0, max = 1.0 }", "SV also needs step_max"),
        ("SV = { min = 2.0, max = 1.0, step_max = 1.0 }", "min 2 is above max 1"),
        ("CYCLE = { min = 0.5, max = 5, step_max = 1 }", "0.5 is no whole number, as DINT needs"),
        ("PID_MAN = { max = 1.0 }", "PID_MAN is a BOOL and has no limits"),
    ],
)
def test_what_no_limit_makes_right_is_refused(entry: str, said: str) -> None:
    with pytest.raises(ProfileError) as caught:
        parse(f"{HEAD}{LOOP}[loops.A.write]\n{entry}\n", "p")
    assert said in str(caught.value)


def test_a_bench_takes_pv() -> None:
    text = HEAD + 'kind = "bench"\n' + LOOP + "[loops.A.write]\nPV = { min = 0.0, max = 1.0, step_max = 1.0 }\n"
    assert {"PV"} == set(parse(text, "p").station().loops[0].writes)


def test_a_constant_a_shared_operand_and_a_bit_in_a_word_are_never_written() -> None:
    other = LOOP.replace("[loops.A]", "[loops.B]") + 'data = "D300"\nflags = "M21"\n'
    places = '[loops.{}.operands]\nSV = "D900"\nKd = {{ const = 0.5 }}\nPID_MAN = "D7.3"\n'
    limits = "{ min = 0.0, max = 1.0, step_max = 1.0 }"
    text = HEAD + LOOP + places.format("A") + f"[loops.A.write]\nSV = {limits}\nKd = {limits}\nPID_MAN = {{}}\n"
    with pytest.raises(ProfileError) as caught:
        parse(text + other + '[loops.B.operands]\nSV = "D900"\n', "p")
    assert "SV is shared with another loop" in str(caught.value)
    assert "Kd is a constant of the program" in str(caught.value)
    assert "PID_MAN is a bit inside the word at `D7.3`" in str(caught.value)
