"""Plan of a set of tests: candidates within limits, the best set, and predicted uncertainty."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.errors import ErrorCode, OperationError
from sysid.control_analysis.loop_transfer import Gains
from sysid.estimation.map import steady_state
from sysid.models import linear_planes
from sysid.planes import PLANES, Plane
from sysid.reproduction.paper_tables import CARIBOU_TURN_PER_S2
from sysid.test_design import (
    candidates as candidate_tests,
)
from sysid.test_design import (
    information,
    selection,
    switching_times,
)
from sysid.test_design import prior as design_priors
from sysid.test_design import (
    safety_margins as safety_margins,
)
from sysid.test_design.candidates import Lengths
from sysid.test_design.information import CRITERIA, DesignUncertainty, Slopes
from sysid.test_design.prior import DesignPrior, available_travel_rad
from sysid.test_design.safety_margins import Excursion, ExcursionLimits, VehicleSample
from sysid.test_design.selection import SizedTest
from sysid.test_design.simulate import Manoeuvre
from sysid.validation import crossover

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]
"""Callback with the current step and the completed share."""

RECOVERY_S = 40.0
"""Time (s) after a test with the loop off until the vehicle is steady on depth and course again."""
HELD_RECOVERY_S = 30.0
"""Time (s) after a test with the loop on, including the lead-in of the next run."""
SETTLING_S = 75.0
"""Time (s) from the surface to the first test of a dive."""
MAX_LOG_GROWTH = 3.0
"""Maximum growth of a small error over a run of an unstable plane, as natural logarithm."""
FREE_QUANTILE, HELD_QUANTILE = 0.9, 0.5
"""Quantiles of the samples' growth rates that limit the length of tests with the loop off and on.

With the loop off the vehicle itself diverges, so that nearly every possible vehicle counts. With
the loop on only the simulation of the fit diverges: the vehicle as it most likely is decides."""


class PlanRequest(NamedTuple):
    """Request for a plan."""

    test_time_s: float = 1200.0
    """Total time (s) of both dives from the first leg on: settling, tests, recoveries."""
    criterion: str = "d"
    """Key of ``information.CRITERIA``."""
    limits: ExcursionLimits = ExcursionLimits()
    samples: int = 128
    """Number of vehicles sampled for the safety check."""
    seed: int = 1
    gains: Gains | None = None
    """Current gains of the vehicle by name; None for Caribou's initial ones, scaled."""
    lengths: Lengths = Lengths()
    held_out: bool = True
    """Whether to add validation tests in a second dive."""


class Planned(NamedTuple):
    """One test of a plan."""

    manoeuvre: Manoeuvre
    excursion: Excursion
    share: dict[Plane, float]
    """Relative increase of the crossover phase's standard deviation without this test, by plane."""
    elevator: Excursion | None = None
    """Excursion in pitch of a test of both surfaces; ``excursion`` is then the one in yaw."""

    @property
    def excursions(self) -> tuple[Excursion, ...]:
        """Excursion of each tested plane."""
        return (self.excursion,) if self.elevator is None else (self.excursion, self.elevator)


class TestPlan(NamedTuple):
    """Tests of a plan, and the uncertainty before and after them."""

    tests: tuple[Planned, ...]
    """Tests to fit, in the order of execution."""
    held_out: tuple[Planned, ...]
    """Validation tests of another type, for a second dive."""
    test_time_s: float
    crossover_radps: dict[Plane, float]
    before: dict[Plane, DesignUncertainty]
    after: dict[Plane, DesignUncertainty]
    paper: dict[Plane, DesignUncertainty]
    """Uncertainty after the paper's steps in the same time."""


class PlanInfeasibleError(OperationError):
    """No set of tests fits; the message gives the reason."""

    code = ErrorCode.PLAN_INFEASIBLE


class _PlaneKnowledge(NamedTuple):
    """Everything that planning needs about one plane."""

    prior: DesignPrior
    plane: Plane
    gains: Gains
    slopes: Slopes
    samples: list[VehicleSample]
    crossover_radps: float
    nominal_deg: float
    largest_deg: float
    """Available travel of the surface (deg)."""
    longest_s: float
    """Maximum length of a test with the loop off if the plane may be unstable (s)."""
    longest_held_s: float
    """Maximum length of a test with the loop on (s)."""
    trim_offset_rad: float
    """Known trim of the surface (rad)."""


