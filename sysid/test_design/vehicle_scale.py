"""Ratios between a vehicle and Caribou, by which tests, missions and disturbances are scaled.

The shipped missions and the moments of the shipped scenarios were made for Caribou. The ratios are
computed from the two vehicle files, never from the simulated truth. With L the length of the hull,
U the speed, b1 the angular acceleration per surface angle, and w the highest feasible crossover
frequency of a plane:

    time        tau = (L / U) / (L / U)_Caribou
    leg         max(1, tau, U_Caribou / U)         depths are those of Caribou's missions
    frequency   phi = w / w_Caribou
    step        a_step = b1_Caribou / b1 / tau^2    same angle in tau times the time
    sweep       a_sweep = b1_Caribou / b1 * phi^2   same angle at phi times the frequency
    moment      mu = (M^-1)_Caribou / (M^-1) min(1, b1 / b1_Caribou)

with (M^-1) the diagonal element of yaw or pitch of the inverse mass matrix, added mass included.
The moment gives the same angular acceleration, or, where the surface accelerates the vehicle less
than Caribou's, the acceleration that takes the same share of the surface's travel: no control holds
a vehicle against moments beyond its surfaces.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from sitl.vehicle import hull
from sitl.vehicle.config import VehicleConfig
from sysid.estimation.map import steady_state
from sysid.models.parameters import CandidateVehicle
from sysid.planes import PLANES, Plane
from sysid.test_design import prior as design_priors
from sysid.test_design.plan import scale
from sysid.test_design.prior import DesignPrior
from sysid.validation import crossover


class PlaneScale(NamedTuple):
    """Ratios of one plane, and the largest size of its tests."""

    moment: float
    """Disturbance moment for the same angular acceleration, or less for a weaker surface."""
    frequency: float
    """Frequencies of sweeps."""
    step_size: float
    """Surface angle of steps."""
    sweep_size: float
    """Surface angle of sweeps and pulses."""
    max_size_deg: float
    """Travel of the surface without the reserve for an unknown trim (deg)."""
    loop_on: bool
    """Whether tests keep the loop on: a turn that a test begins may go on against the rudder."""


class VehicleScale(NamedTuple):
    """Ratios of a vehicle to Caribou."""

    time: float
    leg: float
    """Durations of legs, at least 1: `time`, or more for a slower dive by the same depth."""
    length: float
    thrust_pct: float
    """Thrust of the vehicle's operating point (%)."""
    planes: Mapping[Plane, PlaneScale]


def vehicle_scale(config: VehicleConfig, reference: VehicleConfig) -> VehicleScale:
    """Return the ratios of a vehicle to a reference vehicle.

    Parameters
    ----------
    config : VehicleConfig
        Vehicle file.
    reference : VehicleConfig
        Vehicle file of Caribou, for which missions and scenarios were made.

    Returns
    -------
    VehicleScale
        Ratios; the module docstring has the equations.
    """
    prior, reference_prior = design_priors.from_file(config), design_priors.from_file(reference)
    length = hull.length_m(config.hull) / hull.length_m(reference.hull)
    speed = config.operating_point.speed_mps / reference.operating_point.speed_mps
    return VehicleScale(
        time=length / speed,
        leg=max(1.0, length / speed, 1.0 / speed),
        length=length,
        thrust_pct=round(100.0 * config.operating_point.thrust_fraction, 1),
        planes={
            plane: _plane_scale(prior, reference_prior, plane, length / speed) for plane in Plane
        },
    )


def _plane_scale(
    prior: DesignPrior, reference: DesignPrior, plane: Plane, time: float
) -> PlaneScale:
    """Return the ratios of one plane."""
    vehicle, reference_vehicle = prior.vehicle(prior.mean), reference.vehicle(reference.mean)
    angle = scale(prior, plane) / scale(reference, plane)
    frequency = crossover.highest_feasible_radps(vehicle, plane) / crossover.highest_feasible_radps(
        reference_vehicle, plane
    )
    return PlaneScale(
        moment=inverse_inertia(reference_vehicle, plane)
        / inverse_inertia(vehicle, plane)
        * min(1.0, 1.0 / angle),
        frequency=frequency,
        step_size=angle / time**2,
        sweep_size=angle * frequency**2,
        max_size_deg=float(np.degrees(design_priors.available_travel_rad(prior, plane))),
        loop_on=PLANES[plane].is_yaw and _turns_on(vehicle),
    )


def _turns_on(vehicle: CandidateVehicle) -> bool:
    """Return whether a turn of the vehicle can go on against its rudder."""
    travel_rad = math.radians(vehicle.config.tailcone.travel_deg)
    turn = steady_state.steady_turn(vehicle.config, vehicle.model, travel_rad)
    return math.isfinite(turn.controlled_radps)


def inverse_inertia(vehicle: CandidateVehicle, plane: Plane) -> float:
    """Return the angular acceleration per moment (1/(kg m2)) of yaw or pitch.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle with its mass matrix.
    plane : Plane
        Plane.

    Returns
    -------
    float
        Diagonal element of the inverse of the mass matrix with added mass.
    """
    row = PLANES[plane].velocities[2]
    return float(np.linalg.inv(vehicle.model.inertia.M)[row, row])
