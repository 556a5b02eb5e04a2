"""Numbers printed in the paper's Tables 1 to 5.

Source: "Modeling and Control of an Odyssey III AUV through System Identification Tests" (MIT Sea
Grant AUV Laboratory). Axes of Table 1: body x forward, y port, z up. Gains of Table 3: angles in
rad, depth in m.
"""

from typing import NamedTuple

CRUISE_SPEED_MPS = 1.3
"""Speed of the linear planes (m/s)."""
MASS_KG = 637.0
"""Mass (kg): weight 22 N (5 lb) below the displaced volume's buoyancy; not printed in the paper."""
GRAVITY_MPS2 = 9.81


class Table1Column(NamedTuple):
    """One column of Table 1, SI units with angles in radians."""

    Y_v: float
    N_v: float
    Y_r: float
    N_r: float
    Y_dr: float
    N_dr: float
    Y_vdot: float
    I_zz: float
    N_rdot: float
    Z_w: float
    M_w: float
    Z_q: float
    M_q: float
    Z_de: float
    M_de: float
    Z_wdot: float
    I_yy: float
    M_qdot: float
    z_CM: float


TABLE_1_INITIAL = Table1Column(
    Y_v=-449,
    N_v=-239,
    Y_r=266,
    N_r=-525,
    Y_dr=251,
    N_dr=-447,
    Y_vdot=-632,
    I_zz=469,
    N_rdot=-458,
    Z_w=-449,
    M_w=239,
    Z_q=-266,
    M_q=-525,
    Z_de=-251,
    M_de=-447,
    Z_wdot=-632,
    I_yy=469,
    M_qdot=-458,
    z_CM=-0.021,
)
TABLE_1_ADJUSTED = Table1Column(
    Y_v=-445,
    N_v=-159,
    Y_r=331,
    N_r=-520,
    Y_dr=264,
    N_dr=-513,
    Y_vdot=-616,
    I_zz=548,
    N_rdot=-458,
    Z_w=-450,
    M_w=157,
    Z_q=-343,
    M_q=-599,
    Z_de=-270,
    M_de=-514,
    Z_wdot=-652,
    I_yy=659,
    M_qdot=-458,
    z_CM=-0.015,
)

UNITS = Table1Column(
    *("kg/s", "kg m/s", "kg m/s", "kg m2/s", "N/rad", "N m/rad", "kg", "kg m2", "kg m2"),  # type: ignore[arg-type]
    *("kg/s", "kg m/s", "kg m/s", "kg m2/s", "N/rad", "N m/rad", "kg", "kg m2", "kg m2", "m"),  # type: ignore[arg-type]
)
"""Unit of each coefficient, by the same names."""


class RateError(NamedTuple):
    """One row of Table 2: average squared rate error, (deg/s)^2 (the paper prints no unit)."""

    initial: float
    adjusted: float


TABLE_2 = {"15 deg rudder": RateError(0.37, 0.11), "15 deg elevator": RateError(7.96, 3.71)}

CARIBOU_TURN_PER_S2 = 0.482
"""Angular acceleration per radian of duct (1/s^2) of the first-principles vehicle.

Table 3's initial gains were designed for this vehicle.
"""

TABLE_3_INITIAL = {
    "HDG_P": 0.65,
    "HDG_D": 1.5,
    "HDG_I": 0.001,
    "HDG_IMAX": 0.01,
    "PTCH_P": 0.8,
    "PTCH_D": 1.9,
    "PTCH_I": 0.0,
    "PTCH_IMAX": 0.0,
    "DPT_P": 0.13,
    "DPT_D": 0.0,
    "DPT_I": 0.001,
    "DPT_IMAX": 0.004,
}
TABLE_3_IMPROVED = {
    "HDG_P": 0.55,
    "HDG_D": 1.35,
    "HDG_I": 0.01,
    "HDG_IMAX": 0.1,
    "PTCH_P": 0.55,
    "PTCH_D": 1.2,
    "PTCH_I": 0.0,
    "PTCH_IMAX": 0.0,
    "DPT_P": 0.12,
    "DPT_D": 0.0,
    "DPT_I": 0.004,
    "DPT_IMAX": 0.05,
}

TABLE_4 = {
    ("heading", "I/I"): -1.0086 + 1.8438j,
    ("heading", "A/I"): -1.0730 + 1.5458j,
    ("heading", "A/A"): -1.2057 + 1.4678j,
    ("pitch", "I/I"): -0.8257 + 1.8075j,
    ("pitch", "A/I"): -0.8941 + 1.4726j,
    ("pitch", "A/A"): -1.1786 + 0.9619j,
    ("depth", "I/I"): -0.7766 + 1.6955j,
    ("depth", "A/I"): -0.8277 + 1.3390j,
    ("depth", "A/A"): -1.1520 + 0.7876j,
}
"""Upper pole of the dominant pair (rad/s), by (loop, model/controller).

I stands for initial, A for the adjusted model or the improved controller.
"""


class SteadyError(NamedTuple):
    """One column of Table 5: half-widths of the error bands."""

    heading_deg: float
    pitch_deg: float
    depth_m: float


TABLE_5_INITIAL = SteadyError(2.5, 10.0, 0.5)
TABLE_5_IMPROVED = SteadyError(2.0, 2.5, 0.1)

TABLE_1_CHANGE_PCT = Table1Column(
    Y_v=-1,
    N_v=-33,
    Y_r=24,
    N_r=-1,
    Y_dr=5,
    N_dr=15,
    Y_vdot=-3,
    I_zz=17,
    N_rdot=0,
    Z_w=0.2,
    M_w=-34,
    Z_q=29,
    M_q=14,
    Z_de=8,
    M_de=15,
    Z_wdot=3,
    I_yy=41,
    M_qdot=0,
    z_CM=-29,
)
"""Printed change of each coefficient (%)."""
ACCELERATION_PER_S2 = {"yaw": -0.51, "pitch": -0.46}
"""Angular acceleration per radian of duct that the paper measured in its steps (1/s^2)."""