def plan(prior: DesignPrior, request: PlanRequest, progress: Progress | None = None) -> TestPlan:
    """Select the tests to fly next.

    Parameters
    ----------
    prior : DesignPrior
        Prior of the vehicle.
    request : PlanRequest
        Time, criterion, limits and gains.
    progress : Progress, optional
        Callback for progress.

    Returns
    -------
    TestPlan
        Tests with predicted excursions and uncertainty.

    Raises
    ------
    PlanInfeasibleError
        No test stays within the limits, or the time is too short.
    UnstableLoopError
        The gains stabilise hardly any sampled vehicle.
    """
    report = progress or (lambda what, share: None)
    prior_information = np.asarray(np.linalg.inv(prior.covariance), dtype=np.float64)
    planes = {plane: _plane_knowledge(prior, plane, request) for plane in Plane}
    criterion = selection.criterion(
        {plane: planes[plane].slopes for plane in Plane}, CRITERIA[request.criterion]
    )
    candidates: list[SizedTest] = []
    held_out: list[SizedTest] = []
    for number, plane in enumerate(Plane):
        report(f"{plane}: flying candidates", 0.45 * number)
        candidates += _candidates(planes[plane], request, prior_information)
        held_out += _held_out(planes[plane], request)
    report("both surfaces: flying candidates", 0.9)
    candidates += _dual_axis_candidates(planes, request)
    report("choosing", 0.95)
    dives = 2 if held_out else 1
    free_s = request.test_time_s - dives * SETTLING_S - selection.total_test_time_s(held_out)
    selected = selection.select_tests(candidates, prior_information, free_s, criterion)
    _check_time(selected, candidates, request, free_s)
    report("done", 1.0)
    return _plan(prior, planes, prior_information, selected, held_out)


def _plane_knowledge(prior: DesignPrior, plane: Plane, request: PlanRequest) -> _PlaneKnowledge:
    """Return the data of one plane."""
    mean_vehicle = prior.vehicle(prior.mean)
    gains = request.gains or crossover.gains_for(mean_vehicle)
    seed = 2 * request.seed + PLANES[plane].index
    longest_s = max(
        *candidate_tests.STEPS_S,
        *(float(seconds) for lengths in request.lengths for seconds in lengths),
    )
    samples = safety_margins.sample_vehicles(prior, plane, gains, request.samples, longest_s, seed)
    return _PlaneKnowledge(
        prior=prior,
        plane=plane,
        gains=gains,
        slopes=information.slopes(prior, plane),
        samples=samples,
        crossover_radps=crossover.highest_feasible_radps(mean_vehicle, plane),
        nominal_deg=candidate_tests.NOMINAL_DEG * scale(prior, plane),
        largest_deg=float(np.degrees(available_travel_rad(prior, plane))),
        longest_s=_max_duration_s(samples, plane, FREE_QUANTILE),
        longest_held_s=_max_duration_s(samples, plane, HELD_QUANTILE),
        trim_offset_rad=design_priors.level_flight(mean_vehicle, plane).trim_rad
        if prior.trims_known
        else 0.0,
    )


def scale(prior: DesignPrior, plane: Plane) -> float:
    """Return the surface angle that has the effect of one degree on Caribou (deg/deg)."""
    linear = steady_state.linear_plane(prior.vehicle(prior.mean), plane)
    return CARIBOU_TURN_PER_S2 / abs(linear_planes.small_signal(linear).b1_per_s2)


def _max_duration_s(samples: list[VehicleSample], plane: Plane, quantile: float) -> float:
    """Return the maximum length of a run (s).

    It is `MAX_LOG_GROWTH` over this quantile of the samples' growth rates.
    """
    growth_rates = [
        float(np.max(np.linalg.eigvals(steady_state.linear_plane(sample.vehicle, plane).A).real))
        for sample in samples
    ]
    return MAX_LOG_GROWTH / max(float(np.quantile(growth_rates, quantile)), 1e-3)


def _shortened(lengths: Lengths, free_s: float, held_s: float) -> Lengths:
    """Return lengths of at most ``free_s`` with the loop off and ``held_s`` with it on."""

    def at_most(seconds: Sequence[int], longest_s: float) -> tuple[int, ...]:
        """Return the lengths, each at most the longest, without repetition."""
        return tuple(sorted({min(length, max(1, int(longest_s))) for length in seconds}))

    return Lengths(
        free_s=at_most(lengths.free_s, free_s),
        held_s=at_most(lengths.held_s, held_s),
        both_s=at_most(lengths.both_s, held_s),
        square_s=at_most(lengths.square_s, free_s),
    )


def _fits(shape: Manoeuvre, plane: _PlaneKnowledge) -> bool:
    """Return whether a test is short enough for a plane that may be unstable."""
    return shape.duration_s <= (plane.longest_held_s if shape.loop_on else plane.longest_s)


