"""`ground surface`, `ground hold`, and the message after Ctrl-C."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from threading import Timer

import pytest
from typer.testing import CliRunner, Result

from ground.cli.interrupt import OnInterrupt, interruptible
from ground.cli.main import app
from ground.client import mode_map, stopping
from ground.client import vehicle as client
from ground.client.vehicle import CommandRefusedError, VehicleClient, VehicleClientError
from ground.errors import Interrupted
from mavlink_io.errors import OperationError
from tests.ground.fake import DENIED, FakeVehicle, step_while_waiting

SET_MODE, ARM_DISARM = 176, 400
FORCE = 21196.0
"""param2 of COMPONENT_ARM_DISARM that disarms under way."""
HOLD, MISSION, SURFACE = 50_593_792, 67_371_008, 100_925_440
"""As in docs/clients.md; MISSION and SURFACE are the standard modes 6 and 7."""
MODES = (("HOLD", 0, HOLD), ("", 6, MISSION), ("", 7, SURFACE))
SUBMARINE, ARDUPILOT, ARDUSUB_SURFACE = 12, 3, 9


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeVehicle]:
    """A vehicle that flies a mission, at the address of any command."""
    fake = FakeVehicle()
    fake.modes, fake.custom_mode = MODES, MISSION
    monkeypatch.setattr(client, "wait", step_while_waiting(fake))
    monkeypatch.setattr(client, "open_transport", lambda address: fake.ground_end)
    monkeypatch.setattr(stopping, "CONFIRM_TIMEOUT_S", 0.2)
    fake.heartbeat(armed=True)
    yield fake
    fake.close()


def ground(*words: str) -> Result:
    return CliRunner().invoke(app, [*words])


def modes_set(fake: FakeVehicle) -> list[tuple[float, float]]:
    return [(c.param1, c.param2) for c in fake.commands if c.command == SET_MODE]


@pytest.mark.parametrize(("command", "number"), [("surface", SURFACE), ("hold", HOLD)])
def test_stop_command_mode_is_set_and_confirmed(
    command: str, number: int, fake: FakeVehicle
) -> None:
    done = ground(command, "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout) == {"mode": command.upper(), "armed": True, "depth_m": None}
    assert modes_set(fake) == [(1.0, float(number))]


@pytest.mark.parametrize(("command", "armed"), [("stop", False), ("arm", True)])
def test_arming_command_is_sent_and_confirmed(command: str, armed: bool, fake: FakeVehicle) -> None:
    fake.heartbeat(armed=not armed)
    fake.after[ARM_DISARM] = lambda: fake.heartbeat(armed=armed)
    done = ground(command, "--json")
    assert done.exit_code == 0, done.output
    state = json.loads(done.stdout)
    assert (state["armed"], state["mode"]) == (armed, "MISSION")
    sent = [(c.param1, c.param2) for c in fake.commands if c.command == ARM_DISARM]
    assert sent == [(1.0, 0.0) if armed else (0.0, FORCE)]


def test_stop_not_confirmed_is_an_error(fake: FakeVehicle) -> None:
    done = ground("stop")
    assert isinstance(done.exception, OperationError)
    assert "0.2 s later it is not disarmed" in str(done.exception)


@pytest.mark.parametrize("command", ["stop", "hold"])
def test_unconfirmed_command_names_the_time_that_was_waited(
    command: str, fake: FakeVehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Over a modem the wait is longer than the default."""
    monkeypatch.setattr(VehicleClient, "link_timeout_s", lambda vehicle, default_s: 2.0 * default_s)
    fake.enters_modes = False
    done = ground(command)
    assert isinstance(done.exception, OperationError)
    assert "but 0.4 s later" in str(done.exception)


def test_mode_of_similar_name_is_suggested(fake: FakeVehicle) -> None:
    done = ground("mode", "surfce")
    assert isinstance(done.exception, VehicleClientError)
    assert str(done.exception).endswith("offers HOLD, MISSION, SURFACE; did you mean SURFACE?")


