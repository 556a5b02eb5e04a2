"""Maintenance commands: parameter reset, mission removal and pressure calibration."""

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.commands import maintenance
from autopilot.control.params import ParamTable
from tests.helpers.commands import ACCEPTED, DENIED, NAN, REJECTED, results
from tests.helpers.fake_hil import HPA_PER_M, SURFACE_HPA, Harness, Station, only, texts


def test_storage_reset_sends_defaults_on_every_link() -> None:
    harness = Harness(Station(255, 190), Station(250, 190))
    harness.tick(3)
    for name, value in ((b"HDG_P", 0.75), (b"DPT_P", 0.2)):
        harness.ask(mavlink.MAVLink_param_set_message(1, 1, name, value, 9))
    harness.stations[1].pop_received()
    assert results(harness.command(245, 2, -1)) == [ACCEPTED]
    assert harness.vehicle.params.config == ParamTable().config
    reported = {
        m.param_id: m.param_value
        for m in harness.stations[1].pop_received()
        if m.get_type() == "PARAM_VALUE"
    }
    assert reported == pytest.approx({"HDG_P": 0.65, "DPT_P": 0.13})


def test_storage_armed_or_unknown_action_is_refused(harness: Harness) -> None:
    for parameters in ((0, 0), (1, 1), (NAN, NAN), (-1, -1)):
        assert results(harness.command(245, *parameters)) == [ACCEPTED]
    assert results(harness.command(245, 9)) == [DENIED]
    harness.command(400, 1)
    harness.ask(mavlink.MAVLink_param_set_message(1, 1, b"HDG_P", 0.75, 9))
    assert results(harness.command(245, 2)) == [REJECTED]
    assert harness.vehicle.params.get("HDG_P") == 0.75


def test_storage_clear_removes_mission(harness: Harness) -> None:
    harness.ask(mavlink.MAVLink_mission_count_message(1, 1, 1, 0))
    harness.ask(
        mavlink.MAVLink_mission_item_int_message(
            1, 1, 0, 2, 93, 1, 1, 10, NAN, NAN, NAN, 0, 0, NAN, 0
        )
    )
    assert only(harness.command(512, 42), "MISSION_CURRENT").total == 1
    assert results(harness.command(245, -1, 2)) == [ACCEPTED]
    assert only(harness.command(512, 42), "MISSION_CURRENT").total == 0xFFFF


def test_calibration_at_surface_sets_ground_pressure(harness: Harness) -> None:
    weather_hpa = SURFACE_HPA - 20.0
    harness.tick(300, depth_m=-20.0 / HPA_PER_M)
    assert harness.vehicle.state.estimate.depth_m == pytest.approx(-0.2, abs=0.01)
    received = harness.command(241, 0, 0, 1, 0, 0, 0, 0)
    assert results(received) == [ACCEPTED]
    assert texts(received)[0].startswith("Ground pressure is 993.")
    assert only(received, "PARAM_VALUE").param_value == pytest.approx(weather_hpa, abs=0.5)
    harness.tick(300, depth_m=-20.0 / HPA_PER_M)
    assert harness.vehicle.state.estimate.depth_m == pytest.approx(0.0, abs=0.005)


def test_calibration_under_water_is_refused(harness: Harness) -> None:
    harness.tick(300, depth_m=(maintenance.MAX_PRESSURE_CHANGE_HPA + 5.0) / HPA_PER_M)
    received = harness.command(241, 0, 0, 1, 0, 0, 0, 0)
    assert results(received) == [REJECTED]
    assert "hPa exceeds 60 hPa" in texts(received)[0]
    assert harness.vehicle.params.get("EST_SURF_HPA") == SURFACE_HPA


@pytest.mark.parametrize("wanted", [(1,), (0, 1), (0, 0, 0, 0, 1), (0, 0, 0, 0, 2), (1, 0, 1)])
def test_calibration_of_other_sensors_is_denied_with_reason(
    harness: Harness, wanted: tuple[float, ...]
) -> None:
    received = harness.command(241, *wanted, *[0.0] * (7 - len(wanted)))
    assert results(received) == [DENIED]
    assert texts(received)


def test_calibration_of_all_zeros_is_accepted(harness: Harness) -> None:
    assert results(harness.command(241, *[0.0] * 7)) == [ACCEPTED]
