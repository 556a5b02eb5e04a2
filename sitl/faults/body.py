"""Faults that change the vehicle herself: weights that come, go or shift, and a propeller that
pushes less."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sitl.faults.catalogue import Fault, FaultError
from sitl.vehicle.model import VehicleModel


def refuse_impossible(model: VehicleModel, faults: Sequence[Fault]) -> None:
    """Weights that leave no vehicle, each by itself or all at once. Raises FaultError."""
    for together in (*((fault,) for fault in faults), faults):
        hurt = apply(model, together)
        if hurt is not None and np.linalg.eigvalsh(hurt.inertia.M_RB).min() <= 0.0:
            masses = ", ".join(
                f"{fault.name} {fault.sizes[0]:g}" for fault in together if fault.unit == "ballast"
            )
            raise FaultError(
                f"mass_kg: {masses}: expected less, of a vehicle of {model.inertia.mass_kg:.4g} kg"
            )


def apply(model: VehicleModel, faults: Sequence[Fault]) -> VehicleModel | None:
    """The model under ``faults``; None where none of them touches it."""
    hurt = model
    for fault in faults:
        if fault.unit == "ballast":
            mass_kg, x_m, y_m, z_m = fault.sizes
            hurt = add_mass(hurt, mass_kg, (x_m, y_m, z_m))
            if fault.kind == "shifted":
                hurt = add_mass(hurt, -mass_kg, (0.0, 0.0, 0.0))
        elif fault.unit == "propeller" and fault.kind == "loss":
            hurt = weaken_propeller(hurt, fault.sizes[0])
    return None if hurt is model else hurt


def add_mass(
    model: VehicleModel, mass_kg: float, place_m: tuple[float, float, float]
) -> VehicleModel:
    """The vehicle with a point mass more at ``place_m``, FLU: weight, centre of mass and inertia.

    The mass matrix of a point at r is m [[I, -S(r)], [S(r), -S(r)^2]] (Fossen 2021, eq. 3.27 for a
    point)."""
    x, y, z = place_m
    S = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    point = mass_kg * np.block([[np.eye(3), -S], [S, -S @ S]])
    inertia, h = model.inertia, model.hydrostatics
    M_RB = inertia.M_RB + point
    M = M_RB + inertia.M_A
    total_kg = inertia.mass_kg + mass_kg
    own = inertia.mass_kg / total_kg
    added = mass_kg / total_kg
    return model._replace(
        inertia=inertia._replace(
            mass_kg=total_kg, M_RB=M_RB, M=M, M_inverse=np.linalg.inv(M).astype(float)
        ),
        hydrostatics=h._replace(
            weight_n=h.weight_n + mass_kg * h.gravity_mps2,
            x_cm_m=own * h.x_cm_m + added * x,
            y_cm_m=own * h.y_cm_m + added * y,
            z_cm_m=own * h.z_cm_m + added * z,
        ),
    )


def weaken_propeller(model: VehicleModel, lost: float) -> VehicleModel:
    """The vehicle with a propeller that pushes ``lost`` of its thrust less at every speed of shaft
    and water."""
    left, propeller = 1.0 - lost, model.propeller
    return model._replace(
        propeller=propeller._replace(
            thrust_nn_kgm=left * propeller.thrust_nn_kgm, thrust_nv_kg=left * propeller.thrust_nv_kg
        )
    )
