"""Faults of the rigid body and the propeller: added or shifted ballast, and loss of thrust."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sitl.faults.catalogue import FaultError, ScheduledFault
from sitl.vehicle.model import VehicleModel


def check_feasible(model: VehicleModel, faults: Sequence[ScheduledFault]) -> None:
    """Check that ballast faults, singly and together, leave inertia positive.

    Raises FaultError.
    """
    for combination in (*((fault,) for fault in faults), faults):
        faulted = apply(model, combination)
        if faulted is not None and np.linalg.eigvalsh(faulted.inertia.M_RB).min() <= 0.0:
            masses = ", ".join(
                f"{fault.name} {fault.sizes[0]:g}"
                for fault in combination
                if fault.unit == "ballast"
            )
            raise FaultError(
                f"mass_kg: {masses}: expected less: the vehicle has {model.inertia.mass_kg:.4g} kg"
            )


def apply(model: VehicleModel, faults: Sequence[ScheduledFault]) -> VehicleModel | None:
    """Return the model under ``faults``; None if they do not change it."""
    faulted = model
    for fault in faults:
        if fault.unit == "ballast":
            mass_kg, x_m, y_m, z_m = fault.sizes
            faulted = add_mass(faulted, mass_kg, (x_m, y_m, z_m))
            if fault.kind == "shifted":
                faulted = add_mass(faulted, -mass_kg, (0.0, 0.0, 0.0))
        elif fault.unit == "propeller" and fault.kind == "loss":
            faulted = weaken_propeller(faulted, fault.sizes[0])
    return None if faulted is model else faulted


def add_mass(
    model: VehicleModel, mass_kg: float, position_m: tuple[float, float, float]
) -> VehicleModel:
    """Add a point mass at ``position_m`` (FLU): mass matrix, weight and centre of mass.

    M_RB <- M_RB + m [[I, -S(r)], [S(r), -S(r)^2]] for a mass m (kg) at r (m), where S is the
    cross-product matrix (Fossen 2021, eq. 3.27 for a point); r_CM <- (m0 r_CM + m r) / (m0 + m).
    """
    # Buoyancy and added mass are those of the hull and do not change.
    x, y, z = position_m
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
    """Reduce the thrust by the fraction ``lost`` at every shaft speed and water speed."""
    remaining, propeller = 1.0 - lost, model.propeller
    return model._replace(
        propeller=propeller._replace(
            thrust_nn_kgm=remaining * propeller.thrust_nn_kgm,
            thrust_nv_kg=remaining * propeller.thrust_nv_kg,
        )
    )
