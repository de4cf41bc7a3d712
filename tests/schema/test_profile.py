import contextlib
import re
import tomllib

import pytest
import tomlkit
from hypothesis import given, settings
from hypothesis import strategies as st

from ahgateway.codec.devices import Device
from ahgateway.codec.station import Const, FakeLoop, Pacing, PlantSpec, Tolerance
from ahgateway.core.dialect import Dialect, Freeze, RunOff
from ahgateway.errors import ProfileError
from ahgateway.schema import device_map, files, profile
from ahgateway.schema.forms import ProfileForm

STATION = '[station]\nname = "S"\ntarget = "modbus+tcp://192.0.2.10"\n'
LOOP = STATION + '[loops.A]\ninstruction = "DPID"\nlayout = "manual"\n'


def devices(loop) -> dict[str, str]:
    return {name: str(binding) for name, binding in loop.bindings.items()}


def errors(text: str) -> str:
    with pytest.raises(ProfileError) as caught:
        profile.parse(text, "line.toml")
    return caught.value.message + (f" | {caught.value.hint}" if caught.value.hint else "")


def test_the_manual_layout_of_dpid_is_the_manuals_example() -> None:
    assert devices(profile.parse(LOOP, "f").station().loops[0]) == {
        "PID_RUN": "M1",
        "SV": "D100",
        "PV": "D102",
        "PID_MODE": "D104",
        "PID_MAN": "M2",
        "MOUT_AUTO": "M3",
        "CYCLE": "D106",
        "Kp": "D108",
        "Ki": "D110",
        "Kd": "D112",
        "PID_DIR": "M4",
        "ERR_DBW": "D114",
        "MV_MAX": "D116",
        "MV_MIN": "D118",
        "MOUT": "D120",
        "I_MV": "D122",
        "MV": "D200",
    }


def test_the_manual_layout_of_dpide_puts_its_memory_at_d126() -> None:
    loop = profile.load("single").station().loops[0]
    assert loop.bindings["BIAS"] == Device("D", 124)
    assert loop.bindings["I_MV"] == Device("D", 126)
    assert loop.bindings["MV"] == Device("D", 200)


def test_a_layout_moves_and_an_operand_written_out_beats_it() -> None:
    text = LOOP + 'data = "D300"\nflags = "Y0.14"\noperands = { PV = "d50", Kd = { const = 0.5 }, PID_MAN = "D7.3" }\n'
    made = profile.parse(text, "f")
    bindings = made.station().loops[0].bindings
    assert bindings["SV"] == Device("D", 300)
    assert bindings["MV"] == Device("D", 400)
    assert bindings["PV"] == Device("D", 50)
    assert bindings["Kd"] == Const(0.5)
    assert bindings["PID_MAN"] == Device("D", 7, 3)
    assert bindings["PID_RUN"] == Device("Y", 0, 14)
    assert bindings["PID_DIR"] == Device("Y", 1, 1)
    assert made.bound["A"]["PV"].origin == "profile"
    assert made.bound["A"]["SV"].origin == "layout"


def test_every_setting_arrives_in_the_station() -> None:
    text = """
        [station]
        name = "Line 3"
        target = "modbus+rtu://COM3?baud=115200"
        unit = 7
        kind = "bench"
        running = "SM400"
        pacing = { reply_timeout_ms = 300, words_per_request_max = 60, poll_ms = 20, gap_words_max = 4 }
        [loops.TIC-101]
        instruction = "DPID"
        layout = "manual"
        en = "M10"
        scan_ms_max = 25
        dialect = { freeze = "outward", run_off = "clear" }
        evidence = { by = "J. Kim", date = "2026-03-01", executions = 5000, firmware = "V1.02" }
        tolerance = { ulp_max = 2, mv_max = 0.5 }
        units = { pv = "°C" }
        ranges = { pv = [0, 200.0], mv = [0.0, 100.0] }
    """
    station = profile.parse(text, "f").station()
    loop = station.loops[0]
    assert (station.name, station.target, station.unit, station.bench) == (
        "Line 3",
        "modbus+rtu://COM3?baud=115200",
        7,
        True,
    )
    assert station.running == Device("SM", 400)
    assert station.pacing == Pacing(300, 60, 1, 0, 0, 20, 4)
    assert (loop.name, loop.en, loop.scan_ms_max) == ("TIC-101", Device("M", 10), 25)
    assert loop.dialect == Dialect(freeze=Freeze.OUTWARD, run_off=RunOff.CLEAR)
    assert loop.tolerance == Tolerance(2, 0.5)
    assert (loop.pv_unit, loop.mv_unit) == ("°C", "%")
    assert (loop.pv_range, loop.mv_range) == ((0.0, 200.0), (0.0, 100.0))


