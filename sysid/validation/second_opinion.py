"""Second opinion on a model: its response about crossover by other methods, beside its intervals.

* Frequency response: measured over simulated rate of the sweeps, times the model's response, with
  the coherence (`frequency_response`).
* ARX: the same least-squares estimate on measured and on simulated rates; their quotient, times the
  model's response. The estimate uses neither the model's structure nor its prior. Its standard
  deviation is the scatter between tests (jackknife): the residuals are not white.
* python-control: the model's linear plane behind its tailcone, evaluated by python-control.
"""

import math
from collections.abc import Sequence
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis.loop_transfer import GRID_RADPS, Lag
from sysid.estimation.map import steady_state
from sysid.planes import Plane
from sysid.validation import arx, crossover, frequency_response
from sysid.validation.arx import ArxFit, Record
from sysid.validation.crossover import UncertainVehicle
from sysid.validation.frequency_response import Pair
from sysid.validation.results import Opinion, SecondOpinion

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

FREQUENCIES = (0.5, 1.0, 2.0)
"""Frequencies relative to the crossover."""
DB_PER_UNIT = 20.0 / math.log(10.0)
"""Decibel per relative change of a magnitude."""
JOINT_LEVEL = 0.95
"""Probability with which all comparisons of a plane agree if the model is right."""
MIN_TESTS = 5
"""Smallest number of tests whose scatter gives the standard deviation of an ARX estimate."""
EVALUATION_DB, EVALUATION_DEG = 0.05, 0.5
"""Largest difference of two evaluations of the same linear plane."""


class ComparedTest(NamedTuple):
    """One test with measured and simulated rate, at ``RATE_HZ``."""

    command_rad: Array
    measured_radps: Array
    simulated_radps: Array


class _Reference(NamedTuple):
    """Response of the model at the frequencies, with standard deviations."""

    frequency_radps: Array
    gain_db: Array
    phase_deg: Array
    gain_sd_db: Array
    phase_sd_deg: Array


def compare(
    uncertain: UncertainVehicle,
    plane: Plane,
    tests: Sequence[ComparedTest],
    swept: Sequence[Pair],
    crossover_radps: float,
) -> SecondOpinion:
    """Compare the model's response about crossover with those of other methods.

    Parameters
    ----------
    uncertain : UncertainVehicle
        Vehicle and its uncertainty.
    plane : Plane
        Plane.
    tests : Sequence of ComparedTest
        All tests of the plane.
    swept : Sequence of Pair
        Rates of the tests whose signals sweep over frequency; may be empty.
    crossover_radps : float
        Crossover frequency (rad/s).

    Returns
    -------
    SecondOpinion
        Responses of all methods, and the differences beyond the common intervals.
    """
    reference = _reference(uncertain, plane, crossover_radps)
    with np.errstate(all="ignore"):  # rates of zero; such opinions are left out below
        all_opinions = (
            _by_frequency_response(reference, swept),
            _by_arx(reference, tests),
            _by_python_control(reference, uncertain, plane),
        )
    opinions = [opinion for opinion in all_opinions if opinion is not None and _is_finite(opinion)]
    known = uncertain.covariance is not None
    return SecondOpinion(
        frequency_radps=_tuple(reference.frequency_radps),
        gain_db=_tuple(reference.gain_db),
        phase_deg=_tuple(reference.phase_deg),
        gain_sd_db=_tuple(reference.gain_sd_db) if known else None,
        phase_sd_deg=_tuple(reference.phase_sd_deg) if known else None,
        opinions=tuple(opinions),
        differences=tuple(_differences(reference, opinions)),
    )


def _reference(uncertain: UncertainVehicle, plane: Plane, crossover_radps: float) -> _Reference:
    """Return the model's response at the frequencies."""
    frequency_radps = crossover_radps * np.array(FREQUENCIES)
    response = crossover.response(uncertain.vehicle(uncertain.z), plane)
    gain_db, phase_deg = (
        np.interp(frequency_radps, GRID_RADPS, value)
        for value in (20.0 * np.log10(np.abs(response)), np.degrees(np.unwrap(np.angle(response))))
    )
    gain_sd_db, phase_sd_deg = crossover.response_sd(uncertain, plane, frequency_radps)
    return _Reference(frequency_radps, gain_db, phase_deg, gain_sd_db, phase_sd_deg)


def _opinion(
    reference: _Reference,
    ratio: ComplexArray,
    sds: tuple[Array, Array] | None,
    **details: object,
) -> Opinion:
    """Return an opinion from its ratio to the model's response; sds are relative and in rad."""
    return Opinion(
        gain_db=_tuple(reference.gain_db + 20.0 * np.log10(np.abs(ratio))),
        phase_deg=_tuple(reference.phase_deg + np.degrees(np.angle(ratio))),
        gain_sd_db=None if sds is None else _tuple(DB_PER_UNIT * sds[0]),
        phase_sd_deg=None if sds is None else _tuple(np.degrees(sds[1])),
        **{"coherence": None, "order": None, **details},  # type: ignore[arg-type]
    )


