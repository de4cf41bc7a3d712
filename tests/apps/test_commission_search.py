"""The search for a silent PLC: an adapter that refuses some settings is not one that is not there."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from apps.commission_bench import station

from ahgateway.apps.commission.link_search import search
from ahgateway.clock import SECOND, VirtualClock
from ahgateway.codec.access import Request
from ahgateway.codec.station import Station
from ahgateway.errors import LinkError, ReplyTimeoutError
from ahgateway.transports.base import LinkFigures, Reply

PORT = "/dev/ttyUSB0"


@dataclass
class Adapter:
    """An adapter with a PLC behind it that answers to one target only; `refused` settings it does not know."""

    right: str
    refused: str
    cause: str = "the adapter refuses {settings}"
    tried: list[str] = field(default_factory=list)

    async def open(self, variant: Station) -> Line:
        self.tried.append(variant.target)
        return Line(self, variant.target)


@dataclass
class Line:
    adapter: Adapter
    target: str
    figures: LinkFigures = field(default_factory=LinkFigures)

    async def exchange(self, request: Request) -> Reply:
        if self.adapter.refused in self.target:
            settings = self.target.partition("?")[2]
            cause = self.adapter.cause.format(settings=settings)
            place = self.target.partition("?")[0]
            raise LinkError(f"{place}: {cause}, before an answer to: read 2 holding registers from 0x006A of unit 1")
        if self.target != self.adapter.right:
            raise ReplyTimeoutError(f"{self.target}: no reply")
        return Reply(request, (7, 0)[: request.count], 0, 0, 0, 0)  # type: ignore[union-attr]

    async def close(self) -> None:
        return None


def skid() -> Station:
    return replace(station(), target=f"modbus+rtu://{PORT}?baud=19200&parity=E")


async def test_settings_that_an_adapter_refuses_do_not_end_the_search_of_its_port() -> None:
    right = f"modbus+rtu://{PORT}?baud=9600&parity=O"
    adapter = Adapter(right, "bits=7")
    done = await search(skid(), skid().loops[0], adapter.open, VirtualClock(), budget_ns=60 * SECOND)
    assert done.found is not None, done.text
    assert right == done.found.target
    assert sum("bits=7" in target for target in adapter.tried) > 3


async def test_a_port_that_is_not_there_is_given_up_whatever_the_settings() -> None:
    adapter = Adapter("", PORT, "there is no such port")
    done = await search(skid(), skid().loops[0], adapter.open, VirtualClock(), budget_ns=60 * SECOND)
    assert 3 == len(adapter.tried)
    assert f"{PORT}: there is no such port" in done.text
