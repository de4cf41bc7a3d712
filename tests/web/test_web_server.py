"""What the page is fed with: the numbers of the run, only by looking, only to this machine."""

from __future__ import annotations

import json

import pytest
from tornado.httpclient import AsyncHTTPClient, HTTPClientError, HTTPRequest
from tui.screen_world import ScreenWorld

from ahgateway.apps.history import History
from ahgateway.clock import SECOND
from ahgateway.errors import StateError
from ahgateway.web.server import FACTS, Source, is_loopback, served

pytestmark = pytest.mark.slow
TOKEN = "a-token-that-nobody-knows"


@pytest.fixture
async def world() -> ScreenWorld:
    world = ScreenWorld(warm_up_s=20)
    await world.run(3.0)
    return world


def source(world: ScreenWorld, **more) -> Source:
    return Source(world.board, History(world.board, lambda: None), "Demo", **more)


async def get(port: int, path: str, **more):
    return await AsyncHTTPClient().fetch(f"http://127.0.0.1:{port}/{path}", **more)


async def fact(port: int, path: str):
    return json.loads((await get(port, path)).body)


async def code(port: int, path: str, **more) -> int:
    with pytest.raises(HTTPClientError) as refused:
        await get(port, path, **more)
    return refused.value.code


async def test_rows_terms_and_operands_are_those_of_the_run(world):
    picture = world.board.watches["TIC-101"].follower.picture
    async with served(source(world), 0) as port:
        state = await fact(port, "state.json")
        loop = await fact(port, "loop.json?loop=TIC-101")
    row = state["loops"][0]
    assert ["TIC-101", "MATCH", "80", "auto"] == [row[name] for name in ("name", "word", "sv", "mode")]
    assert float(picture.seen["MV"]) == pytest.approx(float(row["mv"]), rel=1e-6)
    assert world.clock.utc_ns() / SECOND == state["t"]
    assert [0, 0, True, 1.0, None] == [state[name] for name in ("stale", "diverged", "up", "moves", "player")]
    terms = {each["name"]: each for each in loop["terms"]}
    assert ["E", "P", "I", "D", "BIAS", "RAW", "MV"] == list(terms)
    assert (True, "same bits") == (terms["MV"]["same"], terms["MV"]["compared"])
    assert terms["P"]["plc"] is None
    operands = {each["name"]: each for each in loop["operands"]}
    assert ["D110", "0.05"] == [operands["Ti_Ki"][name] for name in ("device", "value")]


async def test_the_trend_is_the_trail_number_for_number(world):
    trace = world.board.trails.trails["TIC-101"].trace()
    since, until = trace.t_s[0], trace.t_s[-1]
    async with served(source(world), 0) as port:
        found = await fact(port, f"trend.json?loop=TIC-101&since={since}&until={until}&slices=1000")
        recent = await fact(port, f"recent.json?since={since}")
    assert trace.t_s.tolist() == found["t"]
    assert trace.pv.tolist() == found["pv"]
    assert [None if mv != mv else mv for mv in trace.ref_mv.tolist()] == found["ref_mv"]
    assert found["whole"]
    assert trace.t_s.tolist()[1:] == recent["loops"]["TIC-101"]["t"]
    assert [0] == sorted({0, *recent["loops"]["TIC-101"]["mark"]} - {1, 2, 3, 4, 5, 6})


async def test_a_changed_operand_and_a_note_are_told(world):
    world.plc.write("TIC-101", "Kc_Kp", 2.5)
    await world.run(1.0)
    world.board.note("valve")
    async with served(source(world), 0) as port:
        loop = await fact(port, "loop.json?loop=TIC-101")
        log = await fact(port, "log.json?after=0")
        later = await fact(port, f"log.json?after={log['count']}")
    changed = [each["changed"] for each in loop["operands"] if each["name"] == "Kc_Kp"]
    assert ["00:00:23 2 → 2.5"] == changed
    assert any("operand Kc_Kp: 2 -> 2.5" in line for line in log["lines"])
    assert log["lines"][-1].endswith("note: valve")
    assert [] == later["lines"]


