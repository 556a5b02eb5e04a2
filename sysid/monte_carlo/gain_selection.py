"""Redesign of a campaign, compared with the first gains by rehearsal on the identified model.

The first gains of a vehicle are designed from its file and can already be good, or more aggressive
than the specification permits on the identified vehicle. Each candidate is therefore flown in
simulation beside the first gains: the straight run, on vehicles sampled from the model, with the
same disturbance and sensor noise for both. The comparison contains what the prediction of a design
leaves out: sensor errors, estimator and reference models.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from msgspec.structs import replace

from mavlink_io.mission_items import MissionItem
from sitl.vehicle.config import VehicleConfig
from sysid.design import pid
from sysid.design.pid import Design, DesignInfeasibleError, Spec
from sysid.design.specification import RELAXED_LIMITS
from sysid.models.json_record import JsonRecord
from sysid.models.model_file import IdentifiedModel
from sysid.monitor import tracking_metrics
from sysid.monte_carlo import study
from sysid.monte_carlo.study import SimulationSummary, StudyRequest
from sysid.reproduction.paper_tables import TABLE_3_INITIAL
from sysid.test_design import prior as design_priors

SETTLING_FACTORS = (1.0, 2.0, 4.0)
"""Factors on the time in which a constant load must be compensated.

A larger one is tried where no gains are feasible with the smaller ones: a slow tailcone bounds the
bandwidth of the depth loop."""
REHEARSED_VEHICLES, SEED = 8, 1
"""Number of sampled vehicles that are flown with each set of gains, and seed of the samples."""
CLEARLY_BETTER = 0.97
"""Ratio of errors to those of the first gains up to which a candidate is taken at once.

