"""The monitor's screen, driven by keys and read as text, in virtual time."""

from __future__ import annotations

import gc
import weakref

import pytest
from textual.widgets._footer import FooterKey
from tui.screen_world import ScreenWorld, text_of

from ahgateway.clock import SECOND
from ahgateway.tui.event_log import lets_through
from ahgateway.tui.link_page import histogram

pytestmark = pytest.mark.slow

WIDE = (140, 45)


def line_with(lines: list[str], word: str) -> str:
    found = [line for line in lines if word in line]
    assert found, "\n".join(lines)
    return found[0]


@pytest.fixture
async def world() -> ScreenWorld:
    """Two seconds of the demo behind its start, so that both loops have executions."""
    world = ScreenWorld(warm_up_s=20)
    await world.run(2.0)
    return world


async def test_the_first_page_names_every_loop_with_its_verdict_values_and_age(world):
    async with world.app().run_test(size=WIDE) as pilot:
        pilot.app.redraw()
        await pilot.pause()
        while not text_of(pilot.app)[-1]:  # the keys come when the bindings are known, behind the first picture
            await pilot.pause()
        lines = text_of(pilot.app)
    assert "Demo  │  2 loops  │  link up  │  none diverged  │  00:00:22Z" == lines[0]
    head = ["loop", "verdict", "proven", "diverged", "age", "SV", "PV", "MV", "mode", "health", "way", "findings"]
    assert head == line_with(lines, "verdict").split()
    row = line_with(lines, "TIC-101").split()
    assert [">", "TIC-101", "MATCH"] == row[:3]
    counts = world.board.watches["TIC-101"].follower.summary()
    assert [f"{100 * counts.proven // counts.total}%", "of", str(counts.total), "0", "0.0", "s", "80"] == row[3:10]
    assert ["auto", "-", "polled"] == row[12:15]
    assert "LIC-201" in line_with(lines, "LIC-201")
    assert "q quit  n note" in lines[-1]
    assert "t only what needs a look" in lines[-1]


async def test_stale_values_never_look_live(world):
    async with world.app().run_test(size=WIDE) as pilot:
        world.clock.advance_ns(2 * SECOND + 1)
        pilot.app.redraw()
        await pilot.pause()
        lines = text_of(pilot.app)
        assert "2 STALE" in lines[0]
        row = line_with(lines, "TIC-101")
        assert "STALE" in row
        assert "MATCH" not in row
        assert " (80) " in row
        await pilot.press("2")
        await pilot.pause()
        lines = text_of(pilot.app)
        assert "STALE" in line_with(lines, "TIC-101  DPIDE")
        assert "SV (80)   °C" in line_with(lines, "PV (")
        assert "reference MV (" in line_with(lines, "MV (")
        assert "(80)  °C" in line_with(lines, "D100 ")
        assert "(" in line_with(lines, " I ").partition("PLC")[0]


async def test_a_link_that_is_down_is_said_on_every_page(world):
    async with world.app().run_test(size=WIDE) as pilot:
        await world.link.close()
        world.monitor.is_up = False
        for key in "1234":
            await pilot.press(key)
            await pilot.pause()
            assert "LINK DOWN" in text_of(pilot.app)[0]


async def test_enter_on_a_loop_shows_its_terms_beside_the_reference(world):
    async with world.app().run_test(size=WIDE) as pilot:
        await pilot.press("enter")
        await pilot.pause()
        assert "loop" == pilot.app.page
        lines = text_of(pilot.app)
    assert "TIC-101  DPIDE" in line_with(lines, "DPIDE")
    assert "not in memory" in line_with(lines, "  P  ")
    assert "= same bits" in line_with(lines, "  MV  ")
    assert "SV 80   °C" in line_with(lines, "PV ")
    assert "reference MV" in line_with(lines, "reference MV")
    assert "Ti_Ki" in line_with(lines, "D110 ")
    assert "00:00:22Z" in "\n".join(lines[1:])


