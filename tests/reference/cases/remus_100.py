"""REMUS 100 from its dimensions.

Verifies: that the formulas for a user's vehicle give, from geometry alone, the hull, the added mass
and the crossflow drag printed in the thesis. Leaves out: hull lift in a turn and N_rr, which thesis
and formulas define differently; drag, which is a measured value in the vehicle file. Manoeuvres are
compared with the matrix form instead, because the printed crossflow terms of the thesis and those
of its own formula differ by a factor of ten and so do not define the turns. Reference:
T. Prestero, "Verification of a Six-Degree of Freedom Simulation Model for the REMUS Autonomous
Underwater Vehicle", MIT/WHOI, 2001, hull parameters and appendix C; Y_vv with the decimal point
that his own formula gives. Tolerance: 3 %, two printed digits and the difference between his
quadrature and ours; 1 cm for the centre of buoyancy. For the rudder the thesis has two figures,
that printed (9.64 kg/m, about one fin) and that of its own formula rho c S (21.4 kg/m, two fins at
his slope of 3.12): the reference is their mean, and ours must lie between them.
"""

from collections.abc import Iterator
from math import pi

import numpy as np

from sitl.vehicle import config, hull
from tests.reference.check import Check, relative
from tests.sitl.vehicle import flight

PART = 0.03
SOURCE = "Prestero 2001"
Y_UUDR_PRINTED, Y_UUDR_FORMULA = 9.64, 1030 * 3.12 * 6.65e-3
RUDDER_FROM_CB_M = -0.638


def checks() -> Iterator[Check]:
    """Hull, then coefficients."""
    vehicle, model = config.load("remus100"), flight.model("remus100")
    whole = hull.integrals(vehicle.hull)
    yield relative("volume", "m3", whole.volume_m3, 3.15e-2, PART, SOURCE)
    yield relative("frontal area", "m2", whole.frontal_m2, 2.85e-2, PART, SOURCE)
    yield relative("planform", "m2", whole.planform_m2, 2.26e-1, PART, SOURCE)
    yield relative(
        "wetted area, pi x planform", "m2", pi * whole.planform_m2, 7.09e-1, PART, SOURCE
    )
    nose_m = hull.length_m(vehicle.hull) / 2
    yield Check(
        "centre of buoyancy from the nose", "m", nose_m - whole.centroid_m, 0.611, 0.01, SOURCE
    )
    X_udot, Y_vdot, *_, N_rdot = -np.diag(model.inertia.M_A)
    yield relative("X_udot", "kg", X_udot, -0.93, PART, SOURCE)
    yield relative("Y_vdot", "kg", Y_vdot, -35.5, PART, SOURCE)
    yield relative("N_rdot", "kg m2", N_rdot, -4.88, PART, SOURCE)
    yield relative(
        "Y_vv of the hull", "kg/m", -model.stations.drag_kgpm.sum(), -131.0, PART, SOURCE
    )
    middle, half = (Y_UUDR_FORMULA + Y_UUDR_PRINTED) / 2, (Y_UUDR_FORMULA - Y_UUDR_PRINTED) / 2
    linear, U, x = vehicle.linear, vehicle.operating_point.speed_mps, whole.centroid_m
    Y_uudr, N_uudr = linear.Y_dr_nprad / U**2, (linear.N_dr_nmprad - x * linear.Y_dr_nprad) / U**2
    yield Check("Y_uudr", "kg/m", Y_uudr, middle, half, "the thesis' two")
    yield Check(
        "N_uudr about the centre of buoyancy",
        "kg",
        N_uudr,
        RUDDER_FROM_CB_M * middle,
        -RUDDER_FROM_CB_M * half,
        "the thesis' two",
    )
