"""The page in a real browser: what stands there is what was recorded, and nothing is fetched from anywhere else."""

from __future__ import annotations

import contextlib
from urllib.parse import urlsplit

import numpy as np
import pytest
from apps.test_history import Recorded
from conformance.browser import Browser

from ahgateway.apps.history import History
from ahgateway.apps.lines import shown
from ahgateway.clock import SECOND
from ahgateway.web.server import Source, served

START_S = 1_767_225_600.0
READY = "window.ahgateway && ahgateway.trend.asked > 0"


@pytest.fixture
async def run(tmp_path):
    """Twelve seconds of the demo, a fault planted in one loop, recorded; the board as it stands at the end."""
    world = Recorded(tmp_path / "run.ahrec")
    await world.run(8.0)
    world.plc.fail("TIC-101", "gain-1-percent")
    world.plc.write("TIC-101", "SV", 84.0)
    world.monitor._started_ns = world.clock.now_ns()
    await world.run(4.0)
    world.tape.recorder.close()
    return world


@pytest.fixture
async def browser(tmp_path):
    made = Browser(tmp_path / "chromium")
    await made.start()
    yield made
    await made.close()


@contextlib.asynccontextmanager
async def page(world):
    source = Source(world.board, History(world.board, lambda: world.path), "Demo")
    async with served(source, 0) as port:
        yield f"http://127.0.0.1:{port}/"


def is_ours(url: str) -> bool:
    parts = urlsplit(url)
    return parts.scheme in ("about", "data", "blob", "chrome") or parts.hostname == "127.0.0.1"


async def zoomed(browser: Browser, since_s: float, until_s: float) -> dict[str, list[float]]:
    """Columns of the trend once the page shows these seconds; what is not known is NaN."""
    start, end = since_s * 1000, until_s * 1000
    await browser.ask(f"ahgateway.trend.times.setv({{start: {start}, end: {end}}}), 1")
    # An answer under way when the range moved is about the range before it.
    shown = "ahgateway.trend.filled"
    await browser.until(f"{shown}?.start === {start} && {shown}?.end === {end} && !ahgateway.trend.isBusy")
    found = await browser.ask(
        "Object.fromEntries(Object.entries(ahgateway.trend.curves.data)"
        ".map(([name, values]) => [name, Array.from(values, x => isNaN(x) ? null : x)]))"
    )
    return {name: [float("nan") if each is None else each for each in values] for name, values in found.items()}


async def test_the_numbers_on_the_page_are_those_in_memory(run, browser):
    since_s, until_s = START_S + 25.0, START_S + 29.0
    async with page(run) as url:
        await browser.open(f"{url}#loop=TIC-101")
        await browser.until(READY)
        found = await zoomed(browser, since_s, until_s)
        assert not await browser.ask("ahgateway.trend.isLive")
        marks = {mark for _, _, mark in await browser.ask("ahgateway.trend.runs")}
    seen = {
        round(picture.utc_ns / 1e6): (float(picture.inputs.pv), float(picture.inputs.sv), float(picture.seen["MV"]))
        for picture in run.pictures
    }
    rows = list(zip(found["t"], found["pv"], found["sv"], found["mv"], strict=True))
    assert len(rows) >= 4 * 5
    assert [seen[round(t_ms)] for t_ms, *_ in rows] == [tuple(values) for _, *values in rows]
    assert {2, 6} <= marks


async def test_the_numbers_on_the_page_are_those_of_the_recording(run, browser):
    # As after hours: the memory holds only the last seconds, the file everything.
    run.board.trails.trails["TIC-101"]._count = 10
    since_s, until_s = START_S + 24.0, START_S + 28.0
    async with page(run) as url:
        await browser.open(f"{url}#loop=TIC-101")
        await browser.until(READY)
        found = await zoomed(browser, since_s, until_s)
    wanted = [picture for picture in run.pictures if since_s - 1.0 <= picture.utc_ns / SECOND <= until_s + 1.0]
    assert len(wanted) == len(found["pv"]) > 80
    assert [picture.utc_ns / 1e6 for picture in wanted] == pytest.approx(found["t"], abs=0.01)
    for name in ("pv", "sv"):
        assert [float(getattr(picture.inputs, name)) for picture in wanted] == found[name]
    assert [float(picture.seen["MV"]) for picture in wanted] == found["mv"]
    proven = np.isfinite(found["ref_mv"])
    assert proven.sum() > 10
    assert np.array_equal(np.array(found["mv"])[proven], np.array(found["ref_mv"])[proven])