async def test_arrows_and_a_click_choose_a_loop(world):
    async with world.app().run_test(size=WIDE) as pilot:
        pilot.app.redraw()
        await pilot.press("down")
        await pilot.pause()
        lines = text_of(pilot.app)
        assert "> LIC-201" in line_with(lines, "LIC-201")
        assert ">" not in line_with(lines, "TIC-101")
        await pilot.click(offset=(8, lines.index(line_with(lines, "TIC-101"))))
        await pilot.pause()
        assert "TIC-101  DPIDE  " in line_with(text_of(pilot.app), "DPIDE")


async def test_only_the_loops_that_need_a_look_are_left(world):
    world.plc.fail("LIC-201", "gain-1-percent")
    world.plc.write("LIC-201", "SV", 55.0)
    await world.run(3.0)
    async with world.app().run_test(size=WIDE) as pilot:
        await pilot.press("down", "up", "t")
        await pilot.pause()
        lines = text_of(pilot.app)
        assert "> LIC-201  DIVERGED" in line_with(lines, "LIC-201")
        assert not [line for line in lines if "TIC-101" in line]
        await pilot.press("enter")
        await pilot.pause()
        assert "LIC-201  DPID  " in line_with(text_of(pilot.app), "DPID")
        await pilot.press("1", "t")
        await pilot.pause()
        assert "TIC-101" in line_with(text_of(pilot.app), "TIC-101")


async def test_what_is_longer_or_wider_than_the_page_is_reached_by_keys(world):
    async with world.app().run_test(size=(80, 24)) as pilot:
        await pilot.press("2")
        await pilot.pause()
        assert "ERR_DBW" not in "\n".join(text_of(pilot.app))
        await pilot.press("end")
        await pilot.pause()
        assert "ERR_DBW" in "\n".join(text_of(pilot.app))
        await pilot.press("1")
        await pilot.pause()
        assert "findings" not in "\n".join(text_of(pilot.app))
        await pilot.press(*["right"] * 60)
        await pilot.pause()
        assert "findings" in "\n".join(text_of(pilot.app))


async def test_brackets_turn_to_the_next_loop_and_round(world):
    async with world.app().run_test(size=WIDE) as pilot:
        await pilot.press("2", "right_square_bracket")
        await pilot.pause()
        assert "LIC-201  DPID  " in line_with(text_of(pilot.app), "DPID")
        await pilot.press("right_square_bracket")
        await pilot.pause()
        assert "TIC-101  DPIDE  " in line_with(text_of(pilot.app), "DPID")


async def test_an_operand_that_somebody_changed_is_marked_with_both_values(world):
    world.plc.write("TIC-101", "Kc_Kp", 2.5)
    await world.run(1.0)
    async with world.app().run_test(size=WIDE) as pilot:
        await pilot.press("2")
        await pilot.pause()
        row = line_with(text_of(pilot.app), "Kc_Kp")
        assert "*  Kc_Kp" in row
        assert "00:00:22 2 -> 2.5" in row
        await pilot.press("4")
        await pilot.pause()
        assert "TIC-101 operand Kc_Kp: 2 -> 2.5" in line_with(text_of(pilot.app), "Kc_Kp")


async def test_a_diverged_loop_says_so_without_colour(world):
    world.plc.fail("TIC-101", "gain-1-percent")
    world.plc.write("TIC-101", "SV", 84.0)
    await world.run(2.0)
    async with world.app().run_test(size=WIDE) as pilot:
        pilot.app.redraw()
        await pilot.pause()
        lines = text_of(pilot.app)
        assert "1 DIVERGED" in lines[0]
        assert "DIVERGED" in line_with(lines, "TIC-101")
        await pilot.press("2")
        await pilot.pause()
        assert "≠ " in line_with(text_of(pilot.app), "  MV  ")