def test_the_forms_defaults_are_those_of_the_station() -> None:
    station = profile.parse(LOOP, "f").station()
    assert station.pacing == Pacing()
    assert station.running is None
    assert station.unit == 1
    assert station.loops[0].tolerance == Tolerance()
    assert station.loops[0].scan_ms_max == 10


def test_the_station_number_may_stand_in_the_target() -> None:
    assert profile.parse(LOOP.replace("2.10", "2.10?unit=9"), "f").station().unit == 9


def test_the_demo_has_two_loops_with_their_plants() -> None:
    demo = profile.load("demo")
    assert [loop.name for loop in demo.station().loops] == ["TIC-101", "LIC-201"]
    fakes = demo.fake_setup()
    assert fakes["TIC-101"].initial["CYCLE"] == 200
    assert fakes["LIC-201"].initial["CYCLE"] == 20
    assert fakes["LIC-201"].plant == PlantSpec("integrating", 0.02, 0.0, 1.0, -0.8, 0.01, 45.0)


def test_a_loop_without_a_fake_table_starts_from_the_defaults() -> None:
    assert profile.parse(LOOP, "f").fake_setup() == {"A": FakeLoop({}, None)}


def test_a_cascade_shares_a_register_and_says_so() -> None:
    text = (
        LOOP + '[loops.B]\ninstruction = "DPID"\nlayout = "manual"\n'
        'data = "D300"\nflags = "M21"\noperands = { SV = "D200" }\n'
    )
    master, slave = profile.parse(text, "f").station().loops
    assert master.shared == frozenset({"MV"})
    assert slave.shared == frozenset({"SV"})


