"""`monitor --web`: where the page is said to be, who needs a token, what is refused."""

from __future__ import annotations

import pytest
from tornado.httpclient import AsyncHTTPClient, HTTPClientError
from tui.screen_world import ScreenWorld

from ahgateway.cli.page import TOKEN, Page, paged
from ahgateway.errors import StateError

pytestmark = pytest.mark.slow


@pytest.fixture
async def world() -> ScreenWorld:
    world = ScreenWorld(warm_up_s=5)
    await world.run(0.5)
    return world


def serve(world: ScreenWorld, page: Page, said: list[str]):
    return paged(page, world.monitor.station, world.board, world.monitor, lambda: None, said.append)


async def test_its_address_is_said_and_it_answers_there(world):
    said: list[str] = []
    async with serve(world, Page(True, 0, "127.0.0.1"), said):
        assert 1 == len(said)
        assert said[0].startswith("page at http://127.0.0.1:")
        reply = await AsyncHTTPClient().fetch(f"{said[0].removeprefix('page at ')}state.json")
    assert b'"station":"Demo"' in reply.body
    with pytest.raises(OSError, match=r"refused|closed|reset"):
        await AsyncHTTPClient().fetch(said[0].removeprefix("page at "))


async def test_another_address_brings_a_token_and_a_warning(world):
    said: list[str] = []
    async with serve(world, Page(True, 0, "0.0.0.0"), said):
        address, warning = said
        port = address.split(":")[2].split("/")[0]
        token = address.partition("?token=")[2]
        assert 24 < len(token)
        assert warning.startswith("warning: the page is open to the network at 0.0.0.0, unencrypted")
        with pytest.raises(HTTPClientError) as refused:
            await AsyncHTTPClient().fetch(f"http://127.0.0.1:{port}/state.json")
        assert 403 == refused.value.code
        reply = await AsyncHTTPClient().fetch(f"http://127.0.0.1:{port}/state.json?token={token}")
        assert 200 == reply.code


async def test_a_token_of_one_s_own_must_be_long_enough(world, monkeypatch):
    monkeypatch.setenv(TOKEN, "short")
    with pytest.raises(StateError, match="has 5 characters, at least 16"):
        async with serve(world, Page(True, 0, "0.0.0.0"), []):
            pass
    monkeypatch.setenv(TOKEN, "sixteen-or-more-characters")
    said: list[str] = []
    async with serve(world, Page(True, 0, "0.0.0.0"), said):
        assert said[0].endswith("/?token=sixteen-or-more-characters")


async def test_this_machine_needs_none(world, monkeypatch):
    monkeypatch.setenv(TOKEN, "short")
    said: list[str] = []
    async with serve(world, Page(True, 0, "127.0.0.1"), said):
        assert "token" not in said[0]