async def test_notes_and_markers_reach_the_log_and_whoever_keeps_them(world):
    async with world.app().run_test(size=WIDE) as pilot:
        await pilot.press("m", "n")
        await pilot.pause()
        await pilot.press(*"valve", "enter")
        await pilot.pause()
        await pilot.press("4")
        await pilot.pause()
        lines = text_of(pilot.app)
    assert ["marker 1", "valve"] == [note.text for note in world.notes]
    assert "00:00:22" in line_with(lines, "note: marker 1")
    assert "note: valve" in line_with(lines, "note: valve")


async def test_the_filter_leaves_what_is_asked_for(world):
    world.board.note("pump started")
    world.board.note("valve opened")
    async with world.app().run_test(size=WIDE) as pilot:
        await pilot.press("slash", *"valve", "enter")
        await pilot.pause()
        text = "\n".join(text_of(pilot.app))
    assert "valve opened" in text
    assert "pump started" not in text


async def test_a_report_draws_nothing_by_itself(world):
    async with world.app().run_test(size=WIDE) as pilot:
        while not pilot.app.redraws:  # the first page is drawn once, as soon as it has its size
            await pilot.pause()
        before = pilot.app.redraws
        await world.run(2.0)
        await pilot.pause()
        assert before == pilot.app.redraws


async def test_keys_of_a_page_that_was_left_are_forgotten(world):
    app = world.app()
    async with app.run_test(size=WIDE) as pilot:
        while not app.query(FooterKey):
            await pilot.pause()
        first = [weakref.ref(each) for each in app.query(FooterKey)]
        for key in "234":
            await pilot.press(key)
            await pilot.pause()
        gc.collect()
        assert len(first) == 5
        assert [None] * 5 == [each() for each in first]


async def test_a_narrow_terminal_keeps_trend_and_verdict_in_sight(world):
    async with world.app().run_test(size=(80, 24)) as pilot:
        await pilot.press("2")
        await pilot.pause()
        lines = text_of(pilot.app)
    assert "TIC-101" in line_with(lines, "TIC-101")
    assert "reference MV" in line_with(lines, "reference MV")
    assert all(len(line) <= 80 for line in lines)


async def test_a_narrow_terminal_keeps_every_head_in_sight(world):
    async with world.app().run_test(size=(60, 24)) as pilot:
        pilot.app.redraw()
        await pilot.pause()
        lines = text_of(pilot.app)
        assert line_with(lines, "verdict").split()[:2] == ["loop", "verdict"]
        assert lines[0].startswith("Demo  │  2 loops")
        await pilot.press("2")
        await pilot.pause()
        assert "TIC-101  DPIDE" in "\n".join(text_of(pilot.app))


async def test_without_braille_the_trend_is_plain_ascii(world):
    async with world.app().run_test(size=WIDE) as pilot:
        await pilot.press("2", "a")
        await pilot.pause()
        lines = text_of(pilot.app)
    assert "* PV" in line_with(lines, "PV")
    assert not any("⠀" <= sign <= "⣿" for line in lines for sign in line)


async def test_the_link_page_counts_round_trips_in_classes(world):
    async with world.app().run_test(size=WIDE) as pilot:
        await pilot.press("3")
        await pilot.pause()
        lines = text_of(pilot.app)
    assert "memory:demo  up" in line_with(lines, "memory:demo")
    assert "exceptions 0" in line_with(lines, "requests")


def test_a_histogram_shows_counts_bars_and_the_empty_class_between():
    assert [
        "   0.5 … < 1 ms           2 ████",
        "     1 … < 2 ms           0 ",
        "     2 … < 5 ms           1 ██",
    ] == histogram([500_000, 999_999, 2_000_000], 4)
    assert ["  1000 … ms and more      1 ████"] == histogram([1_000_000_000], 4)
    assert [] == histogram([], 4)


@pytest.mark.parametrize(
    ("passes", "wanted"),
    [(True, ""), (True, "tic diverged"), (False, "lic"), (True, "-operand"), (False, "tic -diverged"), (True, "mv -")],
)
def test_every_word_must_occur_and_none_with_a_minus(passes, wanted):
    assert passes is lets_through(wanted, "12:00:00.000Z TIC-101 tick 5 DIVERGED: MV plc -1")
