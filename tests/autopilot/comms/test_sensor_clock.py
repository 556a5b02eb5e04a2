"""Vehicle time from stamps: it increases, ignores a bad stamp, and follows a new time base."""

from collections.abc import Sequence
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.comms import sensor_clock
from autopilot.comms.hil import HilSample
from autopilot.comms.sensor_clock import (
    CONFIRM_SAMPLES,
    LOST_SAMPLES,
    MAX_INTERVAL_US,
    SensorClock,
    StampClass,
    classify_stamp,
    rebase,
)
from mavlink_io import dialect
from mavlink_io.codec import Frame, Framer, encode
from mavlink_io.records import Altimeter, DuctFeedback, Dvl, GpsFix
from tests.helpers.fake_hil import TICK_US, sensors

TAKEN = (StampClass.NEW, StampClass.RESTARTED)
STAMPS = st.integers(0, 2**64 - 1)
"""Range of HIL_SENSOR.time_usec."""
SETTLED = 40
"""Number of samples after which the usual interval is known.

MAX_INTERVAL_US decays to the interval of a tick in 16 samples."""
AHEAD_US = LOST_SAMPLES * TICK_US
"""Largest forward step that looks like lost samples."""


Verdicts = list[tuple[StampClass, int]]


def run(stamps: Sequence[int], clock: SensorClock | None = None) -> tuple[SensorClock, Verdicts]:
    """Return the class of each stamp with its vehicle time."""
    clock, results = clock or SensorClock(), []
    for stamp_us in stamps:
        clock, stamp_class = classify_stamp(clock, stamp_us, 0)
        results.append((stamp_class, stamp_us + clock.offset_us))
    return clock, results


def regular(count: int, first_us: int = 0) -> list[int]:
    return [first_us + n * TICK_US for n in range(count)]


@given(index=st.integers(SETTLED, SETTLED + 20), bad_us=STAMPS)
def test_one_bad_stamp_has_no_effect(index: int, bad_us: int) -> None:
    stamps = regular(SETTLED + 40)
    newest_us = stamps[index - 1]
    if 0 < bad_us - newest_us <= AHEAD_US:
        return
    _, results = run([*stamps[:index], bad_us, *stamps[index:]])
    assert results.pop(index)[0] in (StampClass.REFUSED, StampClass.REPEATED)
    assert results == [(StampClass.NEW, stamp_us) for stamp_us in stamps]


@pytest.mark.parametrize("bad_us", [1_000_000, -1_000_000, 200_000, -20_000])
def test_bad_stamp_near_has_no_effect(bad_us: int) -> None:
    """One second ahead, as reported; the search of stamps above rarely comes so close."""
    stamps = regular(100)
    bad = [*stamps[:80], stamps[79] + bad_us, *stamps[80:]]
    _, results = run(bad)
    assert results.pop(80)[0] is StampClass.REFUSED
    assert results == [(StampClass.NEW, stamp_us) for stamp_us in stamps]


@given(ahead_us=st.integers(1, AHEAD_US))
def test_stamp_little_ahead_costs_few_samples(ahead_us: int) -> None:
    """Too few for a new time base; the last of them may have the stamp of the wrong one."""
    stamps = regular(SETTLED + 40)
    _, results = run([*stamps[:SETTLED], stamps[SETTLED - 1] + ahead_us, *stamps[SETTLED:]])
    rest = results[SETTLED + 1 :]
    assert sum(stamp_class is not StampClass.NEW for stamp_class, _ in rest) <= CONFIRM_SAMPLES
    assert StampClass.RESTARTED not in [stamp_class for stamp_class, _ in results]
    assert rest[-1] == (StampClass.NEW, stamps[-1])


@given(base_us=st.integers(0, 2**62))
def test_new_time_base_is_followed_without_gap(base_us: int) -> None:
    before = regular(SETTLED)
    newest_us = before[-1]
    if abs(base_us - newest_us) <= 10 * AHEAD_US:
        return
    clock, results = run([*before, *regular(20, base_us)])
    after = results[SETTLED:]
    wanted = [StampClass.REFUSED] * 4 + [StampClass.RESTARTED] + [StampClass.NEW] * 15
    assert [stamp_class for stamp_class, _ in after] == wanted
    times_us = [time_us for stamp_class, time_us in after if stamp_class in TAKEN]
    assert times_us == regular(16, newest_us + clock.interval_us + 4 * TICK_US)
    assert clock.interval_us <= 2 * TICK_US