In single dives the ratio scatters by 1 to 9 % about its median."""
FIRST, CANDIDATE = "first", "candidate"


class GainSelection(JsonRecord, frozen=True):
    """Comparison of redesigned and first gains in simulated straight runs of the model."""

    kept_first: bool
    """Whether the first gains were kept."""
    heading_ratio: float | None
    """Heading error of the chosen gains over that of the first ones, medians of 95 % bounds; None
    if the chosen gains fail in simulation."""
    depth_ratio: float | None
    reason: str
    """Why the first gains or lower limits were chosen; empty if nothing had to be given up."""


class SelectionRequest(NamedTuple):
    """Model, limits and first gains of a campaign."""

    model: IdentifiedModel
    spec: Spec
    prior: VehicleConfig
    """Vehicle file from which the model was fitted."""
    first: Mapping[str, float]
    """All parameters of the first dives, without trims."""
    items: tuple[MissionItem, ...]
    """Mission that is rehearsed."""
    settling_s: float = tracking_metrics.SETTLING_S
    """Time (s) after a change of set-point from which on its errors count."""


class _Candidate(NamedTuple):
    """Design with its errors in the rehearsal, relative to those of the first gains."""

    design: Design
    heading: float
    depth: float
    failure: str = ""
    """How the gains fail in simulation, without a subject; the ratios are infinite then."""

    @property
    def worst(self) -> float:
        """Larger one of both ratios."""
        return max(self.heading, self.depth)


def select(request: SelectionRequest) -> tuple[Design, GainSelection]:
    """Return the design with the strictest limits that is better than the first gains.

    Parameters
    ----------
    request : SelectionRequest
        Model, limits and first gains.

    Returns
    -------
    design : Design
        Redesigned gains. The first gains themselves, if no candidate holds both heading and depth
        at least as well as they do and they meet the last of `RELAXED_LIMITS`.
    selection : GainSelection
        Comparison with the first gains.

    Raises
    ------
    DesignInfeasibleError
        No gains meet the last limits.
    """
    candidates: list[_Candidate] = []
    infeasible: DesignInfeasibleError | None = None
    initial = {name: request.first[name] for name in TABLE_3_INITIAL}
    last_spec = replace(request.spec, **RELAXED_LIMITS[-1])
    for factor in SETTLING_FACTORS:
        settling_s = factor * request.spec.integral_settling_s
        for limits in ({}, *RELAXED_LIMITS):
            spec = replace(request.spec, integral_settling_s=settling_s, **limits)
            try:
                design = pid.redesign(request.model, spec, request.prior, initial)
            except DesignInfeasibleError as error:
                infeasible = error
                continue
            candidates.append(_rehearse(request, design))
            if candidates[-1].worst <= CLEARLY_BETTER:
                return _selection(candidates[-1], request.spec)
        if candidates:
            break
    best = min(candidates, key=lambda candidate: candidate.worst, default=None)
    if best is not None and best.worst <= 1.0:
        return _selection(best, request.spec)
    try:
        kept = pid.keep(request.model, request.first, last_spec, request.prior)
    except DesignInfeasibleError:
        if not candidates:
            assert infeasible is not None, "a design that is feasible is a candidate"
            raise infeasible from None
        return _selection(candidates[0], request.spec)
    return kept, GainSelection(
        kept_first=True, heading_ratio=1.0, depth_ratio=1.0, reason="; ".join(_kept_reasons(best))
    )


def _selection(candidate: _Candidate, spec: Spec) -> tuple[Design, GainSelection]:
    """Return a candidate with its comparison."""
    return candidate.design, GainSelection(
        kept_first=False,
        heading_ratio=None if candidate.failure else candidate.heading,
        depth_ratio=None if candidate.failure else candidate.depth,
        reason="; ".join(_reasons(candidate, spec)),
    )


def _reasons(candidate: _Candidate, spec: Spec) -> Iterator[str]:
    """Yield why these gains were chosen; nothing for the usual case."""
    met = candidate.design.spec
    if met.pm_deg < spec.pm_deg:
        yield (
            f"limits GM {met.gm_db:g} dB, PM {met.pm_deg:g} deg, damping {met.damping:g}: no gains"
            " within stricter ones hold heading and depth as well as the first gains"
        )
    if met.integral_settling_s > spec.integral_settling_s:
        yield (
            f"a constant load is compensated in {met.integral_settling_s:g} s: no gains do so in"
            f" {spec.integral_settling_s:g} s"
        )
    if candidate.failure:
        yield f"these gains {candidate.failure}, and the first gains lack the required margins"
    elif candidate.worst > 1.0:
        yield (
            "the first gains hold"
            f" {' and '.join(_worse(candidate))} better, but without the required margins"
        )


def _kept_reasons(best: _Candidate | None) -> Iterator[str]:
    """Yield why the first gains were kept."""
    yield "the first gains are kept"
    if best is None:
        yield "no gains meet the specification and hold both heading and depth better"
    elif best.failure:
        yield f"redesigned ones within the limits {best.failure}"
    else:
        yield f"redesigned ones within the limits hold {' and '.join(_worse(best))} worse"


def _worse(candidate: _Candidate) -> list[str]:
    """Return the quantities that a candidate holds worse than the first gains."""
    ratios = {"heading": candidate.heading, "depth": candidate.depth}
    return [f"{name} ({ratio:.2f} times)" for name, ratio in ratios.items() if ratio > 1.0]


def _rehearse(request: SelectionRequest, design: Design) -> _Candidate:
    """Fly the first gains and a design on the same sampled vehicles and disturbances.

    A design that fails more often than the first gains has infinite errors and a failure in words.
    """
    posterior = design_priors.from_model(request.model, request.prior)
    first, redesigned = study.simulate_samples(
        posterior,
        StudyRequest(
            items=request.items,
            gains={FIRST: request.first, CANDIDATE: {**request.first, **design.gains}},
            vehicles=REHEARSED_VEHICLES,
            seed=SEED,
            settling_s=request.settling_s,
        ),
    )
    return _compare(design, first, redesigned)


def _compare(design: Design, first: SimulationSummary, redesigned: SimulationSummary) -> _Candidate:
    """Return a design with its errors relative to those of the first gains, or its failure."""
    failure = _failure(first, redesigned)
    if failure:
        return _Candidate(design, float("inf"), float("inf"), failure)
    return _Candidate(
        design, _ratio(first, redesigned, "heading_deg"), _ratio(first, redesigned, "depth_m")
    )


def _failure(first: SimulationSummary, redesigned: SimulationSummary) -> str:
    """Return how the redesigned gains fail; empty if not more often than the first ones."""
    if redesigned.failed > first.failed:
        failures = {
            **{f"{name} not held": count for name, count in redesigned.diverged.items()},
            **redesigned.failsafes,
            "came through the surface": redesigned.broached,
        }
        counts = ", ".join(f"{name}: {count}" for name, count in failures.items() if count)
        return (
            f"fail in {redesigned.failed} of {redesigned.vehicles} simulated runs ({counts}), the"
            f" first gains in {first.failed or 'none'}"
        )
    return "" if redesigned.heading_deg else "do not settle in any simulated run"


def _ratio(first: SimulationSummary, redesigned: SimulationSummary, name: str) -> float:
    """Return the ratio of median errors; 0 if the first gains have none, because no leg settles."""
    errors = [getattr(summary, name) for summary in (redesigned, first)]
    return float(errors[0].median / errors[1].median) if errors[1] is not None else 0.0
