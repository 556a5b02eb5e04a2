"""Information of a test against the fit of the same run, and criteria."""

import numpy as np
import pytest
from numpy.typing import NDArray

from sysid.estimation.map import datasets, steady_state
from sysid.estimation.map import problem as problems
from sysid.estimation.map.datasets import STEP_S, STRIDE
from sysid.estimation.map.problem import Prior
from sysid.models import noise
from sysid.models.parameters import NAMES
from sysid.planes import PLANES, Plane
from sysid.test_design import closed_loop, information, switching_times
from sysid.test_design import prior as beliefs
from sysid.test_design.prior import DesignPrior
from sysid.test_design.simulate import Manoeuvre, as_run, signal_rad


@pytest.mark.parametrize("plane", Plane)
def test_information_equals_that_of_the_fit(
    bench: DesignPrior, gains: dict[str, float], plane: Plane
) -> None:
    """The fit uses sensitivity equations, the design finite differences of simulations."""
    what = Manoeuvre(plane, "3211", 2.0, 11)
    (ours,) = information.information_of(bench, [what], gains)
    base = bench.vehicle(bench.mean)
    run = as_run(what, beliefs.level_flight(base, plane), signal_rad(what))
    experiments = {plane: (datasets.dataset(run),)}
    prior = Prior(bench.config, bench.biases_rad, bench.mean, bench.covariance)
    levels = {plane: bench.noise[plane]}
    by = problems.filters(base, experiments, levels, STRIDE)
    theirs = problems.score(
        problems.MapProblem(prior, experiments, by, levels, STRIDE), bench.mean
    ).information
    seen = np.sqrt(np.diag(theirs)) > 0.05
    block = np.ix_(seen, seen)
    np.testing.assert_allclose(ours[block], theirs[block], rtol=0.05, atol=0.02 * theirs.max())


def inverse(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.linalg.inv(matrix), np.float64)


def test_information_more_tests_reduce_uncertainty(
    bench: DesignPrior, gains: dict[str, float]
) -> None:
    tests = [Manoeuvre(Plane.YAW, "step", 3.0, 6), Manoeuvre(Plane.YAW, "3211", 3.0, 11)]
    step, pulses = information.information_of(bench, tests, gains)
    known = np.linalg.inv(bench.covariance)
    slope = information.slopes(bench, Plane.YAW)
    alone = [information.numbers(slope, inverse(known + told)) for told in (step, pulses)]
    both = information.numbers(slope, inverse(known + step + pulses))
    for name in both._fields:
        assert getattr(both, name) < min(getattr(numbers, name) for numbers in alone)


def test_information_doubled_size_halves_uncertainty(
    bench: DesignPrior, gains: dict[str, float]
) -> None:
    """Far above the tailcone's play, motion is nearly linear: information grows as size squared."""
    small, large = information.information_of(
        bench, [Manoeuvre(Plane.YAW, "3211", size, 11) for size in (2.0, 4.0)], gains
    )
    b1 = NAMES.index("N_dr")
    assert large[b1, b1] == pytest.approx(4.0 * small[b1, b1], rel=0.25)


@pytest.mark.parametrize("held", [False, True])
def test_superpose_square_wave_equals_sum_of_steps(
    bench: DesignPrior, gains: dict[str, float], held: bool
) -> None:
    """Superposed sensitivities are accurate to a fifth because of play and quadratic drag."""
    digits = np.array([3.0, 1.0, 4.0, 2.0])
    step = Manoeuvre(Plane.YAW, "step", 3.0, 20, loop_on=held)
    wave = step._replace(wave="square", runs=(3, 1, 4, 2))
    of_step, of_wave = information.sensitivities(bench, [step, wave], gains)
    after = -20 * int(switching_times.STEP_HZ) - 1
    summed = switching_times.superpose(
        of_step[after:], switching_times.switch_steps(digits, 20.0), 0
    )
    index = NAMES.index("N_dr")
    ours, theirs = (told[:, :, index] for told in (summed, of_wave[after:]))
    assert np.linalg.norm(ours - theirs) < 0.2 * np.linalg.norm(theirs)


@pytest.mark.parametrize("plane", Plane)
def test_loop_disturbance_without_feedback_is_noise_model(
    bench: DesignPrior, gains: dict[str, float], plane: Plane
) -> None:
    """Without feedback the disturbance is that of the whitening filter: innovations are white."""
    vehicle, level = bench.vehicle(bench.mean), bench.noise[plane]
    nothing = dict.fromkeys(gains, 0.0)
    free = closed_loop.of_vehicle(vehicle, plane, nothing, level)
    rng = np.random.default_rng(3)
    by = noise.build(steady_state.linear_plane(vehicle, plane), level, STEP_S, 300)
    outputs = PLANES[plane].n_outputs
    sds = np.array([level.rate_radps, level.angle_rad, level.depth_m])[:outputs]
    whites = []
    for _ in range(20):
        motion = closed_loop.simulate(
            free, plane, np.zeros(1500), rng.standard_normal((1500, free.feedback.size))
        ).motion
        measured = motion[::STRIDE, :outputs] + sds * rng.standard_normal((300, outputs))
        whites.append(noise.whiten_residual(np.ascontiguousarray(measured), by)[50:])
    assert np.mean(np.square(whites), axis=(0, 1)) == pytest.approx(np.ones(outputs), abs=0.1)
