"""A set of tests for a water time: candidates sized within limits, the most telling ones chosen,
all of it foretold."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis.loop_transfer import Gains
from sysid.data.segments import Plane
from sysid.estimation.map import fit
from sysid.models import linear_planes
from sysid.reproduction.paper_tables import CARIBOU_TURN_PER_S2
from sysid.test_design import (
    candidates as library,
)
from sysid.test_design import (
    crossover,
    dual_axis,
    information,
    paper_baseline,
    selection,
    switching_times,
)
from sysid.test_design import prior as beliefs
from sysid.test_design import (
    safety_margins as excursions,
)
from sysid.test_design.candidates import Lengths
from sysid.test_design.information import CRITERIA, PLANES, DesignUncertainty, Slopes
from sysid.test_design.prior import DesignPrior, available_travel_rad
from sysid.test_design.safety_margins import Excursion, ExcursionLimits, VehicleSample
from sysid.test_design.selection import SizedTest
from sysid.test_design.simulate import Manoeuvre
from sysid.validation.crossover import gains_for

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]

RECOVERY_S = 40.0
"""After a test with its loop off that stays within limits, until the vehicle is back on depth and
course and steady."""
HELD_RECOVERY_S = 30.0
"""After one with its loop on: until she is steady, and the motion before a test with which a run
begins."""
SETTLING_S = 75.0
"""From the surface to the first test of a dive."""
MAX_LOG_GROWTH = 3.0
"""Natural logarithm of what a run's length may make of a small error in a plane that is
unstable."""


class PlanRequest(NamedTuple):
    """What a plan is for."""

    water_s: float = 1200.0
    """Of both dives from the first leg on: settling, tests, recoveries."""
    criterion: str = "d"
    """A key of ``information.CRITERIA``."""
    limits: ExcursionLimits = ExcursionLimits()
    samples: int = 128
    seed: int = 1
    gains: Gains | None = None
    """Of the loops that are aboard, by name as in Table 3; None for those of Caribou's prototype,
    scaled."""
    lengths: Lengths = Lengths()
    recovery_s: float = RECOVERY_S
    held_out: bool = True


class Planned(NamedTuple):
    """One test of a plan."""

    manoeuvre: Manoeuvre
    excursion: Excursion
    share: dict[Plane, float]
    """By which it alone, left out, would widen the crossover phase (ratio of standard deviations,
    less one)."""
    elevator: Excursion | None = None
    """In pitch, of a test of both surfaces; ``excursion`` is then that in yaw."""

    @property
    def excursions(self) -> tuple[Excursion, ...]:
        """Of each plane that is tested."""
        return (self.excursion,) if self.elevator is None else (self.excursion, self.elevator)


class TestPlan(NamedTuple):
    tests: tuple[Planned, ...]
    """To be fitted, in the order in which they are flown."""
    held_out: tuple[Planned, ...]
    """Of another type: to be predicted, and flown in a dive of their own."""
    water_s: float
    crossover_radps: dict[Plane, float]
    before: dict[Plane, DesignUncertainty]
    after: dict[Plane, DesignUncertainty]
    paper: dict[Plane, DesignUncertainty]
    """After the paper's steps of the same water time."""


class PlanInfeasibleError(ValueError):
    """No set of tests fits; the message says what stands in the way."""


class _PlaneKnowledge(NamedTuple):
    """What planning knows of one plane."""

    belief: DesignPrior
    plane: Plane
    gains: Gains
    slopes: Slopes
    samples: list[VehicleSample]
    crossover_radps: float
    nominal_deg: float
    largest_deg: float
    longest_s: float
    lean_rad: float


def plan(belief: DesignPrior, request: PlanRequest, progress: Progress | None = None) -> TestPlan:
    """The tests to fly next.

    Raises:
        PlanRefused, NotHeldError: no test keeps within the limits, or the water time holds too few
        of them.
    """
    report = progress or (lambda what, share: None)
    known = np.asarray(np.linalg.inv(belief.covariance), dtype=np.float64)
    about = {plane: _plane_knowledge(belief, plane, request) for plane in PLANES}
    left = selection.criterion(
        {plane: about[plane].slopes for plane in PLANES}, CRITERIA[request.criterion]
    )
    candidates: list[SizedTest] = []
    held: list[SizedTest] = []
    for number, plane in enumerate(PLANES):
        report(f"{plane}: flying candidates", 0.45 * number)
        candidates += _candidates(about[plane], request, known)
        held += _held_out(about[plane], request)
    report("both surfaces: flying candidates", 0.9)
    candidates += _dual_axis_candidates(about, request)
    report("choosing", 0.95)
    dives = 2 if held else 1
    free_s = request.water_s - dives * SETTLING_S - selection.total_test_time_s(held)
    chosen = selection.select_tests(candidates, known, free_s, left)
    _check_time(chosen, candidates, request, free_s)
    report("done", 1.0)
    return _plan(belief, request, about, known, chosen, held)


