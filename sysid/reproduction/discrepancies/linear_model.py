"""Linearised model of the paper, against the equations of motion.

Axes and symbols are the paper's (x forward, y port, z up).
"""

import numpy as np
from numpy.typing import NDArray

from sysid.models import linear_planes
from sysid.reproduction.discrepancies.record import Discrepancy
from sysid.reproduction.paper_tables import (
    ACCELERATION_PER_S2,
    CRUISE_SPEED_MPS,
    MASS_KG,
    TABLE_1_ADJUSTED,
    TABLE_1_INITIAL,
    Table1Column,
)

EXACT = 1e-9
"""Largest relative difference of equations that agree."""


def places() -> list[Discrepancy]:
    """Return the places with their evidence.

    Returns
    -------
    list of Discrepancy
        In the order of the paper.
    """
    return [*_transfer_function(), _yaw_acceleration(), _measured_accelerations()]


def _yaw_poles(
    c: Table1Column, sway_mass: float, inertia: float, coupling: float
) -> NDArray[np.complex128]:
    """Return the roots of s^2 + a_1 s + a_0 of the printed denominator with x_CM = 0."""
    a_1 = -c.Y_v / sway_mass - c.N_r / inertia
    a_0 = (c.Y_v * c.N_r + coupling) / (sway_mass * inertia)
    return np.asarray(np.sort_complex(np.roots([1.0, a_1, a_0])))


def _transfer_function() -> list[Discrepancy]:
    """Check the denominators and last term of the yaw transfer function."""
    c, U = TABLE_1_INITIAL, CRUISE_SPEED_MPS
    exact = np.sort_complex(np.linalg.eigvals(linear_planes.yaw_plane(c).A[:2, :2]))
    mass, inertia = MASS_KG - c.Y_vdot, c.I_zz - c.N_rdot
    coupling = (MASS_KG * U - c.Y_r) * c.N_v

    def error(poles: NDArray[np.complex128]) -> float:
        """Return the largest distance of the poles (rad/s) from the state space's."""
        return float(np.max(np.abs(poles - exact)))

    right = error(_yaw_poles(c, mass, inertia, coupling))
    no_dots = error(_yaw_poles(c, MASS_KG - c.Y_v, c.I_zz - c.N_r, coupling))
    swapped = error(_yaw_poles(c, mass, inertia, (MASS_KG * U - c.Y_v) * c.N_r))
    steering, limit = c.N_dr / (c.I_zz - c.N_r), c.N_dr / inertia
    note = "distance of the poles from those of the equations of motion: "
    return [
        Discrepancy(
            place="Linearized Model: denominators of the yaw transfer function",
            printed="(m - Y_v) and (I_zz - N_r)",
            reading="(m - Y_vdot) and (I_zz - N_rdot): the dots are lost",
            evidence=(
                f"{note}{no_dots:.3f} rad/s as printed, {right:.0e} as read; N_dr / (I_zz - N_r) is"
                f" {steering:.3f}, where the paper's limit at s = infinity is {limit:.3f} 1/s^2"
            ),
            values={
                "printed_radps": no_dots,
                "read_radps": right,
                "printed_per_s2": steering,
                "limit_per_s2": limit,
            },
            confirmed=right < EXACT < no_dots and abs(steering / limit - 1.0) > 0.05,
        ),
        Discrepancy(
            place="Linearized Model: last term of the yaw transfer function",
            printed="(m U - Y_v) N_r",
            reading="(m U - Y_r) N_v",
            evidence=f"{note}{swapped:.2f} rad/s as printed, {right:.0e} as read",
            values={"printed_radps": swapped, "read_radps": right},
            confirmed=right < EXACT < swapped,
        ),
    ]


def _yaw_acceleration() -> Discrepancy:
    """Check the limit of the yaw transfer function at high frequency."""
    plane = linear_planes.yaw_plane(TABLE_1_INITIAL)
    s = 1e6
    psi = float(np.linalg.solve(s * np.eye(3) - plane.A, plane.B)[2])
    first, second = -s * psi, -s * s * psi
    ratio = TABLE_1_INITIAL.N_dr / (TABLE_1_INITIAL.I_zz - TABLE_1_INITIAL.N_rdot)
    return Discrepancy(
        place="Linearized Model: at s = infinity, phi-dot / delta_r; (I_zz - N_r phi-dot)",
        printed="one dot; N_r phi-dot",
        reading="psi-two-dots / delta_r = N_dr / (I_zz - N_rdot)",
        evidence=(
            f"s times the transfer function tends to {first:.0e}, s^2 times it to {second:.3f};"
            f" N_dr / (I_zz - N_rdot) is {ratio:.3f} 1/s^2"
        ),
        values={"once_per_s": first, "twice_per_s2": second, "ratio_per_s2": ratio},
        confirmed=abs(second - ratio) < 1e-3 and abs(first) < 1e-3,
    )


def _accelerations(c: Table1Column) -> tuple[float, float]:
    """Return N_dr / (I_zz - N_rdot) and M_de / (I_yy - M_qdot) (1/s^2)."""
    return c.N_dr / (c.I_zz - c.N_rdot), c.M_de / (c.I_yy - c.M_qdot)


def _measured_accelerations() -> Discrepancy:
    """Check the angular accelerations -0.51 and -0.46."""
    initial, adjusted = _accelerations(TABLE_1_INITIAL), _accelerations(TABLE_1_ADJUSTED)
    measured = tuple(ACCELERATION_PER_S2.values())
    return Discrepancy(
        place="Vehicle Simulation: r-dot/delta_R = -0.51, q-dot/delta_E = -0.46",
        printed="known from step data",
        reading="ties I_zz and I_yy of the adjusted column to N_dr and M_de, by construction",
        evidence=(
            f"the adjusted column gives {adjusted[0]:.3f} and {adjusted[1]:.3f}, the initial one"
            f" {initial[0]:.3f} and {initial[1]:.3f} 1/s^2"
        ),
        values={
            "adjusted_yaw_per_s2": adjusted[0],
            "adjusted_pitch_per_s2": adjusted[1],
            "initial_yaw_per_s2": initial[0],
            "initial_pitch_per_s2": initial[1],
        },
        confirmed=np.allclose(adjusted, measured, atol=0.005)
        and not np.allclose(initial, measured, atol=0.005),
    )
