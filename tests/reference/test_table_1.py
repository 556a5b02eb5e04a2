"""Table 1 of the paper, from the nonlinear equations of motion.

Verifies: the linearisation of both shipped vehicles at 1.3 m/s and 58 % thrust. Independent data: the two columns as
printed, typed here again. Tolerance: 1e-6 of each number.
"""

import pytest

from sitl.vehicle import calibrate, config
from sitl.vehicle.linearise import linearise

SYMBOLS = [
    "Y_v_kgps", "N_v_kgmps", "Y_r_kgmps", "N_r_kgm2ps", "Y_dr_nprad", "N_dr_nmprad",
    "Y_vdot_kg", "I_zz_kgm2", "N_rdot_kgm2",
    "Z_w_kgps", "M_w_kgmps", "Z_q_kgmps", "M_q_kgm2ps", "Z_de_nprad", "M_de_nmprad",
    "Z_wdot_kg", "I_yy_kgm2", "M_qdot_kgm2", "z_CM_m",
]  # fmt: skip
INITIAL = [
    -449,
    -239,
    266,
    -525,
    251,
    -447,
    -632,
    469,
    -458,
    -449,
    239,
    -266,
    -525,
    -251,
    -447,
    -632,
    469,
    -458,
    -0.021,
]
ADJUSTED = [
    -445,
    -159,
    331,
    -520,
    264,
    -513,
    -616,
    548,
    -458,
    -450,
    157,
    -343,
    -599,
    -270,
    -514,
    -652,
    659,
    -458,
    -0.015,
]


@pytest.mark.parametrize(("vehicle", "column"), [("bench", INITIAL), ("field", ADJUSTED)])
def test_the_linearised_vehicle_is_table_1(vehicle, column):
    found = linearise(calibrate.build(config.load(vehicle)), 1.3, thrust_fraction=0.58).coefficients
    assert found == pytest.approx(dict(zip(SYMBOLS, column, strict=True)), rel=1e-6)


def linear_planes(c, U):
    """The paper's linear equations written out: (A, B) of yaw (v, r, psi) and pitch (w, q, theta, depth), x_CM = 0."""
    m, g = 640.0, 9.80665
    sway, yaw = m - c["Y_vdot_kg"], c["I_zz_kgm2"] - c["N_rdot_kgm2"]
    heave, pitch = m - c["Z_wdot_kg"], c["I_yy_kgm2"] - c["M_qdot_kgm2"]
    return (
        [
            [c["Y_v_kgps"] / sway, (c["Y_r_kgmps"] - m * U) / sway, 0],
            [c["N_v_kgmps"] / yaw, c["N_r_kgm2ps"] / yaw, 0],
            [0, 1, 0],
        ],
        [[c["Y_dr_nprad"] / sway], [c["N_dr_nmprad"] / yaw], [0]],
        [
            [c["Z_w_kgps"] / heave, (c["Z_q_kgmps"] + m * U) / heave, 0, 0],
            [c["M_w_kgmps"] / pitch, c["M_q_kgm2ps"] / pitch, m * g * c["z_CM_m"] / pitch, 0],
            [0, 1, 0, 0],
            [-1, 0, U, 0],
        ],
        [[c["Z_de_nprad"] / heave], [c["M_de_nmprad"] / pitch], [0], [0]],
    )


@pytest.mark.parametrize(("vehicle", "column"), [("bench", INITIAL), ("field", ADJUSTED)])
def test_the_planes_are_the_papers_linear_equations(vehicle, column):
    found = linearise(calibrate.build(config.load(vehicle)), 1.3, thrust_fraction=0.58)
    A_yaw, B_yaw, A_pitch, B_pitch = linear_planes(dict(zip(SYMBOLS, column, strict=True)), 1.3)
    for matrix, expected in zip((*found.yaw[3:], *found.pitch[3:]), (A_yaw, B_yaw, A_pitch, B_pitch), strict=True):
        for row, wanted in zip(matrix.tolist(), expected, strict=True):
            assert row == pytest.approx(wanted, rel=1e-6, abs=1e-9)
