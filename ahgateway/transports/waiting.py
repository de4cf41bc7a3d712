"""The queue of one line: what has been asked and not been sent, commands before polls, each with its deadline.

Commands are writes, and reads that belong to one (a picture before it, the read-back behind it). They go before every
poll, in their own order; polls are first come, first served, so that several loops and units that each ask when their
last answer is there take turns. What has waited too long is not sent any more.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Protocol

from ahgateway.codec.access import Read, Request
from ahgateway.transports.base import Reply
from ahgateway.transports.pdu import Shape


class Waiter(Protocol):
    """Where an outcome goes; an `asyncio.Future` is one."""

    def done(self) -> bool: ...

    def set_result(self, reply: Reply, /) -> None: ...

    def set_exception(self, error: Exception, /) -> None: ...


class Job:
    """One request on its way.

    Attributes:
        asked_ns: When it was asked.
        sent_ns: When it left; set when it does.
        deadline_ns: Until when its reply must be there; set when it leaves.
        waiter: Where the outcome goes, None for an alignment probe.
        ahead_of: The request for which a probe goes out.
    """

    __slots__ = ("ahead_of", "asked_ns", "deadline_ns", "pdu", "request", "sent_ns", "shape", "waiter")

    sent_ns: int
    deadline_ns: int

    def __init__(
        self, asked: tuple[Request, bytes, Shape], waiter: Waiter | None, asked_ns: int, ahead_of: Job | None = None
    ) -> None:
        self.request, self.pdu, self.shape = asked
        self.waiter = waiter
        self.asked_ns = asked_ns
        self.ahead_of = ahead_of


class Waiting:
    """What waits to be sent.

    Args:
        wait_max_ns: How long a request may wait, 0 for any time.
    """

    def __init__(self, wait_max_ns: int = 0) -> None:
        self._wait_max_ns = wait_max_ns
        self._commands: deque[Job] = deque()
        self._polls: deque[Job] = deque()

    def __bool__(self) -> bool:
        return bool(self._polls or self._commands)

    def __iter__(self) -> Iterator[Job]:
        yield from self._commands
        yield from self._polls

    @property
    def head(self) -> Job:
        """What goes out next."""
        return (self._commands or self._polls)[0]

    def append(self, job: Job) -> None:
        """Queue a job behind those of its kind."""
        request = job.request
        is_poll = isinstance(request, Read) and not request.is_command
        (self._polls if is_poll else self._commands).append(job)

    def popleft(self) -> Job:
        """Take what goes out next."""
        return (self._commands or self._polls).popleft()

    def remove(self, job: Job) -> bool:
        """Take this job out; False when it waits no more."""
        for queue in (self._commands, self._polls):
            if job in queue:
                queue.remove(job)
                return True
        return False

    def clear(self) -> None:
        """Forget everything."""
        self._commands.clear()
        self._polls.clear()

    def due_ns(self) -> int | None:
        """Return when the first of those that wait has waited too long, None for never."""
        if not self._wait_max_ns:
            return None
        return min(
            (queue[0].asked_ns + self._wait_max_ns for queue in (self._commands, self._polls) if queue), default=None
        )

    def expired(self, now_ns: int) -> list[Job]:
        """Take out and return what has waited too long."""
        found = []
        for queue in (self._commands, self._polls):
            while self._wait_max_ns and queue and queue[0].asked_ns + self._wait_max_ns <= now_ns:
                found.append(queue.popleft())
        return found
