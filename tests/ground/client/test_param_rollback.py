"""Upload of parameters as one change, and its rollback."""

import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from ground.client import param_rollback
from ground.client import vehicle as client
from ground.client.param_rollback import ParamUpload, UploadHistory
from ground.client.vehicle import VehicleClient
from ground.errors import INTERRUPTED, Interrupted
from mavlink_io.errors import InputError, OperationError
from tests.ground.fake import FakeVehicle, step_while_waiting

NEW = {"HDG_P": 0.875, "DPT_P": 0.25}
OLD = {"HDG_P": pytest.approx(0.65), "DPT_P": pytest.approx(0.13)}


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path / "caribou" / "changes" / "system-1.json"


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeVehicle]:
    vehicle = FakeVehicle()
    monkeypatch.setattr(client, "wait", step_while_waiting(vehicle))
    vehicle.heartbeat()
    yield vehicle
    vehicle.close()


@pytest.fixture
def vehicle(fake: FakeVehicle) -> VehicleClient:
    found = VehicleClient(fake.ground_end)
    found.connect()
    return found


def refuse(fake: FakeVehicle, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The vehicle refuses the new value of a parameter and accepts the old one."""
    store = fake.table.set

    def refusing(asked: str, value: float) -> float:
        if asked == name and value == pytest.approx(NEW[name]):
            raise ValueError("too much")
        return store(asked, value)

    monkeypatch.setattr(fake.table, "set", refusing)


def fall_silent(fake: FakeVehicle, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The vehicle stores a parameter and is then silent."""
    store = fake.table.set

    def losing(asked: str, value: float) -> float:
        stored = store(asked, value)
        if asked == name:
            monkeypatch.setattr(fake._endpoint, "send_values", lambda *told: None)
        return stored

    monkeypatch.setattr(fake.table, "set", losing)


def test_upload_returns_old_and_new_values(
    vehicle: VehicleClient, fake: FakeVehicle, state: Path
) -> None:
    steps = param_rollback.upload(vehicle, NEW, "gains.param", "ab")
    assert {step.name: step.after for step in steps} == NEW == fake.table.values
    assert {step.name: step.before for step in steps} == OLD
    assert UploadHistory(state).last() == ParamUpload(
        "gains.param", UploadHistory(state).last().before, NEW, "ab"
    )


def test_rollback_restores_and_empties_history(vehicle: VehicleClient, fake: FakeVehicle) -> None:
    param_rollback.upload(vehicle, NEW, "gains.param")
    undone, steps = param_rollback.rollback(vehicle)
    assert undone.source == "gains.param"
    assert {step.name: step.after for step in steps} == OLD
    assert fake.table.values == OLD
    with pytest.raises(InputError, match=r"system-1\.json: holds no change"):
        param_rollback.rollback(vehicle)


def test_rollback_undoes_last_upload_first(vehicle: VehicleClient, fake: FakeVehicle) -> None:
    param_rollback.upload(vehicle, NEW, "first.param")
    param_rollback.upload(vehicle, {"HDG_P": 0.5}, "second.param")
    param_rollback.rollback(vehicle)
    assert fake.table.values == NEW
    param_rollback.rollback(vehicle)
    assert fake.table.values == OLD


def test_upload_unknown_name_sets_nothing(
    vehicle: VehicleClient, fake: FakeVehicle, state: Path
) -> None:
    with pytest.raises(
        InputError, match=r"gains\.param: NO_SUCH: the vehicle has no such parameter"
    ):
        param_rollback.upload(vehicle, {**NEW, "NO_SUCH": 1.0}, "gains.param")
    assert fake.table.values == {"HDG_P": 0.65, "DPT_P": 0.13}
    assert not state.exists()


def test_upload_refused_value_restores_the_others(
    vehicle: VehicleClient, fake: FakeVehicle, state: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refuse(fake, "DPT_P", monkeypatch)
    with pytest.raises(OperationError, match=r"DPT_P.*set and restored: HDG_P\."):
        param_rollback.upload(vehicle, NEW, "gains.param")
    assert fake.table.values == OLD
    with pytest.raises(InputError, match="holds no change"):
        UploadHistory(state).last()


def test_upload_lost_link_keeps_record_and_advises(
    vehicle: VehicleClient, fake: FakeVehicle, state: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "HEARTBEAT_TIMEOUT_S", 0.3)
    fall_silent(fake, "HDG_P", monkeypatch)
    with pytest.raises(
        OperationError, match=r"set: nothing; not set: HDG_P, DPT_P\. .*`ground params rollback`"
    ):
        param_rollback.upload(vehicle, NEW, "gains.param")
    assert UploadHistory(state).last().before == OLD


def test_rollback_changed_value_needs_force(vehicle: VehicleClient, fake: FakeVehicle) -> None:
    param_rollback.upload(vehicle, NEW, "gains.param")
    vehicle.set_parameter("HDG_P", 0.75)
    with pytest.raises(OperationError, match=r"HDG_P is 0\.75, and gains\.param set 0\.875"):
        param_rollback.rollback(vehicle)
    assert fake.table.values["HDG_P"] == 0.75
    param_rollback.rollback(vehicle, force=True)
    assert fake.table.values == OLD


def test_rollback_of_incomplete_upload(
    vehicle: VehicleClient, fake: FakeVehicle, state: Path
) -> None:
    UploadHistory(state).push(ParamUpload("gains.param", dict(fake.table.values), NEW))
    vehicle.set_parameter("HDG_P", NEW["HDG_P"])
    param_rollback.rollback(vehicle)
    assert fake.table.values == OLD


def test_rollback_invalid_file_is_named(vehicle: VehicleClient, tmp_path: Path) -> None:
    (tmp_path / "mine.json").write_text("{}")
    with pytest.raises(InputError, match=r"mine\.json: Expected `array`"):
        param_rollback.rollback(vehicle, tmp_path / "mine.json")


def test_upload_value_that_is_not_finite_is_not_stored(
    vehicle: VehicleClient, fake: FakeVehicle, state: Path
) -> None:
    param_rollback.upload(vehicle, NEW, "first.param")
    fake.table.values["HDG_P"] = math.nan
    with pytest.raises(InputError, match=r"gains\.param: HDG_P: the vehicle reports nan; nothing"):
        param_rollback.upload(vehicle, NEW, "gains.param")
    assert UploadHistory(state).last().source == "first.param"


def test_rollback_record_without_new_value_is_refused(
    vehicle: VehicleClient, tmp_path: Path
) -> None:
    file = tmp_path / "mine.json"
    file.write_text('[{"source": "x", "before": {"HDG_P": 1.0}, "after": {}}]')
    with pytest.raises(InputError, match=r"mine\.json: HDG_P: is in `before` and not in `after`"):
        param_rollback.rollback(vehicle, file)


def test_rollback_missing_file_is_named(vehicle: VehicleClient, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.json: does not exist$"):
        param_rollback.rollback(vehicle, tmp_path / "none.json")


def interrupt(vehicle: VehicleClient, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C while a parameter is set."""
    set_parameter = vehicle.set_parameter

    def interrupted(asked: str, value: float) -> float:
        if asked == name:
            raise Interrupted(INTERRUPTED)
        return set_parameter(asked, value)

    monkeypatch.setattr(vehicle, "set_parameter", interrupted)


def test_upload_interrupted_names_parameters_and_keeps_record(
    vehicle: VehicleClient, fake: FakeVehicle, state: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupt(vehicle, "DPT_P", monkeypatch)
    with pytest.raises(Interrupted) as raised:
        param_rollback.upload(vehicle, NEW, "gains.param")
    (note,) = raised.value.__notes__
    assert note == ("set: HDG_P; not set: DPT_P. `ground params rollback` restores the old values")
    assert UploadHistory(state).last().before == OLD


def test_rollback_interrupted_names_remaining_parameters(
    vehicle: VehicleClient, fake: FakeVehicle, state: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    param_rollback.upload(vehicle, NEW, "gains.param")
    interrupt(vehicle, "DPT_P", monkeypatch)
    with pytest.raises(Interrupted) as raised:
        param_rollback.rollback(vehicle)
    assert raised.value.__notes__[0].startswith("not restored yet: DPT_P")
    assert UploadHistory(state).last().after == NEW


def test_upload_without_values_is_refused(vehicle: VehicleClient, state: Path) -> None:
    with pytest.raises(InputError, match=r"empty\.param: holds no parameter"):
        param_rollback.upload(vehicle, {}, "empty.param")
    assert not state.exists()