@given(st.lists(STAMPS | st.integers(0, 10**6), max_size=60), st.integers(0, 2**62))
def test_vehicle_time_increases_and_continues(stamps: list[int], base_us: int) -> None:
    clock, results = run(stamps)
    times_us = [time_us for stamp_class, time_us in results if stamp_class in TAKEN]
    assert all(after > before for before, after in pairwise(times_us))
    _, results = run(regular(CONFIRM_SAMPLES + 1, base_us), clock)
    assert any(stamp_class in TAKEN for stamp_class, _ in results)


@given(first_us=STAMPS)
def test_bad_first_stamp_is_recovered_from(first_us: int) -> None:
    _, results = run([first_us, *regular(20)])
    after = {stamp_class for stamp_class, _ in results[CONFIRM_SAMPLES + 2 :]}
    assert after <= {StampClass.NEW, StampClass.REPEATED}


def test_repeated_stamp_is_answered() -> None:
    """A simulator in lockstep repeats its sample: the fifth is accepted at the latest."""
    for stamp_us in (0, 2**63):
        _, results = run([*regular(SETTLED), *[stamp_us] * CONFIRM_SAMPLES])
        assert results[-1][0] is StampClass.RESTARTED


def test_gap_in_stamps_and_wall_clock_is_an_outage() -> None:
    clock, _ = run(regular(SETTLED))
    stamp_us = clock.newest_us + 3_000_000
    assert classify_stamp(clock, stamp_us, 0)[1] is StampClass.REFUSED
    updated, stamp_class = classify_stamp(clock, stamp_us, 3_000_000)
    assert (stamp_class, updated.offset_us) == (StampClass.NEW, 0)


@pytest.mark.parametrize("tick_us", [2_000, 10_000, 40_000, 100_000])
def test_usual_rates_are_accepted(tick_us: int) -> None:
    _, results = run([n * tick_us for n in range(50)])
    assert {stamp_class for stamp_class, _ in results} == {StampClass.NEW}


def test_uneven_steps_are_accepted() -> None:
    """A computer that sends three samples at once: docs/hardware.md requires no even interval."""
    stamps = [60_000 * burst + 1_000 * n for burst in range(50) for n in range(3)]
    _, results = run(stamps)
    assert {stamp_class for stamp_class, _ in results} == {StampClass.NEW}


def test_longest_interval_is_that_of_the_slowest_line() -> None:
    """Source: docs/hardware.md, 10 Hz at 38400 baud."""
    assert MAX_INTERVAL_US == 100_000


def device_frame(name: str, **fields: object) -> Frame:
    message = dialect.by_name(name)
    (frame,) = Framer().feed(encode(message, message.values(**fields), 0, 1, 25))
    return frame


def test_rebase_shifts_every_stamp_of_a_sample() -> None:
    """A GPS report from before the restart has a later stamp: it becomes that of the sample."""
    air = {"press_abs": 1013.0, "press_diff": 0.0, "temperature": 1200}
    hull = device_frame("SCALED_PRESSURE", time_boot_ms=90, **air)
    text = device_frame("STATUSTEXT", severity=4, text="Fault: gyro off")
    sample = HilSample(
        sensors(100_000),
        GpsFix(99_000_000, 3, 42.35, -71.0, 0.0, 0.0, 0.0, 0.0, 10),
        Altimeter(80_000, 12.0, 0.3, 30.0),
        Dvl(0, 1.0, 0.0, 0.0, True, 0.1, 100),
        duct=DuctFeedback(90_000, 0.0, 0.0),
        relayed=(hull, text),
        frames=(hull, device_frame("HIL_SENSOR", **_imu(100_000))),
    )
    rebased = rebase(sample, 5_000_000)
    assert rebased.sensors == sample.sensors._replace(time_us=5_100_000)
    assert rebased.gps is not None
    assert rebased.gps.time_us == 5_100_000
    assert rebased.altimeter == Altimeter(5_080_000, 12.0, 0.3, 30.0)
    assert rebased.dvl is not None
    assert rebased.dvl.time_us == 5_000_000
    assert rebased.duct == DuctFeedback(5_090_000, 0.0, 0.0)
    assert rebased.relayed[0].decode() == hull.decode()._replace(time_boot_ms=5_090)
    assert rebased.relayed[1] == text
    assert rebased.frames[1].decode().time_usec == 5_100_000


def _imu(time_us: int) -> dict[str, object]:
    message = dialect.by_name("HIL_SENSOR")
    return dict(zip((field.name for field in message.fields), sensors(time_us), strict=True))


def test_rebase_never_makes_a_stamp_negative() -> None:
    """Stamps of MAVLink are unsigned."""
    sample = HilSample(sensors(10**9), GpsFix(5, 3, 42.35, -71.0, 0.0, 0.0, 0.0, 0.0, 10))
    rebased = sensor_clock.rebase(sample, -900_000_000)
    assert rebased.gps is not None
    assert rebased.gps.time_us == 0
