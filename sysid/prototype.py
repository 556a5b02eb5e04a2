"""Gains for a vehicle that has never been to sea, from her file alone: the prototype controller of a first dive."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sitl.vehicle import calibrate
from sitl.vehicle import config as vehicle_files
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.linearise import linearise
from sitl.vehicle.model import Model
from sysid import design, fit, greybox, loops
from sysid.analysis import Analysis, Planes
from sysid.design import Loads, Spec, depth, heading, limits, ways
from sysid.design.plant import ASSUMED_SEA, Plant, assembled, judge, scaled
from sysid.loops import Lag
from sysid.planes import LinearPlane
from sysid.tables import TABLE_3_INITIAL

SPEC = Spec(
    damping=0.5, gm_db=8.0, pm_deg=50.0, ms=1.8, finish_left=0.3, pitch_rms_growth=math.inf, command_noise_deg=0.4
)
"""What a loop through the tailcone's whole lag can keep. The lag is undone once it has been measured; and there is no
earlier controller whose pitch activity could be a measure."""
HEADING_STARTS = tuple({name: start[name] for name in ("HDG_P", "HDG_D", "HDG_I")} for start in heading.STARTS)
UNSURE_RAD = math.radians(2.0)
"""Rudder bias and elevator trim that nobody has measured yet."""


class Prototype(NamedTuple):
    """What a first dive sets, and how the loops stand on the vehicle's own linear planes."""

    parameters: dict[str, float]
    """By parameter name."""
    reasons: dict[str, str]
    analysis: Analysis

    def write_params(self, path: Path) -> None:
        """Parameter file: ``NAME,VALUE  # reason``."""
        lines = [f"{name},{value:.6g}  # {self.reasons[name]}" for name, value in self.parameters.items()]
        path.write_text("\n".join(["# prototype controller, from the vehicle file", *lines]) + "\n", encoding="utf-8")


def prototype(name_or_path: str | Path) -> Prototype:
    """Parameters for a vehicle file.

    Raises:
        VehicleError: the file cannot be used.
        DesignRefused: no gains meet the specification on this vehicle.
    """
    config = vehicle_files.load(name_or_path)
    model = calibrate.build(config)
    vehicle = _plant(config, model)
    loads = Loads(fit.level_pitch_rad(config, model), UNSURE_RAD, UNSURE_RAD)
    spec = SPEC._replace(travel_deg=config.tailcone.travel_deg)
    gains, bounds = dict(TABLE_3_INITIAL), limits.nominal(spec)
    gains |= heading.gains(vehicle, gains, spec, bounds, scaled(HEADING_STARTS, vehicle.planes.yaw))
    gains |= depth.gains(vehicle, gains, spec, bounds, scaled(depth.STARTS, vehicle.planes.pitch))
    gains |= design.integrator_limits(loads, gains)
    gains |= ways.heading(vehicle, gains, loads, spec) | ways.depth(vehicle, gains, loads, spec)
    judged = judge(vehicle, gains)
    cruise = _cruise(config, model)
    reasons = {name: _margins(judged, name) for name in gains} | {name: why for name, (_, why) in cruise.items()}
    return Prototype({**gains, **{name: value for name, (value, _) in cruise.items()}}, reasons, judged)


def _plant(config: VehicleConfig, model: Model) -> Plant:
    """The vehicle's own linear planes in FRD axes, her tailcone and an assumed sea."""
    found = linearise(model, config.operating_point.speed_mps)
    turned = np.diag([-1.0, -1.0, -1.0, 1.0])
    yaw = LinearPlane(found.yaw.A, -found.yaw.B[:, 0], ("v", "r", "psi"), np.array([0.0, 1.0, 0.0]))
    pitch = LinearPlane(
        turned @ found.pitch.A @ turned, turned @ found.pitch.B[:, 0],
        ("w", "q", "theta", "depth"), np.array([0.0, 1.0, 0.0, 0.0]),
    )  # fmt: skip
    tail = config.tailcone
    lag = Lag(tail.delay_s + loops.SAMPLING_S, tail.natural_frequency_radps, tail.damping_ratio)
    return assembled(Planes(yaw, pitch), lag, lag, {"yaw": ASSUMED_SEA, "pitch": ASSUMED_SEA})


def _cruise(config: VehicleConfig, model: Model) -> dict[str, tuple[float, str]]:
    """Parameters that describe the vehicle to her autopilot, each with its reason."""
    point = config.operating_point
    length_m = -2.0 * point.speed_mps / _surge_slope_per_s(config, model)
    return {
        "ACT_TRAVEL_DEG": (config.tailcone.travel_deg, "travel of the tailcone"),
        "THR_CRUISE_PCT": (100.0 * point.thrust_fraction, "operating point"),
        "SPD_CRUISE_MPS": (point.speed_mps, "operating point"),
        "SPD_LENGTH_M": (min(500.0, max(1.0, length_m)), "twice speed times the surge time constant"),
        "TRIM_ELE_DEG": (math.degrees(fit.level_elevator_rad(config, model)), "elevator of level flight"),
        "EST_DENSITY": (config.water.density_kgpm3, "water of the vehicle file"),
    }


def _surge_slope_per_s(config: VehicleConfig, model: Model) -> float:
    """d(u')/du in straight flight at the operating point: drag, and the thrust lost to inflow."""
    point, step = config.operating_point, 1e-4
    rps = point.thrust_fraction * model.propeller.full_rps

    def surge(u_mps: float) -> float:
        return float(greybox.accelerations(model, "yaw", np.array([u_mps, 0.0, 0.0, 0.0, 0.0]), 0.0, rps)[0])

    return (surge(point.speed_mps + step) - surge(point.speed_mps - step)) / (2.0 * step)


def _margins(judged: Analysis, gain: str) -> str:
    loop, cut = ("heading", "rudder") if gain.startswith("HDG") else ("depth", "elevator")
    found = judged.margins[cut]
    least = min((-pole.real / abs(pole) for pole in judged.poles[loop]), default=1.0)
    return f"{loop} loop: damping {least:.2f}, GM {found.gm_db:.1f} dB, PM {found.pm_deg:.0f} deg at the {cut}"