def test_mode_without_a_name_prints_the_mode_and_the_offer(fake: FakeVehicle) -> None:
    done = ground("mode")
    assert "in mode MISSION; it offers HOLD, MISSION, SURFACE" in done.stdout
    assert modes_set(fake) == []


def test_mode_is_set_and_confirmed(fake: FakeVehicle) -> None:
    assert ground("mode", "hold").exit_code == 0
    assert modes_set(fake) == [(1.0, float(HOLD))]


def test_surface_refusal_is_an_error(fake: FakeVehicle) -> None:
    fake.answers[SET_MODE] = [DENIED]
    done = ground("surface")
    assert isinstance(done.exception, CommandRefusedError)
    assert str(done.exception) == "do set mode: denied"


def test_surface_accepted_but_not_entered_is_an_error(fake: FakeVehicle) -> None:
    fake.enters_modes = False
    done = ground("surface")
    assert isinstance(done.exception, OperationError)
    assert (
        str(done.exception)
        == "mode SURFACE: the vehicle accepted it, but 0.2 s later reports MISSION"
    )


def test_hold_not_offered_names_what_is(fake: FakeVehicle) -> None:
    fake.modes = MODES[1:]
    done = ground("hold")
    assert isinstance(done.exception, VehicleClientError)
    assert str(done.exception) == "mode HOLD: the vehicle offers MISSION, SURFACE"
    assert modes_set(fake) == []


def test_surface_mode_of_any_case_is_found(fake: FakeVehicle) -> None:
    fake.modes = (("Surface", 0, 7),)
    assert ground("surface").exit_code == 0
    assert modes_set(fake) == [(1.0, 7.0)]