def _plane_knowledge(belief: DesignPrior, plane: Plane, request: PlanRequest) -> _PlaneKnowledge:
    mean = belief.vehicle(belief.mean)
    gains = request.gains or gains_for(mean)
    seed = 2 * request.seed + PLANES.index(plane)
    longest_s = max(
        *library.STEPS_S, *(float(seconds) for lengths in request.lengths for seconds in lengths)
    )
    samples = excursions.sample_vehicles(belief, plane, gains, request.samples, longest_s, seed)
    return _PlaneKnowledge(
        belief=belief,
        plane=plane,
        gains=gains,
        slopes=information.slopes(belief, plane),
        samples=samples,
        crossover_radps=crossover.frequency_radps(mean, plane),
        nominal_deg=library.NOMINAL_DEG * scale(belief, plane),
        largest_deg=float(np.degrees(available_travel_rad(belief, plane))),
        longest_s=_max_duration_s(samples, plane),
        lean_rad=beliefs.level_flight(mean, plane).trim_rad if belief.trims_known else 0.0,
    )


def scale(belief: DesignPrior, plane: Plane) -> float:
    """What a degree of Caribou's surface comes to on this vehicle's."""
    linear = fit.linear_plane(belief.vehicle(belief.mean), plane)
    return CARIBOU_TURN_PER_S2 / abs(linear_planes.small_signal(linear).b1_per_s2)


def _max_duration_s(samples: list[VehicleSample], plane: Plane) -> float:
    """How long a run of a vehicle may be whose plane runs away: nine in ten of the samples'."""
    fastest = [
        float(np.max(np.linalg.eigvals(fit.linear_plane(s.vehicle, plane).A).real)) for s in samples
    ]
    return MAX_LOG_GROWTH / max(float(np.quantile(fastest, 0.9)), 1e-3)


def _candidates(at: _PlaneKnowledge, request: PlanRequest, known: Array) -> list[SizedTest]:
    """The library's and the designed ones. A square wave is designed beside the best of the
    library's, flown twice."""
    ready = _size_all(
        at,
        library.candidates(at.plane, at.crossover_radps, at.nominal_deg, request.lengths),
        request,
    )
    left = selection.criterion({at.plane: at.slopes}, CRITERIA[request.criterion])
    if ready:
        best = selection.select_tests(ready, known, 2.0 * max(c.water_s for c in ready), left)
        known = selection.total(best, known)
    designs = [
        switching_times.design_square_wave(
            at.belief,
            shape,
            at.gains,
            at.largest_deg,
            at.samples,
            request.limits,
            left,
            known,
            request.seed,
            3.0 / at.crossover_radps,
        )
        for shape in library.square_waves(at.plane, at.nominal_deg, request.lengths)
        if shape.duration_s <= at.longest_s
    ]
    return ready + _size_all(at, designs, request)


def _dual_axis_candidates(
    about: dict[Plane, _PlaneKnowledge], request: PlanRequest
) -> list[SizedTest]:
    """Each surface as large as its plane allows, and the elevator's share of the rudder one for all
    of them."""
    known = [about[plane] for plane in PLANES]
    shapes = library.dual_axis_tests(
        [at.crossover_radps for at in known], [at.nominal_deg for at in known], request.lengths
    )
    found = [
        [_size_all(at, [half], request) for at, half in zip(known, shape.halves, strict=True)]
        for shape in shapes
    ]
    pairs = [
        (shape, rudder[0], elevator[0])
        for shape, (rudder, elevator) in zip(shapes, found, strict=True)
        if rudder and elevator
    ]
    if not pairs:
        return []
    share = dual_axis.elevator_share(
        [(rudder.manoeuvre, elevator.manoeuvre) for _, rudder, elevator in pairs]
    )
    return [
        _combine_axes(
            about,
            dual_axis.scale_to_limits(shape, rudder.manoeuvre, elevator.manoeuvre, share),
            rudder,
            elevator,
        )
        for shape, rudder, elevator in pairs
    ]


def _combine_axes(
    about: dict[Plane, _PlaneKnowledge], what: Manoeuvre, rudder: SizedTest, elevator: SizedTest
) -> SizedTest:
    """``rudder`` and ``elevator`` are the halves at their largest, of which ``what`` may be
    less."""
    told = [
        information.information_of(about[half.plane].belief, [half], about[half.plane].gains)[0]
        for half in what.halves
    ]
    return SizedTest(what, rudder.excursion, told[0] + told[1], rudder.water_s, elevator.excursion)


def _held_out(at: _PlaneKnowledge, request: PlanRequest) -> list[SizedTest]:
    if not request.held_out:
        return []
    return _size_all(
        at, [library.held_out_test(at.plane, at.crossover_radps, at.nominal_deg)], request
    )