def _candidates(
    plane: _PlaneKnowledge, request: PlanRequest, prior_information: Array
) -> list[SizedTest]:
    """Return standard tests and designed square waves, at their largest safe size.

    A square wave is designed to add information to the best standard test, flown twice.
    """
    lengths = _shortened(request.lengths, plane.longest_s, plane.longest_held_s)
    sized = _size_all(
        plane,
        candidate_tests.candidates(plane.plane, plane.crossover_radps, plane.nominal_deg, lengths),
        request,
    )
    criterion = selection.criterion({plane.plane: plane.slopes}, CRITERIA[request.criterion])
    if sized:
        selected = selection.select_tests(
            sized, prior_information, 2.0 * max(c.test_time_s for c in sized), criterion
        )
        prior_information = selection.total(selected, prior_information)
    designs = [
        switching_times.design_square_wave(
            switching_times.SquareWaveRequest(
                prior=plane.prior,
                shape=shape,
                gains=plane.gains,
                largest_deg=plane.largest_deg,
                samples=plane.samples,
                limits=request.limits,
                criterion=criterion,
                prior_information=prior_information,
                seed=request.seed,
                shortest_s=3.0 / plane.crossover_radps,
            )
        )
        for shape in candidate_tests.square_waves(plane.plane, plane.nominal_deg, lengths)
        if _fits(shape, plane)
    ]
    return sized + _size_all(plane, designs, request)


def _dual_axis_candidates(
    planes: dict[Plane, _PlaneKnowledge], request: PlanRequest
) -> list[SizedTest]:
    """Return tests of both surfaces, with one ratio of elevator to rudder for all of them."""
    both = [planes[plane] for plane in Plane]
    shapes = candidate_tests.dual_axis_tests(
        [plane.crossover_radps for plane in both],
        [plane.nominal_deg for plane in both],
        _shortened(
            request.lengths,
            min(plane.longest_s for plane in both),
            min(plane.longest_held_s for plane in both),
        ),
    )
    sized = [
        [_size_all(plane, [half], request) for plane, half in zip(both, shape.halves, strict=True)]
        for shape in shapes
    ]
    pairs = [
        (shape, rudder[0], elevator[0])
        for shape, (rudder, elevator) in zip(shapes, sized, strict=True)
        if rudder and elevator
    ]
    if not pairs:
        return []
    share = candidate_tests.elevator_share(
        [(rudder.manoeuvre, elevator.manoeuvre) for _, rudder, elevator in pairs]
    )
    return [
        _combine_axes(
            planes,
            candidate_tests.scale_to_limits(shape, rudder.manoeuvre, elevator.manoeuvre, share),
            rudder,
            elevator,
        )
        for shape, rudder, elevator in pairs
    ]


def _combine_axes(
    planes: dict[Plane, _PlaneKnowledge],
    manoeuvre: Manoeuvre,
    rudder: SizedTest,
    elevator: SizedTest,
) -> SizedTest:
    """Return a test of both surfaces, given its halves at their largest size."""
    information_matrices = [
        information.information_of(planes[half.plane].prior, [half], planes[half.plane].gains)[0]
        for half in manoeuvre.halves
    ]
    return SizedTest(
        manoeuvre=manoeuvre,
        excursion=rudder.excursion,
        information=information_matrices[0] + information_matrices[1],
        test_time_s=rudder.test_time_s,
        elevator=elevator.excursion,
    )


def _held_out(plane: _PlaneKnowledge, request: PlanRequest) -> list[SizedTest]:
    """Return the validation test of a plane at its largest safe size.

    The loop is on if no size stays within the limits with the loop off.
    """
    if not request.held_out:
        return []
    shape = candidate_tests.held_out_test(plane.plane, plane.crossover_radps, plane.nominal_deg)
    return _size_all(plane, [shape], request) or _size_all(
        plane, [shape._replace(loop_on=True)], request
    )


def _size_all(
    plane: _PlaneKnowledge, shapes: list[Manoeuvre], request: PlanRequest
) -> list[SizedTest]:
    """Return the shapes that fit, at their largest safe size."""
    feasible = [shape for shape in shapes if _fits(shape, plane)]
    sized = [
        safety_margins.max_size_within_limits(
            shape, plane.largest_deg, plane.samples, request.limits, plane.trim_offset_rad
        )
        for shape in feasible
    ]
    accepted = [shape for shape in sized if shape is not None]
    matrices = information.information_of(
        plane.prior, [manoeuvre for manoeuvre, _ in accepted], plane.gains
    )
    return [
        SizedTest(
            manoeuvre=manoeuvre,
            excursion=excursion,
            information=matrix,
            test_time_s=manoeuvre.duration_s + recovery_s(manoeuvre),
        )
        for (manoeuvre, excursion), matrix in zip(accepted, matrices, strict=True)
    ]


