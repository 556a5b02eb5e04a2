"""Schedule of the faults of a run: pending and running faults, and the changes of each tick."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from sitl.faults import body
from sitl.faults.catalogue import ScheduledFault
from sitl.vehicle.model import VehicleModel

NEVER_US = 1 << 62
Values = tuple[float, ...]


class FaultState(NamedTuple):
    """State of a running fault from tick to tick."""

    values: Values | None = None
    """Values that a stuck sensor or shaft holds."""
    passed_us: int = -NEVER_US
    """Vehicle time of the last record that a slow sensor output."""
    silent: bool = False
    """Whether an intermittent sensor is silent now."""
    queue: tuple[tuple[int, object], ...] = ()
    """Delayed records: vehicle time at which each is due, and the record."""


class Running(NamedTuple):
    """A fault in force and its state."""

    fault: ScheduledFault
    memory: FaultState = FaultState()


class FaultChange(NamedTuple):
    """Start or end of a fault."""

    fault: ScheduledFault
    began: bool

    @property
    def text(self) -> str:
        """Text of the STATUSTEXT for operators."""
        return f"Fault: {self.fault.name}" if self.began else f"Fault over: {self.fault.name}"


class Timeline(NamedTuple):
    """All faults of a run at one instant."""

    waiting: tuple[ScheduledFault, ...] = ()
    """Faults that have not started."""
    running: tuple[Running, ...] = ()
    """Faults in force."""
    changes: tuple[FaultChange, ...] = ()
    """Starts and ends in the last tick, in order."""
    next_us: int = NEVER_US
    """Vehicle time of the next start or end."""
    model: VehicleModel | None = None
    """Vehicle model changed by faults; None if unchanged."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the faults in force, for the truth log."""
        return tuple(running.fault.name for running in self.running)


def schedule(faults: Iterable[ScheduledFault]) -> Timeline:
    """Return the timeline of a run that has not started."""
    return _with_next_time(Timeline(waiting=tuple(faults)))


def add_fault(timeline: Timeline, fault: ScheduledFault) -> Timeline:
    """Add a fault during a run, unless an equal fault is pending or in force at its start."""
    present = [
        *timeline.waiting,
        *(item.fault for item in timeline.running if _until_us(item.fault) > fault.from_us),
    ]
    if any(
        (fault.name, fault.sizes) == (other.name, other.sizes)
        for other in present
        if other.from_us <= fault.from_us
    ):
        return timeline
    return _with_next_time(timeline._replace(waiting=(*timeline.waiting, fault)))


def end_faults(timeline: Timeline, units: Iterable[str], time_us: int) -> Timeline:
    """End the faults of ``units`` at the next tick and remove those commanded but not started."""
    cleared = frozenset(units)
    running = tuple(
        item._replace(fault=item.fault._replace(until_us=time_us))
        if item.fault.unit in cleared
        else item
        for item in timeline.running
    )
    waiting = tuple(
        fault for fault in timeline.waiting if fault.unit not in cleared or fault.from_us > time_us
    )
    return _with_next_time(timeline._replace(running=running, waiting=waiting))


def advance(timeline: Timeline, model: VehicleModel, time_us: int) -> Timeline:
    """Start and end the faults that are due at ``time_us``; ``model`` is the unfaulted vehicle."""
    if time_us < timeline.next_us:
        return timeline._replace(changes=()) if timeline.changes else timeline
    ended = [item for item in timeline.running if _until_us(item.fault) <= time_us]
    started = sorted(
        (fault for fault in timeline.waiting if fault.from_us <= time_us),
        key=lambda fault: fault.from_us,
    )
    running = (*(item for item in timeline.running if item not in ended), *map(Running, started))
    return _with_next_time(
        Timeline(
            waiting=tuple(fault for fault in timeline.waiting if fault.from_us > time_us),
            running=running,
            changes=(
                *(FaultChange(item.fault, False) for item in ended),
                *(FaultChange(fault, True) for fault in started),
            ),
            model=body.apply(model, [item.fault for item in running]),
        )
    )


def _with_next_time(timeline: Timeline) -> Timeline:
    """Set ``next_us`` from the faults of the timeline."""
    starts = (fault.from_us for fault in timeline.waiting)
    ends = (_until_us(item.fault) for item in timeline.running)
    return timeline._replace(next_us=min((*starts, *ends), default=NEVER_US))


def _until_us(fault: ScheduledFault) -> int:
    """Return the end of a fault, or a time that is never reached."""
    return NEVER_US if fault.until_us is None else fault.until_us