def test_surface_without_mode_list_uses_published_names(
    fake: FakeVehicle, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """ArduSub does not answer for AVAILABLE_MODES; its SURFACE is 9 (ArduPilot, SUB_MODE)."""
    fake.lists_modes = False
    monkeypatch.setattr(mode_map, "DEFAULT_PATH", tmp_path / "none.json")
    vehicle = VehicleClient(fake.ground_end)
    vehicle.connect()
    monkeypatch.setattr(
        vehicle, "modes", lambda: (_ for _ in ()).throw(VehicleClientError("no answer"))
    )
    fake.heartbeat(kind=SUBMARINE, autopilot=ARDUPILOT)
    vehicle.pump(0.0)
    stopping.enter(vehicle, stopping.SURFACE)
    assert modes_set(fake) == [(1.0, float(ARDUSUB_SURFACE))]


def test_surface_at_the_surface_counts_the_end_as_done(fake: FakeVehicle) -> None:
    """There SURFACE disarms at once, and what the vehicle reports next is HOLD."""
    fake.enters_modes = False
    fake.after[SET_MODE] = lambda: fake.heartbeat(armed=False)
    done = ground("surface")
    assert done.exit_code == 0, done.output
    assert "the vehicle is disarmed" in done.stdout


def test_surface_wait_ends_when_disarmed(fake: FakeVehicle) -> None:
    later = Timer(0.3, lambda: fake.heartbeat(armed=False))
    later.start()
    done = ground("surface", "--wait", "--json")
    later.join()
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["armed"] is False


def test_surface_wait_fails_when_the_mode_is_left(fake: FakeVehicle) -> None:
    def back_to_mission() -> None:
        fake.custom_mode = MISSION
        fake.heartbeat()

    later = Timer(0.3, back_to_mission)
    later.start()
    done = ground("surface", "--wait")
    later.join()
    assert isinstance(done.exception, OperationError)
    assert str(done.exception) == "the vehicle has left SURFACE for MISSION and is still under way"


ADDRESS = "udpin:127.0.0.1:14550"
STOP = (
    f"`ground surface --connect {ADDRESS}` ends the dive, "
    f"`ground hold --connect {ADDRESS}` keeps depth, heading and thrust"
)


def interrupted(choice: OnInterrupt) -> Interrupted:
    """Interrupt work that leaves a vehicle under way; return what reaches the main program."""
    interruption = Interrupted(130)
    interruption.add_note("the vehicle is still under way")
    interruption.under_way = True
    with pytest.raises(Interrupted), interruptible(choice, ADDRESS, None, None):
        raise interruption
    return interruption


def test_interrupt_with_a_choice_sets_the_mode(fake: FakeVehicle) -> None:
    notes = interrupted(OnInterrupt.SURFACE).__notes__
    assert notes == ["the vehicle is under way in mode SURFACE"]
    assert modes_set(fake) == [(1.0, float(SURFACE))]


def test_interrupt_refused_mode_keeps_the_note(fake: FakeVehicle) -> None:
    fake.answers[SET_MODE] = [DENIED]
    notes = interrupted(OnInterrupt.HOLD).__notes__
    assert notes == ["the vehicle is still under way", "hold failed: do set mode: denied"]


def test_interrupt_without_a_terminal_leaves_the_vehicle(fake: FakeVehicle) -> None:
    assert interrupted(OnInterrupt.ASK).__notes__ == ["the vehicle is still under way"]
    assert fake.commands == []


@pytest.mark.parametrize(
    ("answers", "modes"),
    [
        (["s"], [(1.0, float(SURFACE))]),
        (["what", "hold"], [(1.0, float(HOLD))]),
        ([""], []),
        ([], []),
    ],
)
def test_interrupt_on_a_terminal_asks(
    answers: list[str],
    modes: list[tuple[float, float]],
    fake: FakeVehicle,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    given = iter(answers)

    def answer() -> str:
        try:
            return next(given)
        except StopIteration:
            raise EOFError from None

    for stream in (sys.stdin, sys.stderr):
        monkeypatch.setattr(stream, "isatty", lambda: True, raising=False)
    monkeypatch.setattr("builtins.input", answer)
    interrupted(OnInterrupt.ASK)
    assert modes_set(fake) == modes
    assert "leave, hold, surface? [leave]" in capsys.readouterr().err


def connected(fake: FakeVehicle) -> VehicleClient:
    vehicle = VehicleClient(fake.ground_end)
    vehicle.connect()
    vehicle.modes()
    return vehicle


def test_remaining_state_under_way_names_mode_and_commands(fake: FakeVehicle) -> None:
    said = stopping.describe_remaining_state(connected(fake), ADDRESS, None)
    assert said == f"the vehicle is still under way in mode MISSION: {STOP}"


def test_remaining_state_rising_does_not_advise_to_surface(fake: FakeVehicle) -> None:
    vehicle = connected(fake)
    stopping.enter(vehicle, stopping.SURFACE)
    said = stopping.describe_remaining_state(vehicle, ADDRESS, None)
    hold = STOP.partition(", ")[2]
    assert said == f"the vehicle is still under way in mode SURFACE: {hold}"


def test_remaining_state_signed_link_repeats_its_key(fake: FakeVehicle) -> None:
    said = stopping.describe_remaining_state(connected(fake), ADDRESS, Path("my key"))
    assert said.count(f"--connect {ADDRESS} --sign 'my key'`") == 2


def test_remaining_state_disarmed(fake: FakeVehicle) -> None:
    fake.heartbeat(armed=False)
    assert (
        stopping.describe_remaining_state(connected(fake), ADDRESS, None)
        == "the vehicle is disarmed"
    )


def test_remaining_state_while_arming_is_not_disarmed(fake: FakeVehicle) -> None:
    fake.heartbeat(armed=False)
    vehicle = connected(fake)
    vehicle.arm()
    assert not vehicle.armed, "no heartbeat has come yet"
    assert (
        stopping.describe_remaining_state(vehicle, ADDRESS, None)
        == f"the vehicle was about to arm: {STOP}"
    )


def test_remaining_state_before_any_vehicle_says_nothing(fake: FakeVehicle) -> None:
    assert stopping.describe_remaining_state(VehicleClient(fake.ground_end), ADDRESS, None) == ""