def recovery_s(manoeuvre: Manoeuvre) -> float:
    """Return the length of the leg after a test.

    Parameters
    ----------
    manoeuvre : Manoeuvre
        Test.

    Returns
    -------
    float
        Length (s).
    """
    return HELD_RECOVERY_S if manoeuvre.loop_on else RECOVERY_S


def _check_time(
    selected: list[SizedTest], candidates: list[SizedTest], request: PlanRequest, free_s: float
) -> None:
    """Raise PlanInfeasibleError if a plane has no candidate or no selected test."""
    for plane in Plane:
        if not any(plane in c.manoeuvre.planes for c in candidates):
            raise PlanInfeasibleError(
                f"{plane}: no test stays within the limits; widen them, or test in calmer water"
            )
        if not any(plane in c.manoeuvre.planes for c in selected):
            raise PlanInfeasibleError(
                f"test time {request.test_time_s:.0f} s: leaves {max(free_s, 0.0):.0f} s for tests,"
                f" too little for an opposite pair in {plane}; increase it"
            )


def _plan(
    prior: DesignPrior,
    planes: dict[Plane, _PlaneKnowledge],
    prior_information: Array,
    selected: list[SizedTest],
    held_out: list[SizedTest],
) -> TestPlan:
    """Return the plan of the selected tests."""
    dives = 2 if held_out else 1
    slopes: dict[Plane, Slopes] = {plane: planes[plane].slopes for plane in Plane}
    paper = prior_information + information_of_set(
        prior, paper_set(prior, selection.total_test_time_s(selected)), planes[Plane.YAW].gains
    )
    return TestPlan(
        tests=tuple(
            _planned_test(c, selected, prior_information, slopes) for c in _order(selected)
        ),
        held_out=tuple(Planned(c.manoeuvre, c.excursion, {}) for c in held_out),
        test_time_s=dives * SETTLING_S + selection.total_test_time_s([*selected, *held_out]),
        crossover_radps={plane: planes[plane].crossover_radps for plane in Plane},
        before=_numbers(slopes, prior_information),
        after=_numbers(slopes, selection.total(selected, prior_information)),
        paper=_numbers(slopes, paper),
    )


def paper_set(prior: DesignPrior, test_time_s: float) -> list[Manoeuvre]:
    """Return the paper's steps that fit into the same time, scaled to the vehicle.

    Parameters
    ----------
    prior : DesignPrior
        Prior of the vehicle.
    test_time_s : float
        Available test time, in seconds.

    Returns
    -------
    list of Manoeuvre
        Steps of both planes.
    """
    return candidate_tests.paper_steps({plane: scale(prior, plane) for plane in Plane}, test_time_s)


def information_of_set(prior: DesignPrior, manoeuvres: list[Manoeuvre], gains: Gains) -> Array:
    """Return the information matrix of tests in both planes."""
    total = np.zeros((prior.mean.size, prior.mean.size))
    for plane in Plane:
        total += sum(
            information.information_of(prior, [m for m in manoeuvres if m.plane == plane], gains),
            np.zeros_like(total),
        )
    return total


def _numbers(slopes: dict[Plane, Slopes], total: Array) -> dict[Plane, DesignUncertainty]:
    """Return the uncertainty of both planes under an information matrix."""
    covariance = np.asarray(np.linalg.inv(total), dtype=np.float64)
    return {plane: information.numbers(slope, covariance) for plane, slope in slopes.items()}


def _order(selected: list[SizedTest]) -> list[SizedTest]:
    """Alternate between planes, and mirror every second execution of a shape."""
    flights: list[SizedTest] = []
    groups = [
        sorted((c for c in selected if c.manoeuvre.plane == p), key=lambda c: c.manoeuvre)
        for p in Plane
    ]
    for number in range(max(len(group) for group in groups)):
        for group in groups:
            if number < len(group):
                c = group[number]
                earlier_flights = sum(
                    c.manoeuvre == earlier.manoeuvre for earlier in group[:number]
                )
                flights.append(
                    c._replace(
                        manoeuvre=c.manoeuvre.mirrored if earlier_flights % 2 else c.manoeuvre
                    )
                )
    return flights


def _planned_test(
    test: SizedTest,
    selected: list[SizedTest],
    prior_information: Array,
    slopes: dict[Plane, Slopes],
) -> Planned:
    """Return a selected test with the effect of leaving it out."""
    total = selection.total(selected, prior_information)
    with_all, without = _numbers(slopes, total), _numbers(slopes, total - test.information)
    share = {p: without[p].crossover_deg / with_all[p].crossover_deg - 1.0 for p in Plane}
    return Planned(
        manoeuvre=test.manoeuvre, excursion=test.excursion, share=share, elevator=test.elevator
    )