def _size_all(
    at: _PlaneKnowledge, shapes: list[Manoeuvre], request: PlanRequest
) -> list[SizedTest]:
    fit_in = [shape for shape in shapes if shape.duration_s <= at.longest_s]
    found = [
        excursions.max_size_within_limits(
            one, at.largest_deg, at.samples, request.limits, at.lean_rad
        )
        for one in fit_in
    ]
    kept = [one for one in found if one is not None]
    told = information.information_of(at.belief, [manoeuvre for manoeuvre, _ in kept], at.gains)
    return [
        SizedTest(
            manoeuvre, excursion, matrix, manoeuvre.duration_s + recovery_s(manoeuvre, request)
        )
        for (manoeuvre, excursion), matrix in zip(kept, told, strict=True)
    ]


def recovery_s(manoeuvre: Manoeuvre, request: PlanRequest) -> float:
    """Of the leg that follows a test."""
    return min(HELD_RECOVERY_S, request.recovery_s) if manoeuvre.loop_on else request.recovery_s


def _check_time(
    chosen: list[SizedTest], candidates: list[SizedTest], request: PlanRequest, free_s: float
) -> None:
    for plane in PLANES:
        if not any(plane in c.manoeuvre.planes for c in candidates):
            raise PlanInfeasibleError(
                f"{plane}: no test keeps within the limits; widen them, or fly a calmer sea"
            )
        if not any(plane in c.manoeuvre.planes for c in chosen):
            raise PlanInfeasibleError(
                f"water time {request.water_s:.0f} s: leaves {max(free_s, 0.0):.0f} s for tests,"
                f" too little for an opposite pair in {plane}; give more"
            )


def _plan(
    belief: DesignPrior,
    request: PlanRequest,
    about: dict[Plane, _PlaneKnowledge],
    known: Array,
    chosen: list[SizedTest],
    held: list[SizedTest],
) -> TestPlan:
    dives = 2 if held else 1
    slopes: dict[Plane, Slopes] = {plane: about[plane].slopes for plane in PLANES}
    paper = known + information_of_set(
        belief, paper_set(belief, selection.total_test_time_s(chosen)), about["yaw"].gains
    )
    return TestPlan(
        tests=tuple(_planned_test(c, chosen, known, slopes) for c in _order(chosen)),
        held_out=tuple(Planned(c.manoeuvre, c.excursion, {}) for c in held),
        water_s=dives * SETTLING_S + selection.total_test_time_s([*chosen, *held]),
        crossover_radps={plane: about[plane].crossover_radps for plane in PLANES},
        before=_numbers(slopes, known),
        after=_numbers(slopes, selection.total(chosen, known)),
        paper=_numbers(slopes, paper),
    )


def paper_set(belief: DesignPrior, water_s: float) -> list[Manoeuvre]:
    """The paper's steps, sized for the vehicle, that fit into the same water time."""
    return paper_baseline.steps({plane: scale(belief, plane) for plane in PLANES}, water_s)


def information_of_set(belief: DesignPrior, manoeuvres: list[Manoeuvre], gains: Gains) -> Array:
    """Information about z of tests in both planes."""
    told = np.zeros((belief.mean.size, belief.mean.size))
    for plane in PLANES:
        told += sum(
            information.information_of(belief, [m for m in manoeuvres if m.plane == plane], gains),
            np.zeros_like(told),
        )
    return told


def _numbers(slopes: dict[Plane, Slopes], told: Array) -> dict[Plane, DesignUncertainty]:
    covariance = np.asarray(np.linalg.inv(told), dtype=np.float64)
    return {plane: information.numbers(slope, covariance) for plane, slope in slopes.items()}


def _order(chosen: list[SizedTest]) -> list[SizedTest]:
    """Planes by turns, and every second flight of a shape to the other side."""
    flights: list[SizedTest] = []
    groups = [
        sorted((c for c in chosen if c.manoeuvre.plane == p), key=lambda c: c.manoeuvre)
        for p in PLANES
    ]
    for number in range(max(len(group) for group in groups)):
        for group in groups:
            if number < len(group):
                c = group[number]
                again = sum(c.manoeuvre == earlier.manoeuvre for earlier in group[:number])
                flights.append(
                    c._replace(manoeuvre=c.manoeuvre.mirrored if again % 2 else c.manoeuvre)
                )
    return flights


def _planned_test(
    what: SizedTest, chosen: list[SizedTest], known: Array, slopes: dict[Plane, Slopes]
) -> Planned:
    whole = selection.total(chosen, known)
    all_sds, fewer = _numbers(slopes, whole), _numbers(slopes, whole - what.told)
    share = {p: fewer[p].crossover_deg / all_sds[p].crossover_deg - 1.0 for p in PLANES}
    return Planned(what.manoeuvre, what.excursion, share, what.elevator)
