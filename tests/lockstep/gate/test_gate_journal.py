"""The journal: every change before an anchor is found, and a cut last line costs nothing but itself."""

from __future__ import annotations

import hashlib
import json
from io import FileIO

import pytest

from ahgateway.clock import VirtualClock
from ahgateway.errors import ProfileError, StateError
from ahgateway.lockstep.gate.journal import FIRST, Journal, check, digest, verify, write_whole


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
        lines.append(json.dumps(forged, sort_keys=True, separators=(",", ":")))
    found = check("".join(f"{line}\n" for line in lines).encode(), anchor)
    assert ("", None) == (found.fault, found.anchor_at)


def test_any_flipped_bit_removed_byte_and_added_byte_before_an_anchor_is_found(tmp_path) -> None:
    made = journal(tmp_path / "j", 3)
    raw = (tmp_path / "j").read_bytes()
    assert 2 == check(raw, made.last).anchor_at
    for at in range(len(raw)):
        flipped = [raw[:at] + bytes((raw[at] ^ 1 << bit,)) + raw[at + 1 :] for bit in range(8)]
        for changed in (*flipped, raw[:at] + raw[at + 1 :], raw[:at] + b" " + raw[at:], raw[:at] + b"\n" + raw[at:]):
            found = check(changed, made.last)
            assert found.fault or found.anchor_at is None, (at, changed)


def test_a_key_that_stands_twice_is_found_though_json_takes_the_last_of_them(tmp_path) -> None:
    made = journal(tmp_path / "j", 1)
    raw = (tmp_path / "j").read_bytes()
    told = raw.replace(b'"value":0', b'"value":9,"value":0')
    assert made.records[0] == json.loads(told)
    assert "line 1: is not written as the gate writes it" in check(told, made.last).fault


def test_lines_that_are_too_deep_are_no_records() -> None:
    assert "line 2 is no record" == check(b"[" * 100_000 + b"\n" + b"[" * 100_000 + b"\n").fault


class FullDisk(FileIO):
    """A file on a disk with room for 40 bytes more."""

    room = 40

    def write(self, data) -> int:
        taken = super().write(data[: self.room])
        if not self.room:
            raise OSError(28, "No space left on device")
        self.room -= taken
        return taken


def test_what_a_full_disk_took_of_a_record_is_cut_off_again(tmp_path) -> None:
    made = journal(tmp_path / "j", 2)
    size = made.path.stat().st_size
    with FullDisk(made.path, "ab") as file:
        write_whole(file, b"x" * 30)
        with pytest.raises(OSError, match="No space left"):
            write_whole(file, b"y" * 100)
    assert size + 30 == made.path.stat().st_size
    assert b"x" * 30 == made.path.read_bytes()[size:]


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
    (tmp_path / "j").write_bytes(raw.replace(b'"value":0', b'"value":7'))
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
