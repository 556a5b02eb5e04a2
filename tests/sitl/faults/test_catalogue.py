"""Faults in scenario files and in MAV_CMD_INJECT_FAILURE: valid content and error messages."""

from math import isnan, nan, radians
from pathlib import Path

import pytest

from sitl import scenario
from sitl.core import plant
from sitl.faults import failure_injection, timeline
from sitl.faults.catalogue import CATALOGUE, ScheduledFault, make
from sitl.scenario_types import ScenarioError
from sitl.vehicle import build_model, config

ALL_FAULTS = [(unit, kind) for unit, kinds in CATALOGUE.items() for kind in kinds]


def load(folder: Path, text: str) -> list[ScheduledFault]:
    file = folder / "faults.toml"
    file.write_text(text)
    return scenario.load(str(file)).faults


def row(**keys: object) -> str:
    return "[[fault]]\n" + "".join(f"{key} = {value!r}\n" for key, value in keys.items())


def test_fault_parameters_are_converted_to_si(tmp_path: Path) -> None:
    text = row(at_s=2.5, until_s=9, unit="rudder", kind="stuck", angle_deg=-4.0) + row(
        at_s=0, unit="gps", kind="off"
    )
    first, second = load(tmp_path, text)
    assert first == ScheduledFault("rudder", "stuck", 2_500_000, 9_000_000, (radians(-4.0),))
    assert second == ScheduledFault("gps", "off", 0, None, ())


@pytest.mark.parametrize(("unit", "kind"), ALL_FAULTS)
def test_every_fault_can_be_scheduled(unit: str, kind: str, tmp_path: Path) -> None:
    needed = {size.key: 1.5 for size in CATALOGUE[unit][kind] if size.default is None}
    (fault,) = load(tmp_path, row(at_s=1, unit=unit, kind=kind, **needed))
    assert fault.name == f"{unit} {kind}"
    assert len(timeline.FaultChange(fault, False).text) <= 50


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"unit": "rudder", "kind": "off"}, "missing key at_s"),
        ({"at_s": 1, "kind": "off"}, "missing key unit"),
        (
            {"at_s": 1, "unit": "ruder", "kind": "off"},
            "unit = 'ruder': expected rudder, elevator, propeller",
        ),
        ({"at_s": 1, "unit": "leak", "kind": "off"}, "kind = 'off': leak can be wet"),
        (
            {"at_s": 1, "unit": "gps", "kind": "off", "period_s": 2},
            "period_s = 2: gps off takes no parameter",
        ),
        (
            {"at_s": 1, "unit": "gps", "kind": "slow", "delay_s": 2},
            "delay_s = 2: gps slow takes period_s",
        ),
        (
            {"at_s": 5, "until_s": 5, "unit": "gps", "kind": "off"},
            "until_s = 5: expected more than at_s = 5",
        ),
        ({"at_s": -1, "unit": "gps", "kind": "off"}, "at_s = -1: expected 0 to 1e+06"),
        (
            {"at_s": 1, "unit": "dvl", "kind": "intermittent", "share": 1.5},
            "share = 1.5: expected 0 to 0.99",
        ),
        (
            {"at_s": 1, "unit": "dvl", "kind": "slow", "period_s": "often"},
            "period_s = 'often': expected a number",
        ),
        ({"at_s": 1, "unit": 3, "kind": "off"}, "unit = 3: expected a name"),
        (
            {"at_s": 1, "unit": "ballast", "kind": "added"},
            "missing key mass_kg: ballast added needs it",
        ),
    ],
)
def test_fault_error_names_valid_values(
    keys: dict[str, object], message: str, tmp_path: Path
) -> None:
    with pytest.raises(ScenarioError) as error:
        load(tmp_path, row(at_s=1, unit="gps", kind="off") + row(**keys))
    assert str(error.value).startswith(f"scenario {tmp_path}/faults.toml: fault 2: {message}")


