"""Learn the dialect of each loop from pictures, live or recorded; results as data, no printing."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

from ahgateway.apps.monitor import Report, Sample
from ahgateway.codec.station import Loop, Station
from ahgateway.core.controllers.block_axes import axes_of
from ahgateway.core.dialect import PvWord
from ahgateway.core.dialect_axes import BY_NAME, Axis
from ahgateway.core.dialect_moves import spoken
from ahgateway.core.verdict import Exit
from ahgateway.lockstep import crossings, moments, restarts, written_back
from ahgateway.lockstep.candidates import values_of
from ahgateway.lockstep.identify import Identification, identify, observed
from ahgateway.lockstep.identify_calls import identify_calls
from ahgateway.lockstep.picture import Picture
from ahgateway.lockstep.words import Followed, followed, pv_placed


class Open(NamedTuple):
    """An axis that is left open.

    Attributes:
        axis: Its name.
        group: Part of the law that it belongs to, as in `dialect_axes`.
        values: What is left, as a profile spells it.
        is_narrowed: The trace excluded some of its values, so that the loop as it runs depends on it.
        excitation: What an operator can do to tell them apart.
        after: Axes that are open too and have to be decided before.
        unseen: Where what is left cannot be told apart, whatever an operator does; "" where it can.
    """

    axis: str
    group: str
    values: tuple[str, ...]
    is_narrowed: bool
    excitation: str
    after: tuple[str, ...] = ()
    unseen: str = ""


@dataclass(frozen=True, slots=True)
class Learned:
    """What one loop's pictures say.

    Attributes:
        loop: The loop as the profile has it.
        found: The outcome of the elimination.
        pictures: How many pictures there were.
        words: Double words of I_MV that follow a quantity, with the evidence.
    """

    loop: Loop
    found: Identification
    pictures: int
    words: tuple[Followed, ...] = ()

    @property
    def exit(self) -> Exit:
        """PASS when a dialect is named, DIFFERENT when none fits, INCONCLUSIVE when the trace decides nothing."""
        if self.found.unexplained is not None:
            return Exit.DIFFERENT
        return Exit.PASS if self.found.is_named else Exit.INCONCLUSIVE

    def decided(self) -> dict[str, str]:
        """Axes of this instruction that are decided, as a profile spells them."""
        found = {
            name: self._spelled(name, value)
            for name, value in self.found.decided().items()
            if name in {axis.name for axis in axes_of(self.loop.controller.name)}
        }
        if any(each.quantity == "PV" for each in self.words):
            found["pv_word"] = self._spelled("pv_word", self.loop.dialect.pv_word)
        return found

    def left(self) -> dict[str, tuple[str, ...]]:
        """Values of this instruction's axes that nothing has excluded, as a profile spells them."""
        names = {axis.name for axis in axes_of(self.loop.controller.name)}
        return {
            name: tuple(self._spelled(name, value) for value in values)
            for name, values in self.found.values.items()
            if name in names and name != "pv_word"
        }

    def closest(self) -> dict[str, str]:
        """Axes of the dialect that came closest where none fits, those that differ from the default."""
        assert self.found.unexplained is not None
        dialect = self.found.unexplained.dialect
        values = {name: int(getattr(dialect, name)) for name in self.loop.controller.axes}
        return {name: self._spelled(name, value) for name, value in values.items() if value}

    def _spelled(self, axis: str, value: int) -> str:
        """How a profile spells a value."""
        return self.loop.controller.axes[axis](value).name.lower()

    def open(self) -> list[Open]:
        """Axes left open: those first of which the trace excluded some value, and what waits for others behind them."""
        decided = self.found.decided().keys() | self.decided().keys()
        axes = [axis for axis in self.found.open_axes(self.loop.controller.name) if axis.name not in decided]
        names = {axis.name for axis in axes}
        found = [
            Open(
                axis.name,
                axis.group,
                tuple(self._spelled(axis.name, value) for value in self.found.values[axis.name]),
                len(self.found.values[axis.name]) < len(values_of(self.loop, {}, axis.name)),
                spoken(axis.excitation, self.loop.controller.name),
                tuple(name for name in axis.after if name in names),
                self._unseen(axis),
            )
            for axis in axes
        ]
        return sorted(found, key=lambda each: (bool(each.unseen), not each.is_narrowed, len(each.after)))

    def _unseen(self, axis: Axis) -> str:
        """Say with which value of another axis all that is left of this one leaves the same bits."""
        name = self.loop.controller.name
        left, values = set(self.found.values[axis.name]), self.found.values
        for rule in axis.alike:
            given = {other: held for other, held in rule.given.items() if BY_NAME[other].concerns(name)}
            is_met = all(set(values[other]) <= set(held) for other, held in given.items())
            if is_met and rule.instruction in ("", name) and (not rule.own or left <= set(rule.own)):
                return ", ".join(
                    f"{other} = {' or '.join(self._spelled(other, each) for each in values[other])}" for other in given
                )
        return ""


def collected(reports: Iterable[Report]) -> dict[str, list[Picture]]:
    """Gather the pictures of each loop, in order."""
    found: defaultdict[str, list[Picture]] = defaultdict(list)
    for report in reports:
        if isinstance(report.event, Sample):
            found[report.loop].append(report.event.picture)
    return dict(found)


def learn(station: Station, pictures: Mapping[str, list[Picture]], names: Iterable[str] = ()) -> list[Learned]:
    """Learn every loop's dialect, or that of the named loops."""
    wanted = set(names)
    return [_learned(loop, pictures.get(loop.name, [])) for loop in station.loops if not wanted or loop.name in wanted]


def _learned(loop: Loop, pictures: list[Picture]) -> Learned:
    """Find the word of PV first: what an execution read is taken from there. The other blocks have no such word."""
    if loop.controller.begin is not None:
        return Learned(loop, identify_calls(loop, pictures), len(pictures))
    # What the profile says of that word may be another firmware's.
    loop = replace(loop, dialect=loop.dialect._replace(pv_word=PvWord.MANUAL))
    placed, shown = pv_placed(loop, pictures)
    found = _narrowed(placed, identify(placed, observed(shown, placed), known=crossings.told(placed, shown)), shown)
    return Learned(placed, found, len(pictures), followed(placed, shown))


def _narrowed(loop: Loop, found: Identification, pictures: list[Picture]) -> Identification:
    """What is left when the times of the pictures have spoken too, and the executions behind a standstill."""
    if not found.is_named:
        return found
    gone = moments.fallen(loop, pictures) | written_back.fallen(loop, pictures)
    gone |= restarts.fallen(loop, pictures, found.survivors, found.values["first_history"])
    values = {
        name: tuple(each for each in left if each not in gone.get(name, ())) for name, left in found.values.items()
    }
    return replace(found, values={name: left or found.values[name] for name, left in values.items()})
