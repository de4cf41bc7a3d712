"""The write gate: the only door to a PLC's memory.

Every write of the house goes through `Gate.write`: armed for one loop and a short time, allow-listed, limited, noted
on the disk before it is sent, read back afresh, undone when anything goes wrong. What may follow what stands in
`states`, what one request may hold in `change`, what may be put back in `session`.

Theory of operation: the intent of every request is on the disk before the request leaves, so that a killed gateway's
next start knows what can stand in the PLC. A request that stays unanswered is never repeated: what stands there is
read, and that decides. Putting back is the same at an error, a signal, a lost link and the next start: read, decide,
write, read, until nothing of ours is left or something is not ours any more.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Mapping
from typing import Any

from ahgateway import __version__
from ahgateway.clock import SECOND, Clock
from ahgateway.codec import block
from ahgateway.codec.block import Raw
from ahgateway.codec.station import Loop, Station
from ahgateway.codec.words import decode
from ahgateway.errors import AhGatewayError, PlcRefusedError, StateError, TransportError
from ahgateway.lockstep.gate import change, checks, planning
from ahgateway.lockstep.gate.change import Item, Step
from ahgateway.lockstep.gate.journal import Told
from ahgateway.lockstep.gate.outcome import Plan, Restored
from ahgateway.lockstep.gate.papers import Papers
from ahgateway.lockstep.gate.place import Place, journal_path, lease_path
from ahgateway.lockstep.gate.plc_lease import PlcLease
from ahgateway.lockstep.gate.scratch import with_scratch
from ahgateway.lockstep.gate.session import GAINS, Session, decide, replayed, words_json
from ahgateway.lockstep.gate.states import Event, State, after
from ahgateway.lockstep.gate.stepping import TRIGGER, Stepping, with_trigger
from ahgateway.lockstep.gate.wire import Wire
from ahgateway.lockstep.picture import Picture, Sees
from ahgateway.transports.base import Link

ARM_DEFAULT_NS = 300 * SECOND
ARM_MAX_NS = 3600 * SECOND
MANUAL_TRIES = 3
UNCLEAN_HINT = "look at the loop; then `--restore` tries again, `--accept` takes it as it stands"
RESTORE_PATIENCE_NS = 30 * SECOND
RESTORE_RETRY_NS = SECOND // 2


class Gate:
    """The write gate of one loop.

    Args:
        station: The PLC.
        loop: The only loop that is ever written; the station's scratch words count as one of its operands.
        link: The way there.
        clock: Gives the times, waits, and ends the arming.
        place: Where journal and lock stand.
        who: Who asks, for the journal.
        sees: Shown every picture that the gate takes.
        told: Told of every record of the journal.

    Attributes:
        state: Where the gate stands.
        session: What this arming has done, None before the first.
        as_found: The picture before the first write, None before it.
        sent_ns: When the last request with a write left.
        recovered: What `arm` had to put back for an earlier run first, None when there was nothing.
        path: The journal.
    """

    def __init__(
        self,
        station: Station,
        loop: Loop,
        link: Link,
        clock: Clock,
        place: Place,
        *,
        who: str = "",
        sees: Sees | None = None,
        told: Told | None = None,
    ) -> None:
        guarded = loop
        loop = with_trigger(with_scratch(loop, station))
        self.station, self.loop, self.link, self.who = station, loop, link, who
        self.state = State.DISARMED
        self.session: Session | None = None
        self.as_found: Picture | None = None
        self.sent_ns = 0
        self.recovered: Restored | None = None
        self.path = journal_path(place, station, loop)
        self._clock = clock
        self._wire = Wire(station, loop, link, clock, sees)
        self._guard = None if loop.lease is None else PlcLease(station, guarded, self._wire, clock)
        self._stepping: Stepping | None = None
        self._spans = block.spans(loop, station.devices)
        self._papers = Papers(self.path, lease_path(place, station, loop), clock, loop.name, who, told)
        self._ends_ns = 0
        self._written_ns: dict[str, int] = {}

    @property
    def anchor(self) -> str:
        """Hash of the journal's last record; it belongs on every sheet and recording."""
        return self._papers.anchor

    # Asking.

    async def preview(self, values: Mapping[str, Any]) -> Plan:
        """Return what `write` would do now, with every check and no write; needs no arming."""
        picture = await self._wire.picture()
        return planning.plan(self.loop, self.station, values, picture)

    async def arm(self, reason: str, *, duration_ns: int = ARM_DEFAULT_NS) -> Picture:
        """Arm the gate: lock, journal, what an earlier run left, as-found snapshot; return the snapshot.

        Raises:
            StateError: Armed already, by us or another; an earlier run left what cannot be put back; the PLC is in
                STOP; the block is empty; the journal is broken.
        """
        if not 0 < duration_ns <= ARM_MAX_NS:
            raise StateError(f"armed for {duration_ns / SECOND:g} s, allowed are up to {ARM_MAX_NS // SECOND} s")
        if self.state is not State.DISARMED:
            after(self.state, Event.ARM)
        await self._finish_earlier()
        self._papers.open()
        try:
            if self._guard is not None:
                await self._guard.take()
            picture = await self._wire.picture()
            checks.fit(self.loop, picture)
            words = {name: picture.words[name] for name in self._spans}
            record = self._papers.append(
                "armed",
                loop=self.loop.name, station=self.station.name, target=self.station.target, unit=self.station.unit,
                who=self.who, why=reason, seconds=duration_ns / SECOND, version=__version__,
                places={name: str(self.loop.bindings.get(name, self.loop.en)) for name in words},
                as_found=words_json(words), lease=0 if self._guard is None else self._guard.owner,
            )  # fmt: skip
            if self._guard is not None:
                await self._guard.guard(words)
        except BaseException:
            await self._give_back()
            self._papers.close()
            raise
        self.as_found = picture
        self.session = replayed([record])
        self._ends_ns = self._clock.now_ns() + duration_ns
        self._written_ns = self._papers.written_ns()
        self._stepping = None
        self.state = after(self.state, Event.ARM)
        return picture

    async def _finish_earlier(self) -> None:
        """Put back what a run that was killed left behind, before anything new begins."""
        pending = self._papers.open()
        if pending is None or pending.end:
            return
        self.session = pending
        if not pending.written:
            self._end("restored")
            return
        await self._take_up(pending)
        self.state = after(self.state, Event.PENDING)
        self.recovered = await self.restore("an earlier run ended without putting back")
        if not self.recovered.is_clean:
            raise StateError(
                f"loop {self.loop.name}: an earlier run ended without putting back {', '.join(pending.written)}; "
                f"{self.recovered.text(self.loop)}",
                hint=UNCLEAN_HINT,
            )

    async def _take_up(self, session: Session) -> None:
        """Hold the PLC's lease while an earlier run is put back, where its snippet runs."""
        if self._guard is None:
            return
        try:
            await self._guard.take(owner=session.lease, is_return=True)
        except BaseException:
            self._papers.close()
            raise

    async def _give_back(self) -> None:
        """Give the PLC's lease back; where that fails, the PLC ends it by itself."""
        if self._guard is not None:
            with contextlib.suppress(AhGatewayError):
                await self._guard.release()

    @contextlib.asynccontextmanager
    async def armed(self, reason: str, *, duration_ns: int = ARM_DEFAULT_NS, keep: bool = False) -> AsyncIterator[Gate]:
        """Arm for the body of an `async with`; put back at its end, or with `keep` only when it fails.

        Raises:
            StateError: As `arm`; or something could not be put back, with the first cause behind it.
        """
        await self.arm(reason, duration_ns=duration_ns)
        try:
            yield self
        except BaseException as cause:
            await self._undo(cause)
            raise
        if self.state in (State.DISARMED, State.BROKEN):
            return
        if keep:
            await self._keep()
            return
        restored = await self.restore("end of the test")
        if not restored.is_clean:
            raise self._unclean(restored, None)

    async def write(self, values: Mapping[str, Any], why: str = "") -> Plan:
        """Write operands of the loop, step by step, each read back; return what was done.

        When a step fails, everything that this arming has written is put back before the error is raised.

        Raises:
            StateError: Not armed, not allowed, outside a limit, too soon, taken over, or not what was read back.
            TransportError: The link failed.
            PlcRefusedError: The PLC refused it.
        """
        await self.check()
        done: list[Step] = []
        picture = await self._wire.picture()
        planned = planning.plan(self.loop, self.station, values, picture)
        checks.rate(self.loop, planned.steps, self._written_ns, self._clock.now_ns())
        changed = {item.operand for step in planned.steps for item in step.items if item.old != item.new}
        try:
            for stage in change.stages(self.loop, values, picture.words):
                if stage == {self.loop.controller.roles.mout: None}:
                    done += await self._follow_mv(why)
                    continue
                # What an earlier stage has written: a sequence waits where a second command would be refused.
                await self.pause(
                    checks.left_ns(self.loop, changed & set(stage), self._written_ns, self._clock.now_ns())
                )
                picture = await self._wire.picture()
                self.look(picture)
                assert self.session is not None
                for step in planning.steps(self.loop, self.station, stage, picture):
                    checks.as_found(self.loop, self.session, step, picture)
                    await self._carry_out(step, "write", why)
                    done.append(step)
        except BaseException as cause:
            await self._undo(cause)
            raise
        return Plan(self.loop.name, tuple(done), planned.unchanged)

    async def step(self) -> int:
        """Let the instruction execute once, on a bench, and return how often the PLC counted.

        When it fails, everything that this arming has written is put back before the error is raised.

        Raises:
            StateError: Not armed, no bench, no trigger, or nothing was counted in time.
            TransportError: The link failed.
            PlcRefusedError: The PLC refused it.
        """
        await self.check()
        assert self.session is not None
        assert self.as_found is not None
        try:
            if self._stepping is None:
                self._stepping = Stepping(self.loop, self.station, self._wire, self._clock)
            self._streamed(TRIGGER, True, {TRIGGER: (0,)})
            return await self._stepping.once(round(float(self.loop.controller.nominal_ts(self.as_found.inputs)) * 1e9))
        except BaseException as cause:
            await self._undo(cause)
            raise

    async def stream(self, operand: str, value: Any, now: Raw) -> tuple[int, ...]:
        """Write the process value of a bench once more; return the words that went out.

        Not read back: whoever streams compares the next picture with what went out. The journal holds the first
        value only, and what stands there afterwards counts as ours. `now` holds the words that stand there.

        Raises:
            StateError: Not armed, or not allowed (`planning.streamed`, `checks.rate`).
            TransportError: The link failed; nothing is put back yet.
            PlcRefusedError: The PLC refused it.
        """
        await self.check()
        step = self._streamed(operand, value, now)
        await self._wire.send(step.request)
        self._written_ns[operand] = self._clock.now_ns()
        return step.items[0].new

    def _streamed(self, operand: str, value: Any, now: Raw) -> Step:
        """The request of something that is written all the time; the first of them stands in the journal."""
        assert self.session is not None
        step = planning.streamed(self.loop, self.station, operand, value, now)
        checks.rate(self.loop, (step,), self._written_ns, self._clock.now_ns())
        (item,) = step.items
        if not self.session.is_streamed(operand):
            self._write_down(step, "stream", "")
            self.session.stream(operand, item.old, item.new)
        return step

    async def check(self) -> None:
        """Make sure that the gate is armed and its time is not over, and beat; put everything back when that fails.

        Raises:
            StateError: It is not armed, the time is over, or the PLC's lease is not ours any more.
            TransportError: The link failed when a beat was due.
            PlcRefusedError: The PLC refused the beat.
        """
        if self.state is not State.ARMED:
            raise StateError(
                f"loop {self.loop.name} is {self.state.value}, nothing is written", hint="`--arm LOOP` arms one loop"
            )
        if self._clock.now_ns() >= self._ends_ns:
            error = StateError(
                f"loop {self.loop.name}: the time for which it was armed is over; what was written has been put back",
                hint="a longer --seconds, or for `ahgateway write` a longer --duration",
            )
            await self._undo(error)
            raise error
        if self._guard is not None:
            try:
                await self._guard.beat()
            except BaseException as cause:
                await self._undo(cause)
                raise

    def look(self, picture: Picture) -> None:
        """Compare a picture taken while armed with what we found and wrote.

        Raises:
            StateError: The mode or something that we wrote has been changed by somebody else.
        """
        assert self.session is not None
        checks.ours(self.loop, self.session, picture)

    async def pause(self, duration_ns: int) -> None:
        """Let time pass; while armed, the beat of the PLC's lease goes on meanwhile.

        Raises:
            StateError: As `check`.
        """
        ends_ns = self._clock.now_ns() + duration_ns
        while self.state is State.ARMED and self._guard is not None:
            await self.check()
            if (left_ns := ends_ns - self._clock.now_ns()) <= 0:
                return
            await self._clock.sleep_ns(min(left_ns, self._guard.period_ns // 2))
        await self._clock.sleep_ns(ends_ns - self._clock.now_ns())

    def tuned(self, picture: Picture) -> None:
        """Note the gains that the instruction's own tuning has written: from now on only these are ours."""
        assert self.session is not None
        holds = {name: picture.words[name] for name in GAINS if name in picture.words}
        for operand, words in holds.items():
            self.session.prove(operand, words)
        self._papers.note("verified", holds=words_json(holds))

    async def _keep(self) -> None:
        """End the arming and leave everything as it was written."""
        try:
            if self._guard is not None:
                # As long as the lease is not given back, the PLC would undo what is to be kept.
                await self._guard.release()
        except BaseException as cause:
            await self._undo(cause)
            raise
        self.state = after(self.state, Event.KEPT)
        self._end("kept")

    async def restore(self, why: str) -> Restored:
        """Put back what still is ours, for as long as it takes the link to come back; then disarm.

        A first cancellation in the middle waits until that is done and then ends the task; a second one ends it there.

        Returns:
            How it ended; when it is not clean, the gate is BROKEN and the journal keeps the session open.
        """
        if self.session is None:
            raise StateError(f"loop {self.loop.name}: nothing was written that could be put back")
        self.state = after(self.state, Event.ABORT)
        self._papers.note("restoring", why=why)
        work = asyncio.ensure_future(self._restored(self.session))
        try:
            return await asyncio.shield(work)
        except asyncio.CancelledError:
            if work.cancelled():
                raise
            restored = await work
            task = asyncio.current_task()
            assert task is not None
            task.cancel()
            return restored

    async def _restored(self, session: Session) -> Restored:
        """Put back, give the PLC's lease back, and write down how it ended."""
        try:
            restored = await self._put_back(session)
        except BaseException:
            # A second Ctrl-C: the journal still says what is open, and the next start puts it back.
            self._papers.close()
            raise
        await self._give_back()
        if restored.is_clean:
            self.state = after(self.state, Event.RESTORED)
            self._end("restored")
            return restored
        self.state = after(self.state, Event.LEFT)
        self._papers.note("left", text=restored.text(self.loop), operands=[each.operand for each in restored.conflicts])
        self._papers.close()
        return restored

    async def recover(self, why: str = "asked for") -> Restored | None:
        """Put back what the last run left: one that never ended, or one that kept what it wrote.

        Returns:
            How it ended, None when there is nothing to put back.

        Raises:
            StateError: Another gateway has the loop armed, or the journal is broken.
        """
        session = self._papers.open()
        if session is None or session.end in ("restored", "accepted"):
            self._papers.close()
            return None
        self.session = session
        await self._take_up(session)
        self.state = State.BROKEN
        try:
            return await self.restore(why)
        finally:
            self._papers.close()

    def accept(self, why: str) -> bool:
        """End a session that was left open: a person has looked, and what stands in the PLC is right.

        Returns:
            False when no session was open.
        """
        session = self._papers.open()
        if session is None or session.end:
            self._papers.close()
            return False
        self.session = session
        self.state = after(State.BROKEN, Event.CLEARED)
        self._papers.append("accepted", who=self.who, why=why)
        self._end("accepted")
        return True

    # Doing.

    async def _follow_mv(self, why: str) -> list[Step]:
        """Let MOUT hold MV, as near as MV stands still meanwhile; the loop is still in automatic."""
        done: list[Step] = []
        roles = self.loop.controller.roles
        limit = change.allowed(self.loop, self.station, roles.mout)
        assert limit.step_max is not None
        for _ in range(MANUAL_TRIES):
            picture = await self._wire.picture()
            self.look(picture)
            held = decode(self.loop.controller.operand(roles.mout).kind, picture.words[roles.mout])
            mout, mv = float(held), float(picture.seen[roles.mv])
            if change.follows_mv(roles, picture.words) or (done and abs(mv - mout) <= limit.step_max):
                return done
            for step in planning.steps(self.loop, self.station, {roles.mout: picture.seen[roles.mv]}, picture):
                assert self.session is not None
                checks.as_found(self.loop, self.session, step, picture)
                await self._carry_out(step, "write", why)
                done.append(step)
            if not done:
                return done
        raise StateError(
            f"loop {self.loop.name}: {roles.mv} moves faster than {roles.mout} can follow, {mout:g} behind {mv:g}",
            hint="wait until the loop is quieter",
        )

    async def _carry_out(self, step: Step, kind: str, why: str) -> None:
        """One request: intent on disk, sent, acknowledged, read back afresh."""
        assert self.session is not None
        is_write = kind == "write"
        if self._guard is not None:
            await self._guard.beat()
            await self._guard.intend(self.session, step)
        self._write_down(step, kind, why)
        for item in step.items:
            self.session.intend(item.operand, item.old, item.new)
        if is_write:
            self.state = after(self.state, Event.SEND)
        self.sent_ns = self._clock.now_ns()
        asked = f"loop {self.loop.name}: {', '.join(change.line(item) for item in step.items)}"
        try:
            await self._wire.send(step.request)
        except PlcRefusedError as error:
            self._papers.note("refused", code=error.code, text=error.message)
            raise PlcRefusedError(f"{asked}: {error.message}", code=error.code, hint=error.hint) from error
        except TransportError as error:
            # Nobody knows whether it arrived; it is not sent again, what stands there decides.
            self._papers.note("doubt", text=error.message)
            await self._clock.sleep_ns(self._wire.settle_ns)
        if is_write:
            self.state = after(self.state, Event.ACKNOWLEDGED)
        try:
            wrong = await self._wire.read_back(step)
        except TransportError as error:
            raise type(error)(f"{asked}: nobody knows whether it arrived: {error.message}", hint=error.hint) from error
        if wrong:
            self._papers.note("mismatch", text=wrong)
            raise StateError(
                f"loop {self.loop.name}: {wrong}",
                hint="the PLC program or another master writes it too; look for it before anything else is written",
            )
        if self._guard is not None and is_write:
            await self._guard.prove(self.session, step)
        holds = {item.operand: item.new for item in step.items}
        for operand, words in holds.items():
            self.session.prove(operand, words)
        self._papers.note("verified", holds=words_json(holds))
        if is_write:
            self._written_ns.update(dict.fromkeys(holds, self._clock.now_ns()))
            self.state = after(self.state, Event.VERIFIED)

    def _write_down(self, step: Step, kind: str, why: str) -> None:
        facts = {
            "table": step.request.table.value, "address": step.request.address, "words": list(step.request.values),
            "items": [item.facts() for item in step.items], "who": self.who, "why": why,
        }  # fmt: skip
        if kind != "restore":
            self._papers.append(kind, **facts)
        else:
            # A full disk must not keep a loop from going back.
            self._papers.note(kind, **facts)

    async def _undo(self, cause: BaseException) -> None:
        """Put back after a failure, once; raise what is left over."""
        if self.state in (State.DISARMED, State.BROKEN):
            return
        restored = await self.restore(f"{type(cause).__name__}: {cause}")
        if not restored.is_clean:
            raise self._unclean(restored, cause) from cause
        if isinstance(cause, AhGatewayError) and self.session is not None and self.session.written:
            cause.add(restored.text(self.loop))

    async def _put_back(self, session: Session) -> Restored:
        """Read, decide, write, read, until nothing of ours is left or something is not ours any more."""
        ends_ns = self._clock.now_ns() + RESTORE_PATIENCE_NS
        done: list[str] = []
        while True:
            try:
                await self._see_put_back(session)
                picture = await self._wire.picture()
                decision = decide(session, self.loop.controller.roles, picture.words)
                if not decision.stages:
                    return Restored(tuple(done), decision.conflicts, decision.is_taken_over)
                await self._put_stage(decision.stages[0], picture.words)
                done += decision.stages[0]
            except AhGatewayError as error:
                if self._clock.now_ns() >= ends_ns:
                    return Restored(tuple(done), error=error.message)
                await self._clock.sleep_ns(RESTORE_RETRY_NS)

    async def _see_put_back(self, session: Session) -> None:
        """What the PLC itself has put back is as found because of us, and no takeover."""
        if self._guard is None or not session.lease or session.is_put_back:
            return
        if (await self._guard.head()).put_back(session.lease):
            self._papers.note("put-back", text="the PLC itself, at the end of the lease")
            session.put_back()

    async def _put_stage(self, stage: Mapping[str, tuple[int, ...]], now: Raw) -> None:
        items = []
        for name, words in stage.items():
            kind = self.loop.controller.operand(name).kind
            items.append(Item(name, str(self.loop.bindings[name]), kind, self._spans[name], now[name], words))
        for step in change.steps(self.loop, self.station, items, is_return=True):
            await self._carry_out(step, "restore", "")

    def _end(self, how: str) -> None:
        assert self.session is not None
        self.session.end = how
        self._papers.note("ended", how=how)
        self._papers.close()

    def _unclean(self, restored: Restored, cause: BaseException | None) -> StateError:
        where = f"loop {self.loop.name}: "
        first = f"{cause.message if isinstance(cause, AhGatewayError) else cause}; " if cause is not None else ""
        return StateError(f"{where}{first.removeprefix(where)}{restored.text(self.loop)}", hint=UNCLEAN_HINT)
