"""What writing commands share: where journals and leases stand, who asks, and an end in good order at a signal."""

from __future__ import annotations

import asyncio
import contextlib
import getpass
import tempfile
from collections.abc import Coroutine, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from ahgateway.codec.station import Loop, Station
    from ahgateway.lockstep.gate.place import Place

Result = TypeVar("Result")


@contextlib.contextmanager
def gate_directory(station: Station, directory: Path | None) -> Iterator[Place]:
    """Yield where journals and leases stand; a fake PLC ends with us, and so does its journal.

    Leases of a real PLC are always at the same place: another directory for the journal is no way around them.
    """
    from ahgateway.lockstep.gate.place import Folders

    if station.target.startswith("fake://"):
        with tempfile.TemporaryDirectory(prefix="ahgateway-") as folder:
            yield directory or Path(folder)
        return
    from platformdirs import user_data_path, user_state_path

    leases = user_state_path("ahgateway", appauthor=False) / "leases"
    try:
        leases.mkdir(parents=True, exist_ok=True)
    except OSError:
        leases = Path(tempfile.gettempdir()) / "ahgateway" / "leases"
    yield Folders(directory or user_data_path("ahgateway", appauthor=False) / "gate", leases)


def who_asks(by: str | None) -> str:
    """Return the name that was given, else that of the user of this machine."""
    if by:
        return legible(by)
    try:
        return legible(getpass.getuser())
    except (OSError, KeyError, ImportError):
        return ""


def legible(text: str) -> str:
    """Return what a person typed, for paper and journal: no control characters, no bytes that are no text."""
    text = text.encode("utf-8", "replace").decode("utf-8")
    return "".join(sign if sign.isprintable() else " " for sign in text)


def loop_named(station: Station, name: str | None) -> Loop:
    """Return the loop with this tag; the only one when none was named.

    Raises:
        ProfileError: There is none of that name, or several to choose from.
    """
    from difflib import get_close_matches

    from ahgateway.errors import ProfileError

    names = [loop.name for loop in station.loops]
    if name is None and len(names) == 1:
        return station.loops[0]
    if name is None:
        raise ProfileError(f"which loop? the station has {', '.join(names)}", hint=f"`--loop {names[0]}`")
    if name not in names:
        near = get_close_matches(name, names, 1, 0.5)
        raise ProfileError(
            f"station {station.name} has no loop `{name}`, it has {', '.join(names)}",
            hint=f"did you mean `{near[0]}`?" if near else None,
        )
    return station.loops[names.index(name)]


async def until_stopped(work: Coroutine[Any, Any, Result]) -> Result:
    """Run to the end, or cancel at the first signal and let the gate put everything back.

    Raises:
        StateError: A signal ended it.
    """
    from ahgateway.cli.interrupt import stop_event
    from ahgateway.errors import StateError

    with stop_event() as stop:
        task = asyncio.ensure_future(work)
        stopping = asyncio.ensure_future(stop.wait())
        try:
            await asyncio.wait({task, stopping}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            # Also when this waiting itself is cancelled: the link must not close before the gate has put things back.
            stopping.cancel()
            if not task.done():
                task.cancel()
                await asyncio.wait({task})
            if not task.cancelled():
                task.exception()
        try:
            return task.result()
        except asyncio.CancelledError:
            raise StateError("stopped; what was written has been put back") from None
