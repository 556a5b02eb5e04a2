"""Vehicle time from the stamps of the sensors' samples. Pure: no clock, no I/O.

A stamp that does not follow the previous one is refused, and no tick is run. When several refused
stamps in a row follow each other, the sensors' clock has a new time base: vehicle time continues,
and ``offset_us`` holds the difference. Vehicle time therefore never decreases.
"""

from enum import Enum, auto
from typing import NamedTuple

from autopilot.comms.hil import HilSample
from mavlink_io import dialect
from mavlink_io.codec import Frame

CONFIRM_SAMPLES = 5
"""Number of consecutive refused stamps that follow each other and confirm a new time base."""
CONFIRM_GAP_US = 500_000
"""Longest step between two refused stamps that follow each other; random wrong stamps are rarely so
close."""
LOST_SAMPLES = 5
"""Longest forward step, in usual intervals, that is accepted as lost samples.

After a wrong stamp within this limit, correct stamps catch up before CONFIRM_SAMPLES of them have
been refused."""
MAX_INTERVAL_US = CONFIRM_GAP_US // LOST_SAMPLES
"""Upper limit and initial value of the usual interval: samples at 10 Hz."""
INTERVAL_DECAY = 0.9
"""Decay factor per sample of the usual interval, which is the largest recent interval."""


class StampClass(Enum):
    """Classification of a stamp by the stamps before it."""

    NEW = auto()
    """A new sample: run a tick."""
    REPEATED = auto()
    """The newest sample again: repeat the answer."""
    REFUSED = auto()
    """A wrong stamp, an old sample or the first samples of a new time base: no answer."""
    RESTARTED = auto()
    """The sample that confirms a new time base: run a tick."""


class SensorClock(NamedTuple):
    """State of the stamp check. All times are stamps of the sensors' clock, except the offset."""

    newest_us: int = -1
    """Stamp of the newest accepted sample; -1 before the first."""
    offset_us: int = 0
    """Vehicle time minus stamp."""
    interval_us: int = MAX_INTERVAL_US
    """Usual interval between samples."""
    refused: int = 0
    """Number of consecutive refused samples that follow each other."""
    refused_first_us: int = 0
    """Stamp of the first refused sample."""
    refused_us: int = 0
    """Stamp of the newest refused sample."""

    @property
    def is_regular(self) -> bool:
        """Whether a sample one usual interval later is accepted and changes ``newest_us`` alone."""
        return self.newest_us >= 0 and self.offset_us == 0 and self.refused == 0


def classify_stamp(
    clock: SensorClock, stamp_us: int, silent_us: int
) -> tuple[SensorClock, StampClass]:
    """Classify the stamp of a sample.

    Parameters
    ----------
    clock : SensorClock
        State after the previous samples.
    stamp_us : int
        Stamp of the sample, microseconds of the sensors' clock.
    silent_us : int
        Wall time since a sample was last accepted. A gap in the stamps up to this long is an
        outage, not a jump of the clock.

    Returns
    -------
    tuple of SensorClock and StampClass
        State after this sample. After NEW and RESTARTED the vehicle time of the sample is
        ``stamp_us + offset_us`` and greater than that of every sample before.
    """
    if clock.newest_us < 0:
        return clock._replace(newest_us=stamp_us), StampClass.NEW
    step_us = stamp_us - clock.newest_us
    if 0 < step_us <= LOST_SAMPLES * clock.interval_us + silent_us:
        usual_us = max(round(INTERVAL_DECAY * clock.interval_us), min(step_us, MAX_INTERVAL_US))
        accepted = SensorClock(
            stamp_us, clock.offset_us, usual_us, 0, clock.refused_first_us, clock.refused_us
        )
        return accepted, StampClass.NEW
    if step_us == 0:
        return clock._replace(refused=0), StampClass.REPEATED
    first_us, refused = stamp_us, 1
    if clock.refused and 0 <= stamp_us - clock.refused_us <= CONFIRM_GAP_US:
        first_us, refused = clock.refused_first_us, clock.refused + 1
    if refused < CONFIRM_SAMPLES:
        updated = clock._replace(refused=refused, refused_first_us=first_us, refused_us=stamp_us)
        return updated, StampClass.REFUSED
    # The first sample on the new time base follows the last one on the old by one usual interval.
    offset_us = clock.newest_us + clock.offset_us + clock.interval_us - first_us
    return clock._replace(newest_us=stamp_us, offset_us=offset_us, refused=0), StampClass.RESTARTED


def begin(stamp_us: int) -> SensorClock:
    """Return the state after one sample with stamp ``stamp_us``, without an offset."""
    return SensorClock(newest_us=stamp_us)


def rebase(sample: HilSample, offset_us: int) -> HilSample:
    """Return the sample with all stamps, also of devices and log frames, as vehicle time.

    A device stamp may still have the old time base: it is limited to the time of the sample.
    """
    now_us = sample.sensors.time_us + offset_us
    devices = {
        name: record._replace(time_us=_shift(record.time_us, offset_us, now_us))
        for name in ("gps", "altimeter", "dvl", "duct")
        if (record := getattr(sample, name)) is not None
    }
    return sample._replace(
        sensors=sample.sensors._replace(time_us=now_us),
        relayed=tuple(_rebase_frame(frame, offset_us, now_us) for frame in sample.relayed),
        frames=tuple(_rebase_frame(frame, offset_us, now_us) for frame in sample.frames),
        **devices,
    )


_STAMPS_US = {("time_usec", "uint64_t"): 1, ("time_boot_ms", "uint32_t"): 1000}
"""Unit in us of each field, by name and type, that holds a stamp."""


def _rebase_frame(frame: Frame, offset_us: int, now_us: int) -> Frame:
    """Return the frame with its stamp as vehicle time; unchanged without a stamp field."""
    message = dialect.by_id(frame.message_id)
    if message is None:
        return frame
    for index, field in enumerate(message.fields):
        unit_us = _STAMPS_US.get((field.name, field.type))
        if unit_us:
            values = list(frame.decode())
            stamp_us = _shift(values[index] * unit_us, offset_us, now_us) // unit_us
            values[index] = stamp_us & 0xFFFF_FFFF if unit_us == 1000 else stamp_us
            return frame._replace(payload=message.pack(tuple(values)))
    return frame


def _shift(stamp_us: int, offset_us: int, now_us: int) -> int:
    """Return a stamp as vehicle time, limited to 0..now_us."""
    return min(now_us, max(0, stamp_us + offset_us))