def test_one_zero_register_may_serve_several_inputs_of_a_loop() -> None:
    text = LOOP + 'operands = { Kd = "D50", ERR_DBW = "D50", MV_MIN = "D50" }\n'
    assert profile.parse(text, "f").station().loops[0].shared == frozenset()


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        (LOOP + 'lay = "x"', ["line.toml: loops.A.lay: unknown key", "did you mean `layout`?"]),
        (LOOP.replace("name", "nam"), ["station.nam: unknown key", "station.name: is missing"]),
        (LOOP.replace("DPID", "DIPD"), ['loops.A.instruction: "DIPD"', "known are DPID, DPIDE", "`DPID`"]),
        (LOOP + 'operands.SVV = "D1"', ["loops.A.operands.SVV: DPID has no such operand", "did you mean `SV`?"]),
        (LOOP + 'operands.SV = "DD1"', ["loops.A.operands.SV: `DD1`: unknown kind of device `DD`"]),
        (LOOP + 'operands.SV = "D65000"', ["loops.A.operands.SV: `D65000` is outside", "D0…D29999, D30000…D40959"]),
        (LOOP + 'operands.SV = "D30010"', ["SV at `D30010`: PID operands belong in D0…D29999"]),
        (LOOP + 'operands.SV = "D29999"', ["SV takes 2 words from `D29999` on, but D0…D29999 ends before that"]),
        (LOOP + 'operands.PID_RUN = "D100"', ["PID_RUN is a BOOL, `D100` is a word", "`D100.0`"]),
        (LOOP + 'operands.SV = "M1"', ["SV is a REAL of 2 words, `M1` is a bit"]),
        (LOOP + 'operands.SV = "X0.3"', ["SV is a REAL of 2 words, `X0.3` is a bit"]),
        (LOOP + 'operands.MV = "X3"', ["MV is written by the instruction, but X0…X511 is read-only"]),
        (LOOP + "operands.SV = 3", ["loops.A.operands.SV: 3 is neither a device name in quotes nor a table"]),
        (LOOP + "operands.SV = {}", ["needs either a device or a const"]),
        (LOOP + "operands.CYCLE = { const = 2001 }", ["CYCLE is 2001, allowed 1…2000 in units of 10 ms"]),
        (LOOP + "operands.CYCLE = { const = 0 }", ["CYCLE is 0, allowed 1…2000"]),
        (LOOP + "operands.CYCLE = { const = 1.5 }", ["CYCLE is a DINT, 1.5 is not; it takes a whole number"]),
        (LOOP + "operands.PID_RUN = { const = 1 }", ["PID_RUN is a BOOL, 1 is not; it takes true or false"]),
        (LOOP + "operands.Kp = { const = nan }", ["Kp is nan, allowed is a finite number"]),
        (LOOP + "operands.Kp = { const = 1e39 }", ["too large for a REAL"]),
        (LOOP + "operands.MV = { const = 1.0 }", ["MV is written by the instruction, so it is no constant 1.0"]),
        (LOOP + "operands.I_MV = { const = 1.0 }", ["I_MV is written by the instruction"]),
        (LOOP + 'operands.PV = "D123"', ["PV of loop A at D123…D124", "I_MV of loop A at D122…D133", "alone"]),
        (LOOP + 'operands.PV = "D101"', ["PV of loop A at D101…D102 overlaps SV of loop A at D100…D101 in part"]),
        (LOOP + 'operands.PV = "D200"', ["MV of loop A at D200…D201 is also PV"]),
        (LOOP + 'data = "D30000"', ["line.toml: loops.A.data: SV at `D30000`"]),
        (LOOP + 'en = "D5"', ["loops.A.en: EN is a bit, `D5` is a word", "`D5.0`"]),
        (LOOP + 'dialect.frezee = "always"', ["loops.A.dialect.frezee: unknown axis", "did you mean `freeze`?"]),
        (LOOP + 'dialect.freeze = "alway"', ['"alway" is not known, allowed are always, outward', "`always`"]),
        (LOOP + "tolerance.ulp_max = -1", ["loops.A.tolerance.ulp_max: -1 should be greater than or equal to 0"]),
        (LOOP + "tolerance.mv_max = inf", ["loops.A.tolerance.mv_max"]),
        (LOOP + "ranges.pv = [5.0, 5.0]", ["loops.A.ranges.pv: 5 is not below 5"]),
        (LOOP + "fake.initial.SVV = 1.0", ["loops.A.fake.initial.SVV", "did you mean `SV`?"]),
        (LOOP + "fake.initial.I_MV = 1.0", ["loops.A.fake.initial.I_MV"]),
        (LOOP + 'fake.plant = { kind = "fopdt", gain = 1.0 }', ["loops.A.fake.plant.tau_s: is missing"]),
        (LOOP + 'fake.plant = { kind = "foptd", gain = 1.0 }', ["did you mean `fopdt`?"]),
        (LOOP.replace("modbus+tcp", "modbus+tpc"), ["station.target", "did you mean `modbus+tcp`?"]),
        (LOOP.replace("modbus+tcp://", ""), ["starts with none of modbus+tcp://"]),
        (LOOP.replace("2.10", "2.10?unit=900"), ["station.target: unit=900, allowed 0…255"]),
        (LOOP.replace("[loops", "unit = 2\n[loops").replace("2.10", "2.10?unit=3"), ["is 2, but the target says"]),
        (
            LOOP.replace("[loops", "unit = 0\n[loops").replace("tcp", "rtu"),
            ["station.unit: is 0, allowed on a serial line are 1…247"],
        ),
        (LOOP.replace("[loops", 'device_map = "ah50"\n[loops'), ["station.device_map", "did you mean `ah500`?"]),
        (LOOP.replace("[loops", 'running = "D1"\n[loops'), ["station.running: running is a bit, `D1` is a word"]),
        (LOOP.replace("[loops", 'unit = "1"\n[loops'), ['station.unit: "1" is text, and a number belongs here']),
        (LOOP.replace("[loops", "pacing.words_per_request_max = 11\n[loops"), ["I_MV of loop A takes 12 words"]),
        (STATION, ["loops: is missing"]),
        (STATION + '[loops.A]\ninstruction = "DPID"\n', ["DPID also needs PID_RUN, SV", 'or `layout = "manual"`']),
        (STATION + '[loops.A]\ninstruction = "DPID"\ndata = "D5"', ["loops.A.data: moves a layout"]),
    ],
)
def test_what_is_wrong_is_named_with_file_key_value_and_what_is_allowed(text: str, parts: list[str]) -> None:
    message = errors(text)
    assert message.startswith("line.toml: ")
    for part in parts:
        assert part in message


def test_two_loops_never_share_the_instructions_memory_nor_drive_one_output() -> None:
    message = errors(LOOP + '[loops.B]\ninstruction = "DPID"\nlayout = "manual"\nflags = "M11"\n')
    assert "I_MV belongs to its instruction alone" in message
    message = errors(
        LOOP
        + '[loops.B]\ninstruction = "DPID"\nlayout = "manual"\nflags = "M11"\ndata = "D300"\noperands.MV = "D200"\n'
    )
    assert "loops.B.operands.MV: MV of loop B at D200…D201: loop A writes its MV there too" in message