async def test_the_tables_say_what_the_terminal_says_and_nothing_comes_from_elsewhere(run, browser):
    picture = run.board.watches["TIC-101"].follower.picture
    async with page(run) as url:
        await browser.open(url)
        await browser.until("document.querySelectorAll('#loops tbody tr').length == 2 && ahgateway.sparks.clock")
        cells = await browser.ask("[...document.querySelector('#loops tbody tr').cells].map(cell => cell.textContent)")
        head = await browser.ask("document.querySelector('#alarm').textContent")
        ink = await browser.until(
            "(canvas => canvas.width > 200 && canvas.toDataURL().length)(document.querySelector('#loops canvas'))"
        )
        for name in ("loop", "link", "log"):
            await browser.ask(f"location.hash = '{name}', 1")
            await browser.until(f"!document.querySelector('#page-{name}').hidden")
        await browser.until("document.querySelectorAll('#log li.DIVERGED').length")
        lines = await browser.ask("[...document.querySelectorAll('#log li')].map(line => line.textContent)")
        await browser.ask("location.hash = 'loop=TIC-101', 1")
        terms = await browser.until(
            "(rows => rows.length > 5 && rows)([...document.querySelectorAll('#terms tbody tr')]"
            ".map(row => [...row.cells].map(cell => cell.textContent)))"
        )
        await browser.until(READY)
    assert ["TIC-101", "DIVERGED"] == cells[:2]
    assert ["84 °C", f"{shown(picture.inputs.pv)} °C", f"{shown(picture.seen['MV'])} %"] == cells[5:8]
    assert "1 DIVERGED" in head
    assert ink > 1000
    assert ["operand SV: 80 -> 84"] == [line.partition("TIC-101 ")[2] for line in lines if "operand SV" in line]
    last = {row[0]: row for row in terms}
    assert shown(picture.seen["MV"]) == last["MV"][1]
    assert last["MV"][3].startswith(("≠ ", "= same bits"))
    assert "not in memory" == last["P"][1]
    assert [] == browser.complaints
    assert [] == [each for each in browser.urls if not is_ours(each)]
    assert any(each.endswith("/bokeh.min.js") for each in browser.urls)


async def test_stale_is_told_and_a_gateway_that_is_gone_too(run, browser):
    async with page(run) as url:
        await browser.open(url)
        await browser.until("document.querySelectorAll('#loops tbody tr').length == 2")
        run.clock.advance_ns(3 * SECOND)
        await browser.until("/2 STALE/.test(document.querySelector('#alarm').textContent)")
        row = await browser.ask("document.querySelector('#loops tbody tr').innerText")
        assert "STALE" in row
        assert "(84) °C" in row
    await browser.until("/GATEWAY SILENT/.test(document.querySelector('#alarm').textContent)")


async def test_a_gateway_that_hangs_looks_dead_on_every_page(run, browser):
    async with page(run) as url:
        await browser.open(f"{url}#loop=TIC-101")
        await browser.until(f"{READY} && document.querySelectorAll('#terms tbody tr').length > 5")
        await browser.ask("window.fetch = () => new Promise(() => {}), 1")
        await browser.until("/GATEWAY SILENT/.test(document.querySelector('#alarm').textContent)")
        mv = await browser.ask("[...document.querySelectorAll('#terms tbody tr')].at(-1).innerText")
        said = await browser.ask(
            "[...document.querySelectorAll('#word, #loops tbody .pill')].map(each => each.textContent)"
        )
    assert mv.split()[:2][1].startswith("(")
    assert ["STALE"] * 3 == said


async def test_a_loop_that_is_not_there_and_an_address_that_is_none_are_said(run, browser):
    async with page(run) as url:
        for hash in ("loop=NOBODY", "loop=%25%E0%A4%A"):
            await browser.open(f"{url}?{hash[-3:]}#{hash}")
            await browser.until("/this station has no loop/.test(document.querySelector('#loops-count')?.textContent)")
            assert not await browser.ask("document.querySelector('#page-loops').hidden")
    assert [] == browser.complaints


async def test_dark_and_light_follow_the_desktop_and_the_button(run, browser):
    async with page(run) as url:
        grounds = {}
        for scheme in ("dark", "light"):
            await browser.prefer(scheme)
            await browser.open(f"{url}?{scheme}#loop=TIC-101")
            await browser.until(f"location.search == '?{scheme}' && {READY}")
            grounds[scheme] = await browser.ask(
                "[getComputedStyle(document.body).backgroundColor, ahgateway.trend.plots[0].background_fill_color]"
            )
        await browser.ask("document.querySelector('#theme').click(), 1")
        turned = await browser.ask("getComputedStyle(document.body).backgroundColor")
    assert grounds["dark"] != grounds["light"]
    assert grounds["dark"][0] == turned
    assert "#171e26" == grounds["dark"][1]


async def test_the_wheel_zooms_a_drag_pans_and_live_comes_back(run, browser):
    async with page(run) as url:
        await browser.open(f"{url}#loop=TIC-101")
        await browser.until(READY)
        middle = await browser.ask(
            "(box => [box.x + box.width / 2, box.y + 150])(document.querySelector('#trend').getBoundingClientRect())"
        )
        place = {"x": middle[0], "y": middle[1]}
        wide = await browser.ask("ahgateway.trend.times.end - ahgateway.trend.times.start")
        await browser.do("Input.dispatchMouseEvent", type="mouseMoved", **place)
        await browser.do("Input.dispatchMouseEvent", type="mouseWheel", deltaX=0, deltaY=-400, **place)
        await browser.until(f"ahgateway.trend.times.end - ahgateway.trend.times.start < 0.8 * {wide}")
        assert not await browser.ask("ahgateway.trend.isLive")
        start = await browser.ask("ahgateway.trend.times.start")
        await browser.do("Input.dispatchMouseEvent", type="mousePressed", button="left", clickCount=1, **place)
        for step in (20, 60, 120):
            await browser.do(
                "Input.dispatchMouseEvent", type="mouseMoved", button="left", buttons=1, x=middle[0] + step, y=middle[1]
            )
        await browser.do(
            "Input.dispatchMouseEvent", type="mouseReleased", button="left", x=middle[0] + 120, y=middle[1]
        )
        await browser.until(f"ahgateway.trend.times.start < {start}")
        await browser.ask("document.querySelector('#live').click(), 1")
        await browser.until("ahgateway.trend.isLive")
        again = await browser.ask("ahgateway.trend.times.end - ahgateway.trend.times.start")
    assert wide == pytest.approx(again, rel=1e-6)
