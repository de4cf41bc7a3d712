"""The keys of a recording on the screen, pressed and read, in virtual time."""

from __future__ import annotations

import pytest
from apps.test_player import Played, path  # noqa: F401
from tui.screen_world import ScreenWorld, text_of

from ahgateway.transports.base import Frame
from ahgateway.tui.app import MonitorApp

pytestmark = pytest.mark.slow
SIZE = (150, 40)


def screen(played: Played) -> MonitorApp:
    return MonitorApp(played.board, "Demo", player=played.player, encoding="utf-8", is_ticking=False)


async def test_keys_pause_seek_and_change_the_speed(path):  # noqa: F811
    played = Played(path)
    await played.until(lambda: played.at_s >= 3.0)
    played.player.pause()
    async with screen(played).run_test(size=SIZE) as pilot:
        await pilot.press("space", "space")
        assert played.player.is_paused
        await pilot.pause()
        assert "PAUSED 3." in text_of(pilot.app)[0]
        await pilot.press("right")
        await played.until(lambda: not played.player.text().startswith("SEEKING"))
        pilot.app.redraw()
        await pilot.pause()
        assert "of 11.9 s at 1x" in text_of(pilot.app)[0]
        assert played.at_s > 11.0
        await pilot.press("shift+left")
        await played.until(lambda: not played.player.text().startswith("SEEKING"))
        assert played.at_s < 0.5
        await pilot.press("greater_than_sign", "greater_than_sign", "less_than_sign")
        assert 2.0 == played.player.speed
        await pilot.press("space")
        assert not played.player.is_paused
    await played.end()


async def test_a_moment_can_be_typed(path):  # noqa: F811
    played = Played(path)
    await played.until(lambda: played.at_s >= 1.0)
    played.player.pause()
    async with screen(played).run_test(size=SIZE) as pilot:
        await pilot.press("g", *"5.5", "enter")
        await played.until(lambda: played.player.text().startswith("PAUSED 5.5"))
        await pilot.press("g", *"2026-01-01T00:00:27", "enter")
        await played.until(lambda: played.player.text().startswith("PAUSED 7.0"))
        said = []  # what is shown goes away by itself after some seconds of real time
        pilot.app.notify = lambda message, **_: said.append(message)
        await pilot.press("g", *"soon", "enter")
        await played.until(lambda: said)
        assert said[0].startswith("go to: `soon` is no moment; seconds from the start")
    await played.end()


async def test_the_log_forgets_what_lies_behind_the_place(path):  # noqa: F811
    played = Played(path)
    await played.until(lambda: played.player.is_over)
    async with screen(played).run_test(size=SIZE) as pilot:
        await pilot.press("4")
        await pilot.pause()
        assert "DIVERGED" in "\n".join(text_of(pilot.app)[3:])
        await pilot.press("space", "g", *"4", "enter")
        await played.until(lambda: played.player.text().startswith("PAUSED 4.0"))
        pilot.app.redraw()
        await pilot.pause()
        assert "DIVERGED" not in "\n".join(text_of(pilot.app)[3:])
    await played.end()


async def test_the_link_page_shows_the_frames_of_then_and_counts_them(path):  # noqa: F811
    played = Played(path)
    played.monitor.on_frame = played.board.frame
    played.player.pause()
    async with screen(played).run_test(size=SIZE) as pilot:
        for place in ("4", "9", "2"):
            await pilot.press("g", *place, "enter")
            await played.until(lambda place=place: played.player.text().startswith(f"PAUSED {place}.0"))
            now_ns = played.clock.now_ns()
            await pilot.press("3")
            await pilot.pause()
            lines = text_of(pilot.app)
            of_then = [Frame(*each[2:], *each[:2]) for each in played.recording.frames() if each[0] <= now_ns]
            figures = played.monitor.link.figures
            assert of_then[-1] == played.board.frames[-1]
            assert of_then[-1].data.hex(" ")[:40] in "\n".join(lines)
            # Since the pass began, 20 seconds before the place or at the start.
            assert sum(frame.direction == ">" for frame in of_then) == figures.requests == figures.replies
            assert f"requests {figures.requests}  replies {figures.replies}  exceptions 0" in "\n".join(lines)
            assert "read 46 holding registers from 0x0064" in "\n".join(lines)
    await played.end()


async def test_a_recording_without_frames_says_how_it_would_have_some(path):  # noqa: F811
    played = Played(path)
    async with screen(played).run_test(size=SIZE) as pilot:
        await pilot.press("3")
        await pilot.pause()
        assert "--record-frames" in "\n".join(text_of(pilot.app))
    await played.end()


async def test_while_somebody_writes_the_keys_are_letters(path):  # noqa: F811
    played = Played(path)
    await played.until(lambda: played.at_s >= 1.0)
    played.player.pause()
    async with screen(played).run_test(size=SIZE) as pilot:
        await pilot.press("n", *"a b", "left", "enter")
        assert played.player.is_paused
        assert "a b" == played.board.events[-1].text
    await played.end()


async def test_a_live_run_has_no_such_keys():
    world = ScreenWorld()
    await world.run(0.5)
    async with world.app().run_test(size=SIZE) as pilot:
        await pilot.press("space", "g", "right")
        await pilot.pause()
        lines = text_of(pilot.app)
    assert "pause" not in lines[-1]
    assert "go to" not in "\n".join(lines)
