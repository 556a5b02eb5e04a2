"""Scenario of a campaign: its content, its disturbance moments, and the depth of its water."""

import json
import subprocess
import sys
from collections.abc import Mapping
from typing import Any, NamedTuple

from ground.missions.script import Script
from mavlink_io.errors import BAD_INPUT, InputError, OperationError
from sysid.monte_carlo.readiness import Moments
from sysid.planes import Plane

CLEARANCE_M = 3.0
"""Height above the floor below which the autopilot stops a test (SID_ALT_MIN)."""


def scenario_content(scenario: str) -> dict[str, Any]:
    """Return a scenario with its defaults, as the simulator reads it. Raises InputError."""
    command = [sys.executable, "-m", "sitl.scenario_check", scenario]
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    if process.returncode == 0:
        content: dict[str, Any] = json.loads(process.stdout)
        return content
    lines = process.stderr.strip().splitlines() or ["no reason given"]
    message = lines[-1].removeprefix("sitl: ")
    raise InputError(message) if process.returncode == BAD_INPUT else OperationError(message)


def check_scenario(
    scenario: str, content: Mapping[str, Any], scripts: Mapping[str, Script]
) -> None:
    """Raise InputError if the vehicle is clamped, or a flat floor is too close to a leg."""
    if content["rig"]["clamped"]:
        raise InputError(f"--scenario {scenario}: rig.clamped = true: the vehicle cannot fly")
    floor = content["floor"]
    legs = [(step.depth_m or 0.0, name) for name, script in scripts.items() for step in script.step]
    deepest_m, mission = max(legs)
    if not floor["file"] and not floor["slope_deg"] and floor["depth_m"] < deepest_m + CLEARANCE_M:
        raise InputError(
            f"--scenario {scenario}: floor.depth_m = {floor['depth_m']:g}: the mission {mission} "
            f"dives to {deepest_m:g} m; expected at least {deepest_m + CLEARANCE_M:g}"
        )


class Heaviness(NamedTuple):
    """A vehicle that is heavier than the water at the surface."""

    cause: str
    remedy: str


def find_heaviness(content: Mapping[str, Any], vehicle: Any) -> Heaviness | None:
    """Return why a vehicle does not stay afloat without power; None if it floats."""
    layers = content["density"]["layer"]
    density_kgpm3 = (layers[0] if layers else content["water"])["density_kgpm3"]
    ballast, water = vehicle.ballast, vehicle.water
    weight_n = ballast.mass_kg * water.gravity_mps2
    lift_n = (weight_n + ballast.net_buoyancy_n) * density_kgpm3 / water.density_kgpm3 - weight_n
    enough_n = weight_n * (water.density_kgpm3 / density_kgpm3 - 1.0)
    if lift_n > 0.0:
        return None
    return Heaviness(
        f"water of {density_kgpm3:g} kg/m3 at the surface, in which {vehicle.name} is"
        f" {abs(lift_n):.3g} N too heavy: it does not rise without power",
        f"give the vehicle file a ballast.net_buoyancy_n above {enough_n:.3g}, or choose another"
        " scenario",
    )


def check_buoyancy(scenario: str, content: Mapping[str, Any], vehicle: Any) -> None:
    """Raise InputError if the vehicle is heavier than the water of the scenario at the surface."""
    if heavy := find_heaviness(content, vehicle):
        raise InputError(f"--scenario {scenario}: {heavy.cause}; {heavy.remedy}")


def moments(content: Mapping[str, Any]) -> Moments:
    """Return the disturbance moments of a scenario."""
    slow, waves = content["disturbance"]["slow"], content["disturbance"]["waves"]
    return Moments(
        slow_nm={Plane.YAW: slow["yaw_rms_nm"], Plane.PITCH: slow["pitch_rms_nm"]},
        slow_time_s=slow["time_constant_s"],
        wave_nm={Plane.YAW: waves["yaw_rms_nm"], Plane.PITCH: waves["pitch_rms_nm"]},
        wave_frequency_hz=waves["frequency_hz"],
        wave_damping=waves["damping"],
    )
