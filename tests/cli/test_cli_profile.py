import json
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from ahgateway.cli.profile import app
from ahgateway.errors import ProfileError
from ahgateway.schema import profile
from ahgateway.schema.starter import starter

LOOP = '[station]\nname = "S"\ntarget = "fake://x"\n[loops.A]\ninstruction = "DPID"\nlayout = "manual"\n'


def run(*arguments: str) -> str:
    result = CliRunner().invoke(app, list(arguments), catch_exceptions=False)
    assert result.exit_code == 0
    return result.stdout


def test_check_says_what_a_good_profile_holds(tmp_path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(LOOP, "utf-8")
    assert run("check", str(path)) == f"{path}: good, station S, 1 loop: A\n"
    assert json.loads(run("check", str(path), "-o", "json")) == {"file": str(path), "station": "S", "loops": ["A"]}


def test_check_hands_the_error_up() -> None:
    with pytest.raises(ProfileError):
        run("check", "no-such-profile")


def test_show_gives_every_operand_its_place_and_origin(tmp_path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(LOOP + 'operands = { PV = "D5", Kd = { const = 0.5 }, PID_MAN = "D7.3" }\n', "utf-8")
    facts = json.loads(run("show", str(path), "--output", "json"))
    rows = {row["name"]: row for row in facts["loops"][0]["operands"]}
    assert rows["SV"] == {
        "name": "SV",
        "kind": "REAL",
        "unit": "PV",
        "device": "D100",
        "table": "holding register",
        "address": "0x0064",
        "bit": None,
        "words": 2,
        "confidence": "I",
        "origin": "layout",
    }
    assert (rows["PV"]["device"], rows["PV"]["origin"]) == ("D5", "profile")
    assert (rows["Kd"]["const"], rows["Kd"]["device"]) == (0.5, None)
    assert (rows["PID_MAN"]["address"], rows["PID_MAN"]["bit"]) == ("0x0007", 3)
    assert facts["station"]["unit"] == {"value": 1, "origin": "default"}
    assert facts["requests"] == [
        {"unit": 1, "table": "coil", "address": "0x0001", "count": 4},
        {"unit": 1, "table": "holding register", "address": "0x0005", "count": 3},
        {"unit": 1, "table": "holding register", "address": "0x0064", "count": 34},
        {"unit": 1, "table": "holding register", "address": "0x00C8", "count": 2},
    ]


def test_show_as_text_lines_up() -> None:
    lines = run("show", "demo").splitlines()
    assert "  SV         REAL   °C        D100    holding register  0x0064   I           layout" in lines
    assert "  holding register  0x0064   46" in lines


def test_schema_names_every_table() -> None:
    schema = json.loads(run("schema"))
    assert schema["required"] == ["station", "loops"]
    assert {"type": "string"} in schema["$defs"]["OperandForm"]["anyOf"]


@pytest.mark.parametrize("instruction", ["DPID", "dpide"])
def test_init_writes_a_profile_that_is_good_as_it_stands(tmp_path, instruction: str) -> None:
    path = tmp_path / "new.toml"
    run("init", str(path), "--instruction", instruction)
    assert profile.load(str(path)).station().loops[0].controller.name == instruction.upper()


def test_what_init_comments_out_is_good_too() -> None:
    lines = starter("DPIDE").splitlines()
    keys = [line[2:] if line.startswith("# ") and ("=" in line or line.startswith("# [")) else line for line in lines]
    text = "\n".join(["# head", *keys[1:]]).replace('data = "D300"', 'data = "D700"')
    assert profile.parse(text, "new.toml").station().bench


def test_init_never_overwrites(tmp_path) -> None:
    path = tmp_path / "new.toml"
    path.write_text("mine", "utf-8")
    with pytest.raises(ProfileError, match="left alone"):
        run("init", str(path))
    assert path.read_text("utf-8") == "mine"


def test_init_names_the_near_instruction(tmp_path) -> None:
    with pytest.raises(ProfileError) as caught:
        run("init", str(tmp_path / "n.toml"), "--instruction", "DPIDD")
    assert caught.value.hint is not None


def test_an_unknown_output_is_a_usage_error() -> None:
    assert CliRunner().invoke(app, ["show", "demo", "--output", "xml"]).exit_code == 2


def test_the_help_loads_nothing_heavy() -> None:
    code = (
        "import sys; from ahgateway.cli.profile import app\n"
        "print(sorted({'numpy', 'pydantic', 'scipy'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