async def test_stale_values_are_told_as_stale(world):
    world.clock.advance_ns(3 * SECOND)
    async with served(source(world), 0) as port:
        state = await fact(port, "state.json")
    assert 2 == state["stale"]
    assert ["STALE", True] == [state["loops"][0][name] for name in ("word", "stale")]


@pytest.mark.parametrize("method", ["POST", "PUT", "PATCH", "DELETE", "OPTIONS"])
async def test_nothing_but_looking_is_known(world, method):
    async with served(source(world), 0) as port:
        for path in ("", "bokeh.min.js", *(f"{name}.json" for name in FACTS), "elsewhere"):
            body = "" if method in ("POST", "PUT", "PATCH") else None
            assert 405 == await code(port, path, method=method, body=body)


def test_every_door_is_one_that_only_lets_look():
    from ahgateway.web.server import Reading

    for handler in (Reading, *FACTS.values()):
        assert ("GET", "HEAD") == handler.SUPPORTED_METHODS
        for method in ("post", "put", "patch", "delete"):
            assert getattr(handler, method).__qualname__.startswith("RequestHandler.")


@pytest.mark.parametrize(
    ("status", "path"),
    [
        (404, "elsewhere"),
        (404, "../pyproject.toml"),
        (404, "loop.json?loop=nobody"),
        (404, "loop.json"),
        (400, "trend.json?loop=TIC-101&since=nan&until=2&slices=3"),
        (400, "trend.json?loop=TIC-101&since=3&until=2&slices=3"),
        (400, "trend.json?loop=TIC-101&since=1&until=2&slices=1000000"),
        (400, "recent.json?since=x"),
        (400, "recent.json"),
    ],
)
async def test_a_wrong_question_is_refused_in_words(world, status, path):
    async with served(source(world), 0) as port:
        with pytest.raises(HTTPClientError) as refused:
            await get(port, path)
    assert status == refused.value.code
    assert json.loads(refused.value.response.body)["error"]


async def test_the_browser_is_told_to_ask_nobody_else(world):
    async with served(source(world), 0) as port:
        for path in ("", "page.js", "state.json"):
            headers = (await get(port, path)).headers
            policy = headers["Content-Security-Policy"]
            assert policy.startswith("default-src 'none'; script-src 'self';")
            assert "http" not in policy
            assert "no-store" == headers["Cache-Control"]
        page = (await get(port, "")).body.decode()
    assert "//" not in page.replace("<!doctype", "")


async def test_another_site_cannot_ask_under_its_own_name(world):
    async with served(source(world), 0) as port:
        assert 403 == await code(port, "state.json", headers={"Host": f"evil.example:{port}"})
        for name in ("localhost", "127.0.0.1", "[::1]"):
            reply = await get(port, "state.json", headers={"Host": f"{name}:{port}"})
            assert 200 == reply.code


async def test_another_address_needs_the_token(world):
    with pytest.raises(StateError, match=r"0\.0\.0\.0 without a token"):
        async with served(source(world, host="0.0.0.0"), 0):
            pass
    async with served(source(world, token=TOKEN), 0) as port:
        assert 403 == await code(port, "state.json")
        assert 403 == await code(port, "state.json?token=wrong")
        reply = await get(port, f"?token={TOKEN}")
        cookie = reply.headers["Set-Cookie"]
        assert "HttpOnly" in cookie
        assert "SameSite=Strict" in cookie
        kept = cookie.partition(";")[0]
        reply = await AsyncHTTPClient().fetch(
            HTTPRequest(f"http://127.0.0.1:{port}/state.json", headers={"Cookie": kept})
        )
        assert 200 == reply.code


async def test_a_port_that_is_taken_is_said(world):
    async with served(source(world), 0) as port:
        with pytest.raises(StateError, match=f"127.0.0.1:{port}"):
            async with served(source(world), port):
                pass


@pytest.mark.parametrize(
    ("is_ours", "host"),
    [
        (True, "127.0.0.1"),
        (True, "127.8.9.1"),
        (True, "::1"),
        (True, "[::1]"),
        (True, "localhost"),
        (False, "0.0.0.0"),
        (False, "192.0.2.4"),
        (False, "localhost.example"),
        (False, ""),
    ],
)
def test_only_this_machine_is_this_machine(is_ours, host):
    assert is_ours is is_loopback(host)
