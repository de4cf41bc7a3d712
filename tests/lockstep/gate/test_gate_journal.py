"""The journal: every change before an anchor is found, and a cut last line costs nothing but itself."""

from __future__ import annotations

import hashlib
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ahgateway.clock import VirtualClock
from ahgateway.errors import ProfileError, StateError
from ahgateway.lockstep.gate.journal import FIRST, Journal, check, digest, verify


def journal(path, count: int = 3) -> Journal:
    made = Journal(path, VirtualClock())
    for number in range(count):
        made.append("write", value=number)
    return made


def test_the_first_record_worked_out_by_hand(tmp_path) -> None:
    made = journal(tmp_path / "j", 1)
    text = (
        '{"kind":"write","n":0,"prev":"0000000000000000000000000000000000000000000000000000000000000000",'
        '"utc_ns":1767225600000000000,"value":0}'
    )
    assert hashlib.sha256(text.encode()).hexdigest() == made.last == json.loads((tmp_path / "j").read_text())["hash"]


def test_the_chain_goes_on_over_a_restart(tmp_path) -> None:
    journal(tmp_path / "j", 2)
    last = journal(tmp_path / "j", 2).last
    found = verify(tmp_path / "j")
    assert ("", 4, last) == (found.fault, len(found.records), found.last)
    assert [0, 1, 2, 3] == [record["n"] for record in found.records]


def test_an_anchor_is_found_and_a_strange_one_is_not(tmp_path) -> None:
    made = journal(tmp_path / "j", 3)
    assert 1 == verify(tmp_path / "j", made.records[1]["hash"]).anchor_at
    assert verify(tmp_path / "j", "0" * 63 + "1").anchor_at is None


def test_a_forged_chain_is_whole_but_lacks_the_anchor(tmp_path) -> None:
    made = journal(tmp_path / "j", 3)
    anchor, last, lines = made.last, FIRST, []
    for record in made.records:
        forged = {**record, "value": 9, "prev": last}
        forged["hash"] = last = digest(forged)
        lines.append(json.dumps(forged))
    found = check("".join(f"{line}\n" for line in lines).encode(), anchor)
    assert ("", None) == (found.fault, found.anchor_at)


@given(st.data())
def test_any_changed_byte_is_found(tmp_path_factory, data) -> None:
    path = tmp_path_factory.mktemp("journal") / "j"
    made = journal(path, 3)
    raw = bytearray(path.read_bytes())
    at = data.draw(st.integers(0, len(raw) - 1))
    raw[at] ^= data.draw(st.integers(1, 255))
    found = check(bytes(raw), made.last)
    same = [json.loads(line) for line in raw.splitlines() if _is_json(line)] == made.records
    assert found.fault or found.anchor_at is None or same


def _is_json(line: bytes) -> bool:
    try:
        json.loads(line)
    except ValueError:
        return False
    return True


@pytest.mark.parametrize("kept", [1, 40, 200])
def test_a_last_line_that_was_cut_short_is_vouched_for(tmp_path, kept: int) -> None:
    path = tmp_path / "j"
    journal(path, 3)
    raw = path.read_bytes()
    second = raw.index(b"\n", raw.index(b"\n") + 1) + 1
    path.write_bytes(raw[: second + kept])
    assert kept == len(verify(path).tail)
    journal(path, 1)
    found = verify(path)
    assert ("", ["write", "write", "torn", "write"]) == (found.fault, [record["kind"] for record in found.records])
    path.write_bytes(path.read_bytes().replace(raw[second : second + kept], b"{" * kept, 1))
    assert "line 4: the line before it is no record" in verify(path).fault or kept == 1


def test_a_removed_line_is_found(tmp_path) -> None:
    journal(tmp_path / "j", 3)
    lines = (tmp_path / "j").read_bytes().splitlines(keepends=True)
    (tmp_path / "j").write_bytes(lines[0] + lines[2])
    assert "line 2: does not follow the record before it" == verify(tmp_path / "j").fault


def test_a_broken_journal_is_not_written_to(tmp_path) -> None:
    journal(tmp_path / "j", 2)
    raw = (tmp_path / "j").read_bytes()
    (tmp_path / "j").write_bytes(raw.replace(b'"value": 0', b'"value": 7'))
    with pytest.raises(StateError, match="line 1: its content gives the hash"):
        journal(tmp_path / "j", 1)


def test_what_is_not_there_is_an_error_of_the_file(tmp_path) -> None:
    with pytest.raises(ProfileError, match="cannot be read"):
        verify(tmp_path / "no")
    with pytest.raises(StateError, match="cannot be written"):
        (tmp_path / "d").mkdir()
        made = Journal(tmp_path / "j", VirtualClock())
        made.path = tmp_path / "d"
        made.append("write")
