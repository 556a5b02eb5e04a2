"""Table 1 of the source paper.

Verifies: that the linearised equations of motion at 1.3 m/s and 58 % thrust have the coefficients
of both shipped columns, and that the planes equal the paper's linear equations. Leaves out: other
speeds; the correctness of the paper's coefficients. Reference: Table 1, "Initial" and "Adjusted",
typed here again from the paper; its linear equations with x_CM = 0.
Tolerance: 1e-6 of each number, what differences of the equations leave.
"""

from collections.abc import Iterator

import numpy as np

from sitl.vehicle.linearise import LinearPlanes, linearise
from tests.reference.check import Check, relative, worst
from tests.sitl.vehicle import flight

SPEED_MPS, MASS_KG, GRAVITY_MPS2 = 1.3, 640.0, 9.80665
TABLE = {
    "Y_v_kgps": (-449, -445),
    "N_v_kgmps": (-239, -159),
    "Y_r_kgmps": (266, 331),
    "N_r_kgm2ps": (-525, -520),
    "Y_dr_nprad": (251, 264),
    "N_dr_nmprad": (-447, -513),
    "Y_vdot_kg": (-632, -616),
    "I_zz_kgm2": (469, 548),
    "N_rdot_kgm2": (-458, -458),
    "Z_w_kgps": (-449, -450),
    "M_w_kgmps": (239, 157),
    "Z_q_kgmps": (-266, -343),
    "M_q_kgm2ps": (-525, -599),
    "Z_de_nprad": (-251, -270),
    "M_de_nmprad": (-447, -514),
    "Z_wdot_kg": (-632, -652),
    "I_yy_kgm2": (469, 659),
    "M_qdot_kgm2": (-458, -458),
    "z_CM_m": (-0.021, -0.015),
}
"""Symbol with its unit: initial, adjusted."""


def checks() -> Iterator[Check]:
    """Yield the checks of all numbers of both columns, then of the planes."""
    for column, vehicle in enumerate(("caribou_nominal", "caribou_truth")):
        found = linearise(flight.model(vehicle), SPEED_MPS, thrust_fraction=0.58)
        for key, printed in TABLE.items():
            symbol, _, unit = key.rpartition("_")
            value = found.coefficients[key]
            yield relative(
                f"{vehicle}, {symbol}", unit, value, printed[column], 1e-6, "paper, Table 1"
            )
        expected = linear_planes({key: float(printed[column]) for key, printed in TABLE.items()})
        yield worst(
            f"{vehicle}, both planes",
            "SI",
            _stacked(found),
            expected,
            1e-6,
            "paper, linear equations",
        )


def _stacked(found: LinearPlanes) -> list[float]:
    matrices = (found.yaw.A, found.yaw.B, found.pitch.A, found.pitch.B)
    values: list[float] = np.concatenate([m.ravel() for m in matrices]).tolist()
    return values


def linear_planes(c: dict[str, float]) -> list[float]:
    """A and B of yaw (v, r, psi) and of pitch (w, q, theta, depth), row by row, one after the
    other.
    """
    m, g, U = MASS_KG, GRAVITY_MPS2, SPEED_MPS
    sway, yaw = m - c["Y_vdot_kg"], c["I_zz_kgm2"] - c["N_rdot_kgm2"]
    heave, pitch = m - c["Z_wdot_kg"], c["I_yy_kgm2"] - c["M_qdot_kgm2"]
    A_yaw = [
        c["Y_v_kgps"] / sway,
        (c["Y_r_kgmps"] - m * U) / sway,
        0,
        c["N_v_kgmps"] / yaw,
        c["N_r_kgm2ps"] / yaw,
        0,
        0,
        1,
        0,
    ]
    A_pitch = [
        c["Z_w_kgps"] / heave,
        (c["Z_q_kgmps"] + m * U) / heave,
        0,
        0,
        c["M_w_kgmps"] / pitch,
        c["M_q_kgm2ps"] / pitch,
        m * g * c["z_CM_m"] / pitch,
        0,
        0,
        1,
        0,
        0,
        -1,
        0,
        U,
        0,
    ]
    B_yaw = [c["Y_dr_nprad"] / sway, c["N_dr_nmprad"] / yaw, 0]
    B_pitch = [c["Z_de_nprad"] / heave, c["M_de_nmprad"] / pitch, 0, 0]
    return [float(x) for x in (*A_yaw, *B_yaw, *A_pitch, *B_pitch)]