def _by_frequency_response(reference: _Reference, swept: Sequence[Pair]) -> Opinion | None:
    """Return the measured response of the sweeps; None without sweeps."""
    if not swept:
        return None
    spectra = frequency_response.spectra(swept, reference.frequency_radps)
    error = spectra.random_error
    return _opinion(
        reference,
        spectra.factor,
        (error, error),
        method="frequency response",
        coherence=_tuple(spectra.coherence),
    )


def _by_arx(reference: _Reference, tests: Sequence[ComparedTest]) -> Opinion | None:
    """Return the ARX estimate; None if the tests do not determine one."""
    measured = [Record(test.command_rad, test.measured_radps) for test in tests]
    simulated = [Record(test.command_rad, test.simulated_radps) for test in tests]
    ours = arx.fit(measured)
    model = arx.fit(simulated, (ours.order,)) if ours else None
    if ours is None or model is None:
        return None

    def ratio(numerator: ArxFit, denominator: ArxFit) -> ComplexArray:
        """Return the quotient of two responses."""
        first, second = (
            arx.response(model, reference.frequency_radps).response
            for model in (numerator, denominator)
        )
        return np.asarray(first / second)

    without_each = [
        ratio(*pair)
        for pair in zip(
            arx.fit_without_each(measured, ours.order),
            arx.fit_without_each(simulated, ours.order),
            strict=False,
        )
    ]
    own_response = arx.response(ours, reference.frequency_radps)
    sds = own_response.magnitude_sd, own_response.phase_sd_rad
    if len(without_each) >= MIN_TESTS:
        sds = _jackknife(np.array(without_each) / ratio(ours, model))
    return _opinion(reference, ratio(ours, model), sds, method="ARX", order=ours.order)


def _jackknife(ratios: ComplexArray) -> tuple[Array, Array]:
    """Return the standard deviations of log magnitude and phase (Efron and Tibshirani 1993, 11.1).

    ``ratios`` (n, frequencies) are the estimates without each test over the whole estimate:
    sd^2 = (n - 1)/n sum_i (x_i - mean x)^2.
    """
    count = len(ratios)
    magnitude, phase = (
        np.sqrt((count - 1.0) / count * np.sum((x - x.mean(axis=0)) ** 2, axis=0))
        for x in (np.log(np.abs(ratios)), np.angle(ratios))
    )
    return magnitude, phase


def _by_python_control(reference: _Reference, uncertain: UncertainVehicle, plane: Plane) -> Opinion:
    """Return the response of the model's linear plane by python-control."""
    import control

    from sysid.control_analysis import control_systems

    vehicle = uncertain.vehicle(uncertain.z)
    actuator = vehicle.actuators[plane]
    lag = Lag(actuator.delay_s, actuator.natural_frequency_radps, actuator.damping_ratio)
    system = control_systems.plant(steady_state.linear_plane(vehicle, plane), lag, {})
    response = control.frequency_response(system, reference.frequency_radps)
    rate = np.asarray(response.complex).reshape(-1, reference.frequency_radps.size)[0]
    nominal = 10.0 ** (reference.gain_db / 20.0) * np.exp(1j * np.radians(reference.phase_deg))
    return _opinion(reference, rate / nominal, None, method="python-control")


def _is_finite(opinion: Opinion) -> bool:
    """Return whether every number of an opinion is finite."""
    numbers = (
        opinion.gain_db,
        opinion.phase_deg,
        opinion.gain_sd_db or (),
        opinion.phase_sd_deg or (),
        opinion.coherence or (),
    )
    return all(math.isfinite(number) for values in numbers for number in values)


def _differences(reference: _Reference, opinions: Sequence[Opinion]) -> list[str]:
    """Return the differences beyond the interval that holds for all comparisons jointly."""
    estimates = sum(opinion.gain_sd_db is not None for opinion in opinions)
    comparisons = max(1, 2 * len(FREQUENCIES) * estimates)
    width = NormalDist().inv_cdf(1.0 - (1.0 - JOINT_LEVEL) / (2.0 * comparisons))
    texts = []
    for opinion in opinions:
        for quantity, unit, values, sds, own, own_sds, exact in (
            (
                "gain",
                "dB",
                opinion.gain_db,
                opinion.gain_sd_db,
                reference.gain_db,
                reference.gain_sd_db,
                EVALUATION_DB,
            ),
            (
                "phase",
                "deg",
                opinion.phase_deg,
                opinion.phase_sd_deg,
                reference.phase_deg,
                reference.phase_sd_deg,
                EVALUATION_DEG,
            ),
        ):
            limits = exact if sds is None else width * np.hypot(np.array(sds), own_sds)
            errors = np.array(values) - own
            texts += [
                f"{opinion.method}: {quantity} at {frequency:.2f} rad/s differs by {error:+.2f}"
                f" {unit}, interval {limit:.2f}"
                for frequency, error, limit in zip(
                    reference.frequency_radps,
                    errors,
                    np.broadcast_to(limits, errors.shape),
                    strict=True,
                )
                if not abs(error) <= limit
            ]
    return texts


def _tuple(values: Array) -> tuple[float, ...]:
    """Return an array as a tuple of floats."""
    return tuple(np.asarray(values, dtype=float).tolist())
