"""Which faults are in force: those that wait for their time, those that run, and what a tick
changed."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from sitl.faults import body
from sitl.faults.catalogue import Fault
from sitl.vehicle.model import VehicleModel

NEVER_US = 1 << 62
Values = tuple[float, ...]


class FaultState(NamedTuple):
    """What a running fault remembers from tick to tick."""

    values: Values | None = None
    """What was last let through, or what is held."""
    passed_us: int = -NEVER_US
    """When something was last let through."""
    silent: bool = False
    queue: tuple[tuple[int, object], ...] = ()
    """(when due, record) of what is on its way."""


class Running(NamedTuple):
    fault: Fault
    memory: FaultState = FaultState()


class FaultChange(NamedTuple):
    """A fault began or ended."""

    fault: Fault
    began: bool

    @property
    def text(self) -> str:
        """What people read, within a STATUSTEXT."""
        return f"Fault: {self.fault.name}" if self.began else f"Fault over: {self.fault.name}"


class Timeline(NamedTuple):
    """All faults of a run as they stand at one instant."""

    waiting: tuple[Fault, ...] = ()
    running: tuple[Running, ...] = ()
    changes: tuple[FaultChange, ...] = ()
    """Of the last tick, in order."""
    next_us: int = NEVER_US
    """When something begins or ends next."""
    model: VehicleModel | None = None
    """The vehicle's, where a fault has changed it."""

    @property
    def names(self) -> tuple[str, ...]:
        """What runs, for the truth."""
        return tuple(running.fault.name for running in self.running)


def schedule(faults: Iterable[Fault]) -> Timeline:
    """The timeline of a run that has not begun."""
    return _with_next_time(Timeline(waiting=tuple(faults)))


def add_fault(timeline: Timeline, fault: Fault) -> Timeline:
    """Take in a fault under way; one that is ordered again while it lasts is meant once."""
    asked = [
        *timeline.waiting,
        *(each.fault for each in timeline.running if _until_us(each.fault) > fault.from_us),
    ]
    if any(
        (fault.name, fault.sizes) == (other.name, other.sizes)
        for other in asked
        if other.from_us <= fault.from_us
    ):
        return timeline
    return _with_next_time(timeline._replace(waiting=(*timeline.waiting, fault)))


def end_faults(timeline: Timeline, units: Iterable[str], time_us: int) -> Timeline:
    """Let what runs on ``units`` end at the next tick, and what was ordered and not yet begun never
    begin."""
    cleared = frozenset(units)
    running = tuple(
        each._replace(fault=each.fault._replace(until_us=time_us))
        if each.fault.unit in cleared
        else each
        for each in timeline.running
    )
    waiting = tuple(
        fault for fault in timeline.waiting if fault.unit not in cleared or fault.from_us > time_us
    )
    return _with_next_time(timeline._replace(running=running, waiting=waiting))


def advance(timeline: Timeline, model: VehicleModel, time_us: int) -> Timeline:
    """Begin and end what is due at ``time_us``; ``model`` is that of the sound vehicle."""
    if time_us < timeline.next_us:
        return timeline._replace(changes=()) if timeline.changes else timeline
    over = [each for each in timeline.running if _until_us(each.fault) <= time_us]
    begun = sorted(
        (fault for fault in timeline.waiting if fault.from_us <= time_us),
        key=lambda fault: fault.from_us,
    )
    running = (*(each for each in timeline.running if each not in over), *map(Running, begun))
    return _with_next_time(
        Timeline(
            waiting=tuple(fault for fault in timeline.waiting if fault.from_us > time_us),
            running=running,
            changes=(
                *(FaultChange(each.fault, False) for each in over),
                *(FaultChange(fault, True) for fault in begun),
            ),
            model=body.apply(model, [each.fault for each in running]),
        )
    )


def _with_next_time(timeline: Timeline) -> Timeline:
    begins = (fault.from_us for fault in timeline.waiting)
    ends = (_until_us(each.fault) for each in timeline.running)
    return timeline._replace(next_us=min((*begins, *ends), default=NEVER_US))


def _until_us(fault: Fault) -> int:
    return NEVER_US if fault.until_us is None else fault.until_us