def test_all_errors_are_reported_together() -> None:
    message = errors(
        LOOP.replace("modbus+tcp", "modbus")
        + 'lay = "x"\noperands = { SV = "Q1", PV = 3 }\n[loops.B]\nlayout = "manual"\n[loops.C]\ninstruction = "PID"\n'
    )
    assert message.startswith("line.toml: 6 errors\n")
    for key in ("loops.A.lay", "loops.A.operands.PV", "loops.B.instruction", "station.target", "loops.A.operands.SV"):
        assert f"\n  {key}: " in message
    assert "\n  loops.C.instruction: " in message


def test_a_syntax_error_is_found_by_line_and_column() -> None:
    assert errors("a = 1\nb = \n").startswith("line.toml:2:5: invalid value")


def test_a_layout_that_meets_another_is_one_mistake() -> None:
    message = errors(LOOP + '[loops.B]\ninstruction = "DPID"\nlayout = "manual"\nflags = "M11"\ndata = "D101"\n')
    assert "\n" not in message


def test_a_profile_is_found_by_path_or_by_the_name_of_an_example(tmp_path) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes(b"\xef\xbb\xbf" + LOOP.encode())
    assert profile.load(str(path)).station().name == "S"
    assert profile.load("demo").station().name == "Demo"
    with pytest.raises(ProfileError) as caught:
        profile.load("demoo")
    assert caught.value.message == (
        "`demoo` is no file and no shipped name; shipped examples: can, demo, live_bench, melsec_pid, pid_reg_ce, "
        "pid_temp, recorded, single"
    )
    assert caught.value.hint == "did you mean `demo`?"


def test_a_relative_device_map_lies_beside_the_profile(tmp_path) -> None:
    (tmp_path / "map.toml").write_text((files.shipped() / "ah500.toml").read_text("utf-8"), "utf-8")
    path = tmp_path / "mine.toml"
    path.write_text(LOOP.replace("[loops", 'device_map = "map.toml"\n[loops'), "utf-8")
    assert profile.load(str(path)).station().devices.name == "ah500"


def test_a_file_in_another_encoding_is_refused_with_advice(tmp_path) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes(LOOP.encode() + 'units.pv = "°C"\n'.encode("cp1252"))
    with pytest.raises(ProfileError) as caught:
        profile.load(str(path))
    assert caught.value.hint == "save the file with the encoding UTF-8"


@pytest.mark.parametrize("name", files.names(files.shipped() / "examples"))
def test_every_shipped_example_is_a_good_profile(name: str) -> None:
    assert profile.load(name).station().loops


def test_the_shortest_profile_of_the_reference_is_good() -> None:
    page = (files.shipped().parent / "docs" / "reference" / "profile.md").read_text("utf-8")
    blocks = re.findall(r"^```toml\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    assert profile.parse(blocks[0], "profile.md").station().name == "Line 1"
    assert device_map.parse(blocks[1], "profile.md").name == "mine"


def test_the_reference_names_every_key() -> None:
    page = (files.shipped().parent / "docs" / "reference" / "profile.md").read_text("utf-8")
    schema = ProfileForm.model_json_schema()
    keys = {key for table in schema["$defs"].values() for key in table.get("properties", {})}
    assert {key for key in keys if not re.search(rf"`{key}`|\b{key} =|\.{key}\]", page)} == set()


VALUES = st.recursive(
    st.sampled_from(
        [0, -1, 1.5, 2**40, True, "", "D100", "M1", "X0.3", "D999999999", "manual", "modbus+tcp://[x?unit="]
    ),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.sampled_from(["a", "device", "const"]), inner),
    max_leaves=3,
)


@settings(max_examples=20)
@given(st.data())
def test_whatever_a_person_writes_is_a_good_profile_or_a_profile_error(data) -> None:
    tables = tomllib.loads((files.shipped() / "examples" / "demo.toml").read_text("utf-8"))
    for _ in range(data.draw(st.integers(1, 3))):
        table = tables
        while True:
            key = data.draw(st.sampled_from([*sorted(table), "operands", "zz"]))
            if not isinstance(table.get(key), dict) or not table[key] or data.draw(st.integers(0, 4)) == 0:
                break
            table = table[key]
        table[key] = data.draw(VALUES)
    with contextlib.suppress(ProfileError):
        assert profile.parse(tomlkit.dumps(tables), "f.toml").station().loops
