"""Timers with a simulated wall clock."""

import time

import pytest

from mavlink_io import clock
from mavlink_io.clock import Interval, Pacer


class Wall:
    """A wall clock that advances when it is slept on."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.now_s += seconds


@pytest.fixture
def wall(monkeypatch: pytest.MonkeyPatch) -> Wall:
    wall = Wall()
    monkeypatch.setattr(clock, "wall_s", wall)
    monkeypatch.setattr(time, "sleep", wall.sleep)
    return wall


def test_timer_is_due_at_once_then_once_per_period() -> None:
    wall = Wall()
    timer = Interval(1.0, wall)
    assert (timer.due(), timer.due()) == (True, False)
    wall.now_s += 0.9
    assert not timer.due()
    wall.now_s += 0.1
    assert timer.due()


def test_timer_does_not_catch_up() -> None:
    wall = Wall()
    timer = Interval(1.0, wall)
    timer.due()
    wall.now_s += 10.0
    assert (timer.due(), timer.due()) == (True, False)


def test_timer_hastened_is_due() -> None:
    timer = Interval(1.0, Wall())
    timer.due()
    timer.hasten()
    assert timer.due()


@pytest.mark.parametrize("speed", [0.2, 1.0, 50.0])
def test_pacer_holds_vehicle_time_to_speed(wall: Wall, speed: float) -> None:
    pacer = Pacer(speed)
    for tick in range(51):
        pacer.wait(tick * 0.02)
    assert wall.now_s - 100.0 == pytest.approx(1.0 / speed)


def test_pacer_without_speed_does_not_wait(wall: Wall) -> None:
    pacer = Pacer(None)
    for tick in range(100):
        pacer.wait(tick * 0.02)
    assert wall.now_s == 100.0


def test_pacer_far_behind_does_not_catch_up(wall: Wall) -> None:
    pacer = Pacer(1.0)
    pacer.wait(0.0)
    wall.now_s += 10.0
    pacer.wait(0.02)
    pacer.wait(1.02)
    assert wall.now_s == pytest.approx(111.0)
