"""Cell: verdicts on sound and unsound campaigns of plants from outside.

A trial is a sound campaign of a plant (`outside`) and one that is made unsound, whose kind follows
from the seed. A model that passes is redesigned as `ground redesign` does. The gains are then
examined on the true linear plant: they hold if the margins of every loop that a report quotes are
at least those of the sampled vehicles in the specification, 6 dB and 45 deg. A verdict is right if
it passes a model whose redesign holds, or refuses one.
"""

from __future__ import annotations

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from benchmarks.identification import outside
from benchmarks.identification.outside import PRIORS, SOUND, Conditions
from benchmarks.plants import actuators, catalogue, small_signal
from benchmarks.plants.catalogue import Plant
from benchmarks.study import Cell, Figure
from mavlink_io.errors import CaribouError
from sitl.vehicle.config import VehicleConfig
from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import GRID_RADPS, SAMPLING_S, Gains, Responses
from sysid.design import pid
from sysid.design.specification import RELAXED_LIMITS, DesignInfeasibleError, Spec
from sysid.models.model_file import IdentifiedModel
from sysid.planes import PLANES, Plane
from sysid.reproduction.paper_tables import TABLE_3_INITIAL
from tests.sysid.sea import Hold

Array = NDArray[np.float64]

GM_DB, PM_DEG = 6.0, 45.0
HOLD_GAINS = ("HDG_P", "HDG_D", "HDG_I", "PTCH_P", "PTCH_D", "DPT_P", "DPT_I")
"""Parameters of the autopilot in the order of ``Hold``."""
KINDS = ("wrong prior", "slipping tail", "too little excitation", "rough sea")
"""Kinds of unsound campaigns."""
GRIP, SMALL, ROUGH = 0.5, 0.1, 4.0
"""Share of the deflection that is left, size of the tests, and level of the sea."""


def unsound(name: str, kind: int) -> Conditions:
    """Return the conditions of an unsound campaign; ``kind`` is an index of KINDS."""
    names = tuple(PRIORS)
    other = names[(names.index(name) + 1) % len(names)]
    return (
        Conditions(prior_of=other),
        Conditions(grip=GRIP),
        Conditions(size=SMALL),
        Conditions(level=ROUGH),
    )[kind]


def plant_responses(plant: Plant, plane: Plane) -> Responses:
    """Return the true responses of a plane, with the delay of sampling.

    Angle and depth are the integrals of the true motion, in the order of a `LinearPlane`.
    """
    yaw = PLANES[plane].is_yaw
    axis = plant.rudder if yaw else plant.elevator
    rows = small_signal.YAW_STATES if yaw else small_signal.PITCH_STATES
    A, B = small_signal.linearise(plant.body, plant.trim, rows, yaw)
    size = 3 if yaw else 4
    system, drive = np.zeros((size, size)), np.zeros(size)
    system[: len(A), : len(A)], drive[: len(B)] = A, B
    system[2, :] = np.eye(size)[1]
    if not yaw:
        system[3, 0], system[3, 2] = 1.0, -float(plant.trim.state[0])
    s = 1j * GRID_RADPS
    resolvent = np.linalg.inv(s[:, None, None] * np.eye(size) - system)
    tail = actuators.response(axis, GRID_RADPS) * np.exp(-s * SAMPLING_S)
    return Responses(
        PLANES[plane].states, (resolvent @ drive) * tail[:, None], resolvent @ np.eye(size)[1]
    )


def holds(plant: Plant, gains: Gains) -> bool:
    """Return whether every quoted loop has the margins on the true plant."""
    loops = [
        loop
        for plane in Plane
        for loop in loop_transfer.open_loops(plane, plant_responses(plant, plane), gains).values()
    ]
    return all(
        found.gm_db >= GM_DB and found.pm_deg >= PM_DEG
        for found in map(loop_transfer.margins, loops)
    )


def redesigned(model: IdentifiedModel, prior: VehicleConfig, flown: Gains) -> Gains | None:
    """Return the gains of the default limits, or of the next ones; None if both are infeasible."""
    tail = prior.tailcone
    spec = Spec(travel_deg=tail.travel_deg, rate_degps=tail.rate_degps)
    for limits in ({}, RELAXED_LIMITS[0]):
        try:
            return pid.redesign(model, replace(spec, **limits), prior, flown).gains
        except DesignInfeasibleError:
            continue
    return None


def first_gains(hold: Hold) -> Gains:
    """Return the gains of the first dives under the autopilot's names."""
    return {**TABLE_3_INITIAL, **dict(zip(HOLD_GAINS, hold, strict=True))}


def verdict(name: str, seed: int, conditions: Conditions) -> list[float]:
    """Return whether the campaign is passed, and whether its redesign holds on the true plant.

    A refit that is refused, and a model for which no gains are feasible, count as refused.
    """
    try:
        model = outside.identified(name, seed, conditions)
    except CaribouError:
        return [0.0, np.nan]
    prior = outside.case_of(conditions.prior_of or name).prior
    passed = model.assessment is not None and model.assessment.fit_for_redesign
    gains = redesigned(model, prior, first_gains(outside.case_of(name).hold)) if passed else None
    if gains is None:
        return [0.0, np.nan]
    return [1.0, float(holds(catalogue.plant(name, seed), gains))]


def trial(name: str, seed: int) -> list[float]:
    """Return the results of a sound campaign, the kind of the unsound one, and its results."""
    kind = seed % len(KINDS)
    return [
        *verdict(name, seed, SOUND),
        float(kind),
        *verdict(name, seed, unsound(name, kind)),
    ]


def judge(name: str, rows: Array) -> list[Figure]:
    """Return the shares of right verdicts."""
    sound, unsound_ones, kinds = rows[:, :2], rows[:, 3:], rows[:, 2]
    wrong = unsound_ones[:, 1] == 0.0
    return [
        Figure(
            "sound campaigns that are passed, and whose redesign holds",
            100.0 * float(np.mean(sound[:, 1] == 1.0)),
            lowest=90.0,
            unit="%",
        ),
        Figure("sound campaigns that are passed", 100.0 * float(np.mean(sound[:, 0])), unit="%"),
        Figure(
            "unsound campaigns that are refused, or whose redesign holds",
            100.0 * float(np.mean(~wrong)),
            lowest=90.0,
            unit="%",
        ),
        *(
            Figure(
                f"{kind}: refused",
                100.0 * float(np.mean(unsound_ones[kinds == k, 0] == 0.0)),
                unit="%",
            )
            for k, kind in enumerate(KINDS)
            if np.any(kinds == k)
        ),
    ]


VERDICTS = Cell(
    "verdicts",
    "verdicts on sound and unsound campaigns of the same plants",
    trial,
    judge,
    runs=10,
    cases=tuple(PRIORS),
    campaigns=outside.OUTSIDE.campaigns,
)
"""Sound and unsound campaigns: 40 of each."""
