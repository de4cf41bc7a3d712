"""Whole screens against pictures of them that a person has looked at: text, without colour, in virtual time.

When a screen was changed on purpose, the new picture lies in the folder that the message names: look at it, then put it
over the old one in `tests/tui/screens`.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from apps.test_player import Played, path  # noqa: F401
from tui.screen_world import ScreenWorld, text_of

from ahgateway.clock import SECOND
from ahgateway.tui.app import MonitorApp

pytestmark = pytest.mark.slow
SCREENS = Path(__file__).parent / "screens"


async def seen(app: MonitorApp, size: tuple[int, int], *keys: str) -> list[str]:
    """What stands on the screen after some keys."""
    async with app.run_test(size=size) as pilot:
        await pilot.press(*keys)
        await pilot.pause()
        app.redraw()
        await pilot.pause()
        return text_of(app)


def held(name: str, lines: list[str], folder: Path) -> None:
    """Hold a screen against its picture."""
    new = folder / f"{name}.txt"
    new.write_text("\n".join(lines) + "\n", encoding="utf-8")
    kept = SCREENS / new.name
    assert kept.is_file(), f"there is no picture of this screen; look at {new}"
    assert kept.read_text(encoding="utf-8").splitlines() == lines, f"the screen has changed; look at {new}"


PAGES = {
    "loops": ((130, 10), "1"),
    "loop": ((140, 44), "2"),
    "loop-narrow": ((80, 24), "2"),
    "link": ((100, 20), "3"),
    "log": ((120, 14), "4"),
}


async def test_the_demo(tmp_path):
    """An operand changed, a note, then a fault, then silence."""
    world = ScreenWorld(warm_up_s=20)
    await world.run(6.0)
    world.plc.write("TIC-101", "Kc_Kp", 2.5)
    world.board.note("valve checked")
    await world.run(4.0)
    for name, (size, key) in PAGES.items():
        held(name, await seen(world.app(), size, key), tmp_path)
    for encoding in ("cp437", "cp1252", "ascii"):
        lines = await seen(world.app(encoding=encoding), (140, 40), "2")
        "\n".join(lines).encode(encoding)
        held(f"loop-{encoding}", lines, tmp_path)
    world.plc.fail("TIC-101", "gain-1-percent")
    world.plc.write("TIC-101", "SV", 84.0)
    await world.run(2.0)
    held("loop-diverged", await seen(world.app(), (140, 30), "2"), tmp_path)
    world.clock.advance_ns(3 * SECOND)
    held("loops-stale", await seen(world.app(), (130, 10), "1"), tmp_path)


@pytest.mark.parametrize("profile", ["pid_reg_ce", "pid_temp", "melsec_pid"])
async def test_the_other_controllers(tmp_path, profile):
    world = ScreenWorld(profile)
    await world.run(12.0)
    held(f"loop-{profile}", await seen(world.app(), (140, 44), "2"), tmp_path)


async def test_a_recording(path, tmp_path):  # noqa: F811
    played = Played(path)
    await played.until(lambda: played.at_s >= 3.0)
    played.player.pause()
    played.player.seek(played.player.first_ns + 6 * SECOND)
    await played.until(lambda: played.player.text().startswith("PAUSED 6.0"))
    app = MonitorApp(played.board, "Demo", player=played.player, encoding="utf-8", is_ticking=False)
    held("replay", await seen(app, (160, 12), "1"), tmp_path)
    await played.end()
