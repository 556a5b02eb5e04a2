"""Vehicle time from the stamps of the sensors' samples. Pure: no clock, no I/O.

A stamp that does not follow the one before it is refused, and the tick is not run. When several
refused stamps in a row follow each other, the sensors' clock has a new time base: vehicle time goes
on from where it was, and ``offset_us`` takes up the difference. So vehicle time never falls back.
"""

from enum import Enum, auto
from typing import NamedTuple

from autopilot.comms.hil import HilSample
from mavlink_io import dialect
from mavlink_io.codec import Frame

CONFIRM_SAMPLES = 5
"""Refused stamps in a row that follow each other before they are taken for a new time base."""
CONFIRM_GAP_US = 500_000
"""Longest step between two of these. Stamps that are wrong at random hardly ever lie so close."""
LOST_SAMPLES = 5
"""A step ahead of up to this many usual intervals is taken for lost samples. After a wrong stamp
within it, honest stamps catch up before CONFIRM_SAMPLES of them have been refused."""
MAX_INTERVAL_US = CONFIRM_GAP_US // LOST_SAMPLES
"""Usual interval before the first is known, and its upper limit: samples at 10 Hz."""
INTERVAL_DECAY = 0.9
"""The usual interval is the largest recent one; it decays by this factor a sample."""


class StampVerdict(Enum):
    """What a stamp is, after those before it."""

    NEW = auto()
    """A sample of a new instant: tick."""
    REPEATED = auto()
    """The newest sample once more: answer as before."""
    REFUSED = auto()
    """A bad stamp, an old sample, or the first of a new time base: no answer."""
    RESTARTED = auto()
    """A sample on a new time base: tick."""


class SensorClock(NamedTuple):
    """What is known of the sensors' clock. All times are stamps but for the offset."""

    newest_us: int = -1
    """The newest sample that was taken; -1 before the first."""
    offset_us: int = 0
    """Vehicle time minus stamp."""
    interval_us: int = MAX_INTERVAL_US
    """Usual interval between samples."""
    refused: int = 0
    """Refused samples in a row that follow each other."""
    refused_first_us: int = 0
    refused_us: int = 0
    """The first and the newest of these."""


def classify_stamp(
    clock: SensorClock, stamp_us: int, silent_us: int
) -> tuple[SensorClock, StampVerdict]:
    """Judge the stamp of a sample.

    Parameters
    ----------
    clock : SensorClock
        State after the samples before.
    stamp_us : int
        Stamp of the sample, microseconds of the sensors' clock.
    silent_us : int
        Wall time since a sample was last taken. A gap in the stamps up to this long is an outage,
        not a jump of the clock.

    Returns
    -------
    tuple of SensorClock and Verdict
        State after this sample. After NEW and RESTARTED the vehicle time of the sample is
        ``stamp_us + offset_us`` and greater than that of every sample before.
    """
    if clock.newest_us < 0:
        return clock._replace(newest_us=stamp_us), StampVerdict.NEW
    step_us = stamp_us - clock.newest_us
    if 0 < step_us <= LOST_SAMPLES * clock.interval_us + silent_us:
        usual_us = max(round(INTERVAL_DECAY * clock.interval_us), min(step_us, MAX_INTERVAL_US))
        return clock._replace(newest_us=stamp_us, interval_us=usual_us, refused=0), StampVerdict.NEW
    if step_us == 0:
        return clock._replace(refused=0), StampVerdict.REPEATED
    first_us, refused = stamp_us, 1
    if clock.refused and 0 <= stamp_us - clock.refused_us <= CONFIRM_GAP_US:
        first_us, refused = clock.refused_first_us, clock.refused + 1
    if refused < CONFIRM_SAMPLES:
        refusing = clock._replace(refused=refused, refused_first_us=first_us, refused_us=stamp_us)
        return refusing, StampVerdict.REFUSED
    # The first sample on the new time base is put a usual interval after the last one on the old.
    offset_us = clock.newest_us + clock.offset_us + clock.interval_us - first_us
    return clock._replace(
        newest_us=stamp_us, offset_us=offset_us, refused=0
    ), StampVerdict.RESTARTED


def begin(stamp_us: int) -> SensorClock:
    """Return a clock that has taken one sample, of ``stamp_us``: vehicle time is its stamp."""
    return SensorClock(newest_us=stamp_us)


def rebase(sample: HilSample, offset_us: int) -> HilSample:
    """Return the sample with every stamp as vehicle time, devices and log frames included.

    A device's stamp may still be of the old time base: it is limited to the sample's own time.
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
        heard=tuple(_rebase_frame(frame, offset_us, now_us) for frame in sample.heard),
        **devices,
    )


_STAMPS_US = {("time_usec", "uint64_t"): 1, ("time_boot_ms", "uint32_t"): 1000}
"""Fields that hold a stamp, and their unit."""


def _rebase_frame(frame: Frame, offset_us: int, now_us: int) -> Frame:
    """The frame with its stamp as vehicle time; one without a stamp as it is."""
    message = dialect.by_id(frame.message_id)
    if message is None:
        return frame
    for at, field in enumerate(message.fields):
        unit_us = _STAMPS_US.get((field.name, field.type))
        if unit_us:
            values = list(frame.decode())
            stamp_us = _shift(values[at] * unit_us, offset_us, now_us) // unit_us
            values[at] = stamp_us & 0xFFFF_FFFF if unit_us == 1000 else stamp_us
            return frame._replace(payload=message.pack(tuple(values)))
    return frame


def _shift(stamp_us: int, offset_us: int, now_us: int) -> int:
    return min(now_us, max(0, stamp_us + offset_us))
