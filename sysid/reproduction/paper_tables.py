"""The numbers printed in the paper's Tables 1-5, as data.

Source: "Modeling and Control of an Odyssey III AUV through System Identification Tests" (MIT Sea
Grant AUV Laboratory). Axes of Table 1: body x forward, y port, z up. Gains of Table 3: radians in
and out, depth in metres."""

from typing import NamedTuple

CRUISE_SPEED_MPS = 1.3
MASS_KG = 637.0
"""Weight 22 N (5 lb) under the buoyancy of the displaced volume; the paper does not print it."""
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
)
TABLE_1_ADJUSTED = Table1Column(
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
"""Angular acceleration per radian of duct of the first-principles vehicle, which Table 3's initial
gains are for."""

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
"""Upper pole of the dominant pair, rad/s, by (loop, model/controller): I initial, A adjusted or
improved."""


class SteadyError(NamedTuple):
    """One column of Table 5, each a plus-or-minus band."""

    heading_deg: float
    pitch_deg: float
    depth_m: float


TABLE_5_INITIAL = SteadyError(2.5, 10.0, 0.5)
TABLE_5_IMPROVED = SteadyError(2.0, 2.5, 0.1)