@pytest.mark.parametrize(
    ("kind", "mass_kg", "x_m"), [("added", -700.0, 0.0), ("shifted", 900.0, 2.0)]
)
def test_infeasible_ballast_is_rejected(
    tmp_path: Path, kind: str, mass_kg: float, x_m: float
) -> None:
    load(tmp_path, row(at_s=1, unit="ballast", kind=kind, mass_kg=mass_kg, x_m=x_m))
    asked, vehicle = scenario.load(str(tmp_path / "faults.toml")), config.load("caribou_truth")
    with pytest.raises(
        ScenarioError, match=f"ballast {kind} {mass_kg:g}: expected less: the vehicle has"
    ):
        plant.build(vehicle, asked)


def test_faults_start_and_end_on_time() -> None:
    model = build_model.build(config.load("caribou_truth"))
    line = timeline.schedule(
        [make("gyro", "off", 40_000, 80_000, {}), make("gps", "off", 80_000, None, {})]
    )
    changes = []
    for time_us in range(0, 200_000, 20_000):
        line = timeline.advance(line, model, time_us)
        changes += [(time_us, change.text) for change in line.changes]
    assert changes == [
        (40_000, "Fault: gyro off"),
        (80_000, "Fault over: gyro off"),
        (80_000, "Fault: gps off"),
    ]
    assert line.names == ("gps off",)


def test_repeated_command_adds_one_fault_and_ok_clears() -> None:
    model = build_model.build(config.load("caribou_truth"))
    off, ok = (
        failure_injection.parse_command(4, 1, nan, nan),
        failure_injection.parse_command(4, 0, 0, nan),
    )
    line = failure_injection.apply_injection(
        failure_injection.apply_injection(timeline.schedule([]), off, 0), off, 0
    )
    line = timeline.advance(line, model, 20_000)
    assert line.names == ("gps off",)
    line = timeline.advance(failure_injection.apply_injection(line, ok, 20_000), model, 40_000)
    assert (line.names, [change.text for change in line.changes]) == ((), ["Fault over: gps off"])
    line = timeline.advance(failure_injection.apply_injection(line, off, 40_000), model, 60_000)
    assert line.names == ("gps off",)


@pytest.mark.parametrize(
    ("parameters", "result", "units", "kind"),
    [
        ((0, 2, 0, nan), 0, ("gyro",), "stuck"),
        ((102, 2, 1, 0), 0, ("rudder",), "stuck"),
        ((102, 3, 2, nan), 0, ("elevator",), "noisy"),
        ((102, 7, nan, nan), 0, ("rudder", "elevator"), "slipping"),
        ((101, 5, 0, nan), 0, ("propeller",), "loss"),
        ((6, 4, 1, 0.5), 0, ("dvl",), "wrong"),
        ((7, 0, 0, nan), 0, ("altimeter",), ""),
        ((102, 2, 3, nan), 2, (), ""),
        ((3, 7, 0, 2.0), 2, (), ""),
        ((8, 1, 0, nan), 3, (), ""),
        ((101, 6, 0, nan), 3, (), ""),
        ((nan, nan, nan, nan), 3, (), ""),
    ],
)
def test_command_result_follows_mavlink_enums(
    parameters: tuple[float, float, float, float], result: int, units: tuple[str, ...], kind: str
) -> None:
    injection = failure_injection.parse_command(*parameters)
    assert injection.result == result
    assert bool(injection.text) == (result != 0)
    if result == 0:
        assert (injection.units, injection.kind) == (units, kind)


def test_param4_sets_size_and_zero_means_default() -> None:
    (slow,) = failure_injection.apply_injection(
        timeline.schedule([]), failure_injection.parse_command(102, 5, 1, 4.0), 0
    ).waiting
    assert slow.sizes == (radians(4.0),)
    (usual,) = failure_injection.apply_injection(
        timeline.schedule([]), failure_injection.parse_command(102, 5, 1, 0.0), 0
    ).waiting
    assert usual.sizes == (radians(2.0),)
    (stuck,) = failure_injection.apply_injection(
        timeline.schedule([]), failure_injection.parse_command(102, 2, 1, nan), 0
    ).waiting
    assert isnan(stuck.sizes[0])


def test_link_silence_ends_after_its_duration() -> None:
    (silent,) = failure_injection.apply_injection(
        timeline.schedule([]), failure_injection.parse_command(105, 1, 0, 4.0), 1_000_000
    ).waiting
    assert (silent.from_us, silent.until_us) == (1_000_000, 5_000_000)
