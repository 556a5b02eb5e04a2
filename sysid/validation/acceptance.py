"""Whether gains may be designed on a model, by gates with names, and the test that would do most
for it.

Thresholds are those of practice: Cramer-Rao bounds below 20 % and insensitivities below 10 % of a
value, coherence above 0.6 and a mismatch cost below 100 (Tischler and Remple 2006, chapters 7, 11
and 12), Theil's coefficient below 0.25 (Jategaonkar 2015, chapter 11); gain and phase at crossover
are to be known to 1 dB and 5 degrees, a sixth of the smallest margins that a redesign aims at."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

import numpy as np

from sysid.data.segments import Plane
from sysid.models.model_file import IdentifiedModel, PlaneModel
from sysid.validation.results import (
    Correction,
    Excess,
    Gate,
    ModelAssessment,
    NextTest,
    PlaneValidation,
)

Sense = Literal["at most", "at least"]

CRAMER_RAO_PERCENT, INSENSITIVITY_PERCENT = 20.0, 10.0
GAIN_DB, PHASE_DEG = 1.0, 5.0
THEIL, COHERENCE, MISMATCH = 0.25, 0.6, 100.0
START_COSTS_PERCENT = 1.0
WHITE_P = 0.01
MAX_EXCESS_OVER_FLOOR = 0.2
"""Share of the floor by which the held-out error may exceed it before it is worth a remark."""
CONFIDENCE_SD = 1.645
"""Standard deviations added to a figure that may not exceed a limit: it holds with 95 %."""
DECISIVE_NUMBER = "b1_per_s2"
"""What any loop's bandwidth rests on. The other numbers count by what they do to gain and phase at
crossover; a share of a delay of nearly nothing, or of a pole near zero, says little."""
OTHER_NUMBERS = ("static_gain_per_s", "p_fast_per_s", "p_slow_per_s", "delay_s")
WAVE_FOR_DYNAMICS, WAVE_FOR_GAIN, WAVE_TO_HOLD_OUT = "chirp", "step", "3211"
SLOW_NUMBERS = ("static gain", "p slow")
LONG_S, SHORT_S = 30.0, 20.0
FAILURES_GATE = "failures of the fit"
DEFAULT_SIZE_DEG = 4.0
"""Where no run tells which size suits the vehicle."""


def assess(model: IdentifiedModel, validation: Mapping[Plane, PlaneValidation]) -> ModelAssessment:
    """Of a model with what its runs say of it."""
    gates = (
        *_of_fit(model),
        *(g for plane in ("yaw", "pitch") for g in _of_plane(model, plane, validation.get(plane))),
    )
    failed = [gate for gate in gates if gate.required and not gate.passed]
    return ModelAssessment(
        fit_for_redesign=not failed,
        reasons=(
            *model.convergence.failures,
            *(format_gate(gate) for gate in failed if gate.name != FAILURES_GATE),
        ),
        gates=gates,
        next_test=_next_test(model, failed, gates),
    )


def format_gate(gate: Gate) -> str:
    """A gate in one line: what, how much, and what would do."""
    where = f"{gate.plane}: " if gate.plane else ""
    value = (
        "not known" if gate.value is None else f"{gate.value:.3g}{gate.unit and ' ' + gate.unit}"
    )
    return (
        f"{where}{gate.name} {value}, {gate.sense} {gate.limit:.3g}{gate.unit and ' ' + gate.unit}"
    )


def _gate(
    name: str,
    plane: Plane | None,
    value: float | None,
    sense: Sense,
    limit: float,
    unit: str = "",
    *,
    required: bool = True,
) -> Gate:
    met = value is not None and (value <= limit if sense == "at most" else value >= limit)
    return Gate(name, plane, value, limit, sense, unit, met, required)


def _of_fit(model: IdentifiedModel) -> Iterator[Gate]:
    found = model.convergence
    apart = [abs(cost / found.cost - 1.0) for cost in found.start_costs] if found.cost > 0.0 else []
    yield _gate(
        "costs of other starts apart by",
        None,
        100.0 * max(apart) if apart else None,
        "at most",
        START_COSTS_PERCENT,
        "%",
    )
    yield _gate("values at a bound", None, float(len(found.at_bounds)), "at most", 0.0)
    yield _gate(FAILURES_GATE, None, float(len(found.failures)), "at most", 0.0)


def _of_plane(
    model: IdentifiedModel, plane: Plane, found: PlaneValidation | None
) -> Iterator[Gate]:
    """A plane without runs, fitted or held out, has one gate for that and none for what they would
    have said."""
    fitted = sum(not run.held_out for run in found.runs) if found else 0
    yield _gate("runs fitted", plane, float(fitted), "at least", 1.0)
    if found and fitted:
        yield from _precision(model, plane)
        yield from _response(plane, found)
    held_out = len(found.runs) - fitted if found else 0
    yield _gate("runs held out", plane, float(held_out), "at least", 1.0)
    if found and found.held_out:
        yield from _held_out(plane, found.held_out, found.correction)


def _response(plane: Plane, found: PlaneValidation) -> Iterator[Gate]:
    crossed = found.crossover
    gain_sd_db, phase_sd_deg = (
        (crossed.gain_sd_db, crossed.phase_sd_deg) if crossed else (None, None)
    )
    yield _gate("gain at crossover, 1 sd", plane, gain_sd_db, "at most", GAIN_DB, "dB")
    yield _gate("phase at crossover, 1 sd", plane, phase_sd_deg, "at most", PHASE_DEG, "deg")
    yield _gate(
        "coherence about crossover", plane, found.coherence_at_crossover, "at least", COHERENCE
    )
    cost = found.overlay.mismatch_cost if found.overlay else None
    yield _gate("mismatch of the response", plane, cost, "at most", MISMATCH)


def _precision(model: IdentifiedModel, plane: Plane) -> Iterator[Gate]:
    numbers = model.planes[plane]
    for name in (DECISIVE_NUMBER, *OTHER_NUMBERS):
        words = (name.rpartition("_per_")[0] or name.removesuffix("_s")).replace("_", " ")
        bound = _cramer_rao_percent(numbers, name)
        decisive = name == DECISIVE_NUMBER
        yield _gate(
            f"{words}, 1 sd", plane, bound, "at most", CRAMER_RAO_PERCENT, "%", required=decisive
        )
        if decisive:
            alone = _insensitivity_percent(model, plane, name)
            yield _gate(
                f"{words}, insensitivity", plane, alone, "at most", INSENSITIVITY_PERCENT, "%"
            )


def _cramer_rao_percent(numbers: PlaneModel, name: str) -> float | None:
    estimate = getattr(numbers, name)
    return (
        100.0 * estimate.sd / abs(estimate.value)
        if estimate.sd is not None and estimate.value
        else None
    )


def _insensitivity_percent(model: IdentifiedModel, plane: Plane, name: str) -> float | None:
    """How far the value alone could move, the plane's others held, for one standard deviation of
    the data."""
    known = model.design.get(plane)
    if known is None:
        return None
    matrix = np.array(known.matrix)
    sds = np.sqrt(np.diag(matrix))
    i = known.names.index(name)
    precision = np.linalg.pinv(matrix / np.outer(sds, sds), hermitian=True)[i, i]
    value = getattr(model.planes[plane], name).value
    return float(100.0 * sds[i] / math.sqrt(precision) / abs(value)) if value else None


def _held_out(plane: Plane, found: Excess, changed: Correction | None) -> Iterator[Gate]:
    better = found.model_mse_deg2ps2 / found.prior_mse_deg2ps2
    chance = CONFIDENCE_SD * (found.excess_sd_deg2ps2 or 0.0) / found.prior_mse_deg2ps2
    yield _gate("held-out error over the prior's", plane, better, "at most", 1.0 + chance)
    yield _gate("Theil's coefficient, held out", plane, found.theil.coefficient, "at most", THEIL)
    yield from _by_held_out(plane, changed)
    above, limit = None, MAX_EXCESS_OVER_FLOOR
    if found.floor_deg2ps2 and found.model_excess_deg2ps2 is not None:
        above = found.model_excess_deg2ps2 / found.floor_deg2ps2
        limit += CONFIDENCE_SD * (found.excess_sd_deg2ps2 or 0.0) / found.floor_deg2ps2
    yield _gate(
        "held-out error above sea and sensors", plane, above, "at most", limit, required=False
    )
    yield _gate(
        "whiteness of held-out innovations, p",
        plane,
        found.whiteness_p,
        "at least",
        WHITE_P,
        required=False,
    )
    types = float(found.new_types)
    yield _gate("held-out runs of a type not fitted", plane, types, "at least", 1.0, required=False)


def _by_held_out(plane: Plane, found: Correction | None) -> Iterator[Gate]:
    """With the doubt at most half the limit, a model that is off by twice the limit passes in 2.5 %
    of cases."""
    gain, gain_sd = (abs(found.gain_db), found.gain_sd_db) if found else (None, None)
    phase, phase_sd = (abs(found.phase_deg), found.phase_sd_deg) if found else (None, None)
    yield _gate("gain at crossover by held-out runs, off by", plane, gain, "at most", GAIN_DB, "dB")
    yield _gate(
        "gain at crossover by held-out runs, 1 sd", plane, gain_sd, "at most", 0.5 * GAIN_DB, "dB"
    )
    yield _gate(
        "phase at crossover by held-out runs, off by", plane, phase, "at most", PHASE_DEG, "deg"
    )
    yield _gate(
        "phase at crossover by held-out runs, 1 sd",
        plane,
        phase_sd,
        "at most",
        0.5 * PHASE_DEG,
        "deg",
    )


def _next_test(
    model: IdentifiedModel, failed: Sequence[Gate], gates: Sequence[Gate]
) -> NextTest | None:
    """For the gate farthest beyond its limit; else for a remark about held-out runs; else for the
    closest gate."""
    worse = [gate for gate in failed if gate.plane]
    remarks = [gate for gate in gates if gate.plane and not gate.required and not gate.passed]
    candidates = worse or remarks or [gate for gate in gates if gate.plane and gate.required]
    worst = max(candidates, key=_relative_violation)
    if worst.plane is None:
        return None
    wave, seconds = _recommended_signal(worst)
    why = (
        format_gate(worst)
        if not worst.passed
        else f"every gate is passed; closest to its limit: {format_gate(worst)}"
    )
    return NextTest(worst.plane, wave, _median_size_deg(model, worst.plane), seconds, why)


def _relative_violation(gate: Gate) -> float:
    """A figure in units of its limit; what is not known strains most."""
    if gate.value is None:
        return math.inf
    over, under = (gate.value, gate.limit) if gate.sense == "at most" else (gate.limit, gate.value)
    return over / under if under > 0.0 else math.inf


def _recommended_signal(gate: Gate) -> tuple[str, float]:
    """Signal and length: a chirp tells of the dynamics about crossover, long steps of what is
    slow."""
    if "held" in gate.name:
        return WAVE_TO_HOLD_OUT, SHORT_S
    if gate.name.startswith(SLOW_NUMBERS):
        return WAVE_FOR_GAIN, LONG_S
    return WAVE_FOR_DYNAMICS, LONG_S


def _median_size_deg(model: IdentifiedModel, plane: Plane) -> float:
    """The median of what was flown and kept, to half a degree."""
    sizes = [abs(run.magnitude_deg) for run in model.screening if run.plane == plane and run.kept]
    return max(0.5, round(2.0 * float(np.median(sizes))) / 2.0) if sizes else DEFAULT_SIZE_DEG
