"""Progress and end of a dive, and a vehicle time that stands still."""

import errno
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from ground.client import dive_clock, flight
from ground.client import vehicle as client
from ground.client.dive_clock import STALL_TIMEOUT_S, DiveClock
from ground.client.flight import FlightProgress
from ground.client.recorder import Recorder
from ground.client.vehicle import VehicleClientError
from mavlink_io.clock import Interval
from mavlink_io.codec import Frame
from mavlink_io.errors import OperationError
from mavlink_io.mission_items import MavCmd, MissionItem
from tests.ground.fake import DENIED, FakeVehicle, step_while_waiting
from tests.ground.live.page.telemetry import frame
from tests.sysid.monte_carlo.files import SHORT_MISSION

HOUR_MS = 3_600_000
"""Vehicle time at the start of a dive, of a vehicle that was switched on an hour before."""
PUMP_S = 0.5
"""Wall time that each call of `pump` takes."""


class Vehicle:
    """Stands in for the client: sends attitudes until its sensors stop, and never disarms."""

    disarmings, mode, is_simulated = 0, "MISSION", False

    def __init__(self, recorder: Recorder, monkeypatch: pytest.MonkeyPatch) -> None:
        self.recorder, self.now_s = recorder, 100.0
        self.stopped_s, self.resumed_s = 1e9, 1e9
        monkeypatch.setattr(dive_clock, "wall_s", lambda: self.now_s)
        monkeypatch.setattr(Interval, "due", lambda _: True)
        self.send(0)

    def send(self, time_ms: int, system: int = 1) -> None:
        sent: Frame = frame("ATTITUDE", time_boot_ms=HOUR_MS + time_ms)
        self.recorder.record(sent._replace(system=system))

    def pump(self, timeout_s: float) -> None:
        self.now_s += PUMP_S
        flown_s = self.now_s - 100.0
        self.send(int(10_000 * flown_s), system=2)
        if not self.stopped_s <= flown_s < self.resumed_s:
            self.send(int(2000 * flown_s))

    def latest(self, name: str) -> Any:
        return None


@pytest.fixture
def vehicle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Vehicle]:
    recorder = Recorder(tmp_path / "dive.mcap")
    yield Vehicle(recorder, monkeypatch)
    recorder.finish()


DIVE = flight.Dive("m", (MissionItem(0, 2, MavCmd.NAV_LAND),), Path("dive.mcap"))


class EndedError(Exception):
    """Ends the dive of a test."""


def progress_of(
    vehicle: Vehicle, duration_s: float, dive: flight.Dive = DIVE
) -> list[FlightProgress]:
    """Return the progress reports of a dive of this wall time."""
    reports = list[FlightProgress]()

    def watch(progress: FlightProgress) -> None:
        reports.append(progress)
        if progress.wall_s >= duration_s:
            raise EndedError

    clock = DiveClock(vehicle.recorder, 1)
    with pytest.raises(EndedError):
        flight._until_disarmed(vehicle, clock, dive, watch, None)  # type: ignore[arg-type]
    return reports


def test_simulated_vehicle_that_cannot_surface_is_given_up(vehicle: Vehicle) -> None:
    vehicle.mode, vehicle.is_simulated = "SURFACE", True
    with pytest.raises(OperationError, match=r"without a change of depth for 1800 s"):
        progress_of(vehicle, 1000.0)


def test_real_vehicle_that_cannot_surface_is_recorded_further(vehicle: Vehicle) -> None:
    vehicle.mode = "SURFACE"
    assert progress_of(vehicle, 1000.0)[-1].vehicle_s > 1900.0


def test_progress_counts_vehicle_time_from_the_start_of_the_dive(vehicle: Vehicle) -> None:
    last = progress_of(vehicle, 10.0)[-1]
    assert (last.vehicle_s, last.wall_s, last.warning) == (20.0, 10.0, "")


