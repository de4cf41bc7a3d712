"""Stand-ins for consoles that lack our signs: same width, always writable, nothing changed that can be shown."""

from __future__ import annotations

import io
import sys

import pytest

from ahgateway.apps.signs import STAND_INS, is_legacy, shown_in, teach_streams


@pytest.mark.parametrize("encoding", ["cp437", "cp850", "cp1252", "latin-1", "ascii", "shift_jis"])
def test_whatever_we_show_can_be_written_and_keeps_its_width(encoding):
    text = "│ TIC-101 ≠ 80 °C ╌╌ ⣀⠤⠒ ━╸ █▓▒░ … → × σ Δ m³/h ▁▂▃▄▅▆▇█ · ← “x” 漢"
    found = shown_in(text, encoding)
    assert len(text) == len(found)
    found.encode(encoding)


def test_what_the_console_has_stays():
    assert "80 °C │ █ ░ σ" == shown_in("80 °C │ █ ░ σ", "cp437")
    assert "80 °C | # . s" == shown_in("80 °C │ █ ░ σ", "cp1252")
    assert "80 oC | # . s" == shown_in("80 °C │ █ ░ σ", "ascii")


def test_what_nobody_thought_of_is_a_question_mark_and_dots_are_stars():
    assert "? * " == shown_in("漢 ⣿⠀", "ascii")


def test_every_stand_in_is_one_plain_character():
    assert {1} == {len(plain) for plain in STAND_INS.values()}
    assert all(plain.isascii() for plain in STAND_INS.values())


@pytest.mark.parametrize(
    ("legacy", "encoding"),
    [
        (False, "utf-8"),
        (False, "UTF_8"),
        (False, "cp65001"),
        (True, "cp437"),
        (True, "cp1252"),
        (True, "ANSI_X3.4-1968"),
    ],
)
def test_only_unicode_shows_everything(legacy, encoding):
    assert legacy is is_legacy(encoding)


def test_a_pipe_of_an_old_code_page_gets_stand_ins_instead_of_a_traceback(monkeypatch):
    out = io.TextIOWrapper(io.BytesIO(), encoding="cp437", newline="\n")
    monkeypatch.setattr(sys, "stdout", out)
    teach_streams()
    out.write("MV plc 1 ≠ ref 2 → °C …\n")
    out.flush()
    assert b"MV plc 1 ! ref 2 > \xf8C ~\n" == out.buffer.getvalue()
