"""The drop weight of a vehicle file: released once by output 4."""

import msgspec
import pytest

from mavlink_io.records import ActuatorFrame
from sitl import scenario
from sitl.core import plant
from sitl.vehicle import config as vehicles
from sitl.vehicle.config import DropWeight, VehicleFileError

WEIGHT_KG = 8.0
HEAVY_KG = 4.0
"""Ballast fault that outweighs the vehicle's net buoyancy of 2.27 kg."""


def depth_after(release: float, *, fitted: bool = True, seconds: float = 60.0) -> float:
    """Return the depth of a heavy vehicle that starts at 10 m, without power."""
    calm = scenario.load("calm")
    start = msgspec.structs.replace(calm.start, depth_m=10.0)
    heavy: dict[str, float | str] = {
        "at_s": 0.0,
        "unit": "ballast",
        "kind": "added",
        "mass_kg": HEAVY_KG,
    }
    sea = msgspec.structs.replace(calm, start=start, fault=(heavy,))
    vehicle = vehicles.load("caribou_truth")
    if fitted:
        vehicle = msgspec.structs.replace(vehicle, drop_weight=DropWeight(WEIGHT_KG))
    simulated, rng = plant.build(vehicle, sea), plant.random_streams(1)
    state, _ = plant.initial_state(simulated, rng)
    for tick in range(round(seconds * 50)):
        pulse = release if tick == 50 else 0.0
        controls = (0.0, 0.0, 0.0, pulse, *(0.0,) * 12)
        state, _ = plant.step(simulated, state, ActuatorFrame(0, 0, controls, 0), rng)
    return state.truth.position_ned_m[2]


def test_drop_weight_released_once_raises_heavy_vehicle() -> None:
    assert depth_after(0.0) > 10.5
    assert depth_after(1.0) < 9.0


def test_drop_weight_not_fitted_has_no_effect() -> None:
    assert depth_after(1.0, fitted=False, seconds=10.0) == depth_after(
        0.0, fitted=False, seconds=10.0
    )


def test_drop_weight_too_heavy_is_refused() -> None:
    vehicle = msgspec.structs.replace(vehicles.load("caribou_truth"), drop_weight=DropWeight(400.0))
    with pytest.raises(VehicleFileError, match=r"drop_weight\.mass_kg = 400: expected less than"):
        plant.build(vehicle, scenario.load("calm"))
