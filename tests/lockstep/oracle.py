"""A judge that knows nothing but the law and patience: every state, order of writes and interval is enumerated.

Written apart from the shadow, for loops small enough: D off, so that what is hidden is a handful of bits. It says of
an execution what can be claimed; the follower may claim that and nothing else.
"""

from __future__ import annotations

from itertools import combinations, product
from typing import Any

from ahgateway.codec.station import Loop
from ahgateway.core.real import REAL, bits, from_order, order, quiet
from ahgateway.lockstep.picture import Picture

SAYS = {"PROVEN", "OPEN", "BROKEN"}


class Oracle:
    """Every state that one loop's instruction can have, as a plain set."""

    def __init__(self, loop: Loop, ticks: range | None = None) -> None:
        self.loop = loop
        self.states: set[Any] = set()
        self._ticks = ticks

    def begin(self, after: Picture) -> None:
        """Know nothing but the words: every hidden bit can be either way, and E is or is not inside the band."""
        sample = self.loop.controller.state()
        shown = {word.attr: after.seen[word.name] for word in self.loop.controller.seen if hasattr(sample, word.attr)}
        read = after.inputs
        er = read.sv - shown["pv1"] if read.pid_dir else shown["pv1"] - read.sv
        self.states = set()
        booleans = [name for name in ("cross", "man1") if hasattr(sample, name)]
        for values in product((False, True), repeat=len(booleans)):
            hidden = dict(zip(booleans, values, strict=True))
            if hidden.get("man1", False) != bool(read.pid_man):
                continue
            if hidden.get("cross") and not 0 < abs(float(read.err_dbw)) > abs(float(er)):
                continue
            extra = {"er1": er} if hasattr(sample, "er1") else {}
            e1 = er - er if hidden.get("cross") else er
            self.states.add(sample._replace(**shown, **hidden, **extra, e1=e1, valid=True))

    def says(self, before: Picture, after: Picture) -> str:
        """Judge an execution, and keep the states that explain it.

        Returns:
            PROVEN when with some order of writes every state predicts the very words, by the one interval that fits;
            BROKEN when nothing predicts them; OPEN when something does and something else, just as possible, does not.
        """
        seen = {word.name: bits(after.seen[word.name]) for word in self.loop.controller.seen}
        behind, is_proven = set(), False
        for inputs in self._orders(before, after):
            outcomes: dict[int, set[tuple[Any, bool]]] = {}
            for ts in self._intervals(inputs):
                for state in self.states:
                    with quiet(all="ignore"):
                        reached, terms = self.loop.controller.step(inputs, state, self.loop.dialect, ts)
                    words = {word.name: bits(word.value(reached, terms)) for word in self.loop.controller.seen}
                    outcomes.setdefault(bits(ts), set()).add((tuple(words.items()), words == seen))
                    if words == seen:
                        behind.add(reached)
            fitting = [each for each in outcomes.values() if any(is_same for _, is_same in each)]
            everything = set().union(*outcomes.values())
            is_proven |= len(everything) == 1 and bool(fitting)
            is_proven |= len(fitting) == 1 and len(fitting[0]) == 1
        if not behind:
            return "BROKEN"
        self.states = behind
        return "PROVEN" if is_proven else "OPEN"

    def says_of_several(self, before: Picture, after: Picture, most: int) -> str:
        """Judge up to `most` executions of which all that they read is known, but for the moment of one change.

        Returns:
            PROVEN when one number of executions alone can leave the words, and from every state and moment does;
            BROKEN when none can; OPEN otherwise.
        """
        seen = {word.name: bits(after.seen[word.name]) for word in self.loop.controller.seen}
        pv = next(after.seen[word.name] for word in self.loop.controller.seen if word.attr == "pv1")
        early, late = (inputs._replace(pv=pv) for inputs in (before.inputs, after.inputs))
        behind, counts, is_unanimous = set(), [], True
        for executions in range(1, most + 1):
            outcomes = set()
            for olds in range(executions + 1):
                for state in self.states:
                    reached = state
                    for number in range(executions):
                        reached, terms = self._step(early if number < olds else late, reached)
                    words = {word.name: bits(word.value(reached, terms)) for word in self.loop.controller.seen}
                    outcomes.add(words == seen)
                    if words == seen:
                        behind.add(reached)
            if True in outcomes:
                counts.append(executions)
                is_unanimous &= len(outcomes) == 1
        if not behind:
            return "BROKEN"
        self.states = behind
        return "PROVEN" if len(counts) == 1 and is_unanimous else "OPEN"

    def follows(self, before: Picture, after: Picture, most: int) -> bool:
        """Keep the states to which up to `most` executions can have led, none included, from one picture to the next.

        Returns:
            False when none of them leaves the words of the second picture.
        """
        names = [word.name for word in self.loop.controller.seen]
        seen = [bits(after.seen[name]) for name in names]
        pv = next(after.seen[word.name] for word in self.loop.controller.seen if word.attr == "pv1")
        early, late = (inputs._replace(pv=pv) for inputs in (before.inputs, after.inputs))
        is_still = seen == [bits(before.seen[name]) for name in names]
        behind = set(self.states) if is_still else set()
        orders = [(early,), (late,)] if early != late else [(late,)]
        reached = {(reads[0] is late, *self._step(reads[0], state)) for reads in orders for state in self.states}
        for _ in range(most):
            for _, state, terms in reached:
                if seen == [bits(word.value(state, terms)) for word in self.loop.controller.seen]:
                    behind.add(state)
            reached = {
                (is_late or read is late, *self._step(read, state))
                for is_late, state, _ in reached
                for read in ((late,) if is_late else (early, late))
            }
        self.states = behind
        return bool(behind)

    def rest(self, picture: Picture) -> None:
        """Add what executions that change no word can have left hidden behind a picture."""
        seen = {word.name: bits(picture.seen[word.name]) for word in self.loop.controller.seen}
        front = set(self.states)
        while front:
            reached = set()
            for state in front:
                behind, terms = self._step(picture.inputs, state)
                if seen == {word.name: bits(word.value(behind, terms)) for word in self.loop.controller.seen}:
                    reached.add(behind)
            front = reached - self.states
            self.states |= front

    def explains_unrecorded(self, before: Picture, after: Picture) -> bool:
        """Tell whether some PV, which no register shows, leaves the words; I is monotone in it, so it is bisected."""
        for inputs in self._orders(before, after):
            for state in self.states:
                low, high = order(REAL(-1e4)), order(REAL(1e4))
                ends = [float(self._step(inputs._replace(pv=from_order(end)), state)[0].i) for end in (low, high)]
                sign = 1 if ends[1] >= ends[0] else -1
                while low < high:
                    middle = (low + high) // 2
                    i = self._step(inputs._replace(pv=from_order(middle)), state)[0].i
                    low, high = (
                        (middle + 1, high) if sign * (float(i) - float(after.seen["I_MV"])) < 0 else (low, middle)
                    )
                reached, terms = self._step(inputs._replace(pv=from_order(low)), state)
                words = {word.name: bits(word.value(reached, terms)) for word in self.loop.controller.seen}
                if words == {word.name: bits(after.seen[word.name]) for word in self.loop.controller.seen}:
                    return True
        return False

    def _step(self, inputs: Any, state: Any) -> tuple[Any, Any]:
        with quiet(all="ignore"):
            return self.loop.controller.step(
                inputs, state, self.loop.dialect, self.loop.controller.ts(inputs, self.loop.dialect)
            )

    def _orders(self, before: Picture, after: Picture) -> list[Any]:
        """Each operand that changed was written before or behind the execution; PV is what it recorded."""
        if after.is_exact:
            return [after.inputs]
        names = [
            name
            for name in self.loop.controller.input_names
            if name != "pv" and bits_of(getattr(before.inputs, name)) != bits_of(getattr(after.inputs, name))
        ]
        pv = next(after.seen[word.name] for word in self.loop.controller.seen if word.attr == "pv1")
        found = []
        for size in range(len(names) + 1):
            for early in combinations(names, size):
                changed = {name: getattr(after.inputs, name) for name in early}
                found.append(before.inputs._replace(**changed, pv=pv))
        return found

    def _intervals(self, inputs: Any) -> list[Any]:
        controller = self.loop.controller
        if self._ticks is None:
            return [controller.ts(inputs, self.loop.dialect)]
        return [controller.ts(inputs, self.loop.dialect, ticks) for ticks in self._ticks]


def bits_of(value: Any) -> int:
    return bits(value) if hasattr(value, "dtype") else int(value)