def test_progress_names_the_step_of_the_mission_file(
    vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second of two steps was "item 4 of 5": a step of a leg is several items."""
    leg = Path("two.toml")
    current = SimpleNamespace(seq=2)
    monkeypatch.setattr(vehicle, "latest", lambda name: {"MISSION_CURRENT": current}.get(name))
    monkeypatch.chdir(vehicle.recorder.path.parent)
    leg.write_text(SHORT_MISSION)
    two = flight.Dive.load("two.toml", Path("dive.mcap"))
    assert len(two.items) > 2
    assert progress_of(vehicle, 1.0, two)[-1].place == "step 1 of 2"
    current.seq = len(two.items) - 1
    assert progress_of(vehicle, 1.0, two)[-1].place == "step 2 of 2"


def test_stalled_vehicle_time_gives_a_warning_and_then_an_error(vehicle: Vehicle) -> None:
    vehicle.stopped_s = 10.0
    reports = progress_of(vehicle, 10.0 + 0.5 * STALL_TIMEOUT_S)
    assert [bool(report.warning) for report in reports[-3:]] == [False, True, True]
    with pytest.raises(VehicleClientError, match=r"120 s: no sensor data .*kept in .*dive\.mcap"):
        progress_of(vehicle, 2.0 * STALL_TIMEOUT_S)


def test_warning_ends_when_vehicle_time_advances_again(vehicle: Vehicle) -> None:
    vehicle.stopped_s, vehicle.resumed_s = 10.0, 90.0
    reports = progress_of(vehicle, 200.0)
    warned_s = [report.wall_s for report in reports if report.warning]
    assert (warned_s[0], warned_s[-1]) == (69.5, 89.5)


def test_pause_of_the_program_is_no_stall(vehicle: Vehicle) -> None:
    clock = DiveClock(vehicle.recorder, 1)
    vehicle.now_s += 10.0 * STALL_TIMEOUT_S
    clock.update()
    assert not clock.warning


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeVehicle]:
    """A vehicle that `flight.fly` finds at every address and that stays armed."""
    fake = FakeVehicle()
    fake.modes = (("MISSION", 0, 7),)
    monkeypatch.setattr(client, "wait", step_while_waiting(fake))
    monkeypatch.setattr(flight, "open_transport", lambda _: fake.ground_end)
    fake.heartbeat()
    yield fake
    fake.close()


def error_of_a_dive(folder: Path) -> BaseException:
    """Return the error that ends a dive of one item."""
    dive = replace(DIVE, log=folder / "dive.mcap", tlog=folder / "dive.tlog")
    with pytest.raises((OSError, OperationError)) as raised:
        flight.fly(dive, "udpin:127.0.0.1:14550")
    return raised.value


STILL_UNDER_WAY = (
    "the vehicle is still under way in mode MISSION:"
    " `ground surface --connect udpin:127.0.0.1:14550` ends the dive"
)


def test_fly_full_disk_notes_the_state_of_the_vehicle(
    fake: FakeVehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: Recorder) -> None:
        if fake.armed:
            raise OSError(errno.ENOSPC, "No space left on device", "dive.mcap")

    monkeypatch.setattr(Recorder, "flush_when_due", fail)
    fake.after[MavCmd.COMPONENT_ARM_DISARM] = lambda: fake.heartbeat(armed=True)
    error = error_of_a_dive(tmp_path)
    assert isinstance(error, OSError)
    assert error.__notes__[0].startswith(STILL_UNDER_WAY)


def test_fly_lost_link_notes_the_state_of_the_vehicle(
    fake: FakeVehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "HEARTBEAT_TIMEOUT_S", 0.3)
    fake.after[MavCmd.COMPONENT_ARM_DISARM] = lambda: fake.heartbeat(armed=True)
    error = error_of_a_dive(tmp_path)
    assert "no heartbeat" in str(error)
    assert error.__notes__[0].startswith(STILL_UNDER_WAY)
    assert {path.name for path in tmp_path.iterdir()} == {"dive.mcap", "dive.tlog"}


def test_fly_refused_arming_leaves_no_log(fake: FakeVehicle, tmp_path: Path) -> None:
    """The next command finds the names of the logs free."""
    fake.answers[MavCmd.COMPONENT_ARM_DISARM] = [DENIED]
    fake.send_text("Not armed: no depth sensor")
    assert "denied" in str(error_of_a_dive(tmp_path))
    assert not list(tmp_path.iterdir())


def test_fly_vehicle_that_another_program_flies_leaves_no_log(
    fake: FakeVehicle, tmp_path: Path
) -> None:
    fake.heartbeat(armed=True)
    assert "already armed" in str(error_of_a_dive(tmp_path))
    assert not list(tmp_path.iterdir())
