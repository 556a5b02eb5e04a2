"""Initial gains for the first dive, from the vehicle file alone.

Method of the paper: rate feedback with a zero below the tailcone's bandwidth, and the loop gain
from a root locus with the tailcone's lag and a Pade delay. The gain is the largest with enough
damping and margins on the nominal vehicle and with nine tenths of the prior's vehicles stable.
"""

import contextlib
import math
from functools import partial
from pathlib import Path
from typing import NamedTuple

from msgspec.structs import replace

from autopilot.control.params import Config
from mavlink_io.user_data_dir import write_output
from sitl.vehicle import build_model
from sitl.vehicle import config as vehicle_files
from sitl.vehicle.config import VehicleConfig
from sysid.control_analysis.margins import Analysis
from sysid.design import constraints, pid
from sysid.design.design_model import DesignModel, analyse_loops
from sysid.design.initial import (
    paper_comparison,
    prior,
    root_locus,
    vehicle_parameters,
)
from sysid.design.initial.loop_structure import LOW_ZEROS, ZEROS, loop_of
from sysid.design.initial.paper_comparison import GainComparison
from sysid.design.initial.prior import LoopMargins, LoopRobustness
from sysid.design.initial.root_locus import LocusPoint, SearchLimits
from sysid.design.pid import DesignInfeasibleError, Loads, Spec, reference_models
from sysid.estimation.map import steady_state
from sysid.reproduction.paper_tables import TABLE_3_INITIAL

__all__ = [
    "SPEC",
    "GainComparison",
    "InitialDesign",
    "LoopMargins",
    "LoopRobustness",
    "RootLocusDesign",
    "design_initial_gains",
    "design_on_root_loci",
]

SPEC = Spec(damping=0.5, gm_db=8.0, pm_deg=50.0, max_sensitivity=1.8)
"""Limits that a loop can meet with the tailcone's full lag.

The lag is compensated only after it has been identified.
"""
RELAXED_SPECS = (
    replace(SPEC, damping=0.45, gm_db=7.0, pm_deg=42.0, max_sensitivity=2.0),
    replace(SPEC, damping=0.4, gm_db=6.0, pm_deg=35.0, max_sensitivity=2.4),
)
"""Limits that are tried in this order for a vehicle on which no gains meet `SPEC`.

An unstable hull or a slow tailcone bounds the margins that any gains reach. The gains of the first
dive need margins until the redesign. Where the last limits are too strict, fewer of the vehicles
sampled from the prior need margins.
"""
REFERENCE_DAMPING = 0.6
"""Damping ratio of the tailcone from which on the damping of the limits is asked for.

Feedback lowers the damping of the tailcone's own mode: one of less damping would hardly permit
any gain. With 0.52 the gains were a fifth of what the margins permit, too little to hold the pitch.
"""
OVERSHOOT_FACTORS = (1.0, 2.0, 4.0, 8.0)
"""Allowed overshoot of a change of depth over that of the limits, tried in this order."""
TRIM_UNCERTAINTY_RAD = math.radians(2.0)
"""Assumed rudder bias and elevator trim before any measurement (rad)."""
MIN_PITCH_GAIN = 2.0 * TRIM_UNCERTAINTY_RAD / Config().pitch_limit_rad
"""Minimum PTCH_P of a pitch loop without integrator.

With it, half of the largest pitch (PTCH_LIM_DEG) commands the elevator that an unmeasured trim
needs. With 0.06 a hull of 1.2 m sank in the dive that measures the trim.
"""


class InitialDesign(NamedTuple):
    """Parameters of the first dive, with the margins of each loop."""

    parameters: dict[str, float]
    """Value by parameter name."""
    reasons: dict[str, str]
    """Reason for each parameter, one line each."""
    analysis: Analysis
    nominal: dict[str, LoopMargins]
    """Margins on the nominal vehicle by loop: heading, pitch, depth."""
    over_prior: dict[str, LoopRobustness]
    """Margins over the prior by loop."""
    comparison: dict[str, GainComparison]
    """Comparison with Table 3's initial column, by gain."""
    spec: Spec
    """Limits that the gains meet: `SPEC`, or the first of `RELAXED_SPECS` that can be met."""

    def write_params(self, path: Path) -> None:
        """Write the parameter file: ``NAME,VALUE  # reason``.

        Parameters
        ----------
        path : Path
            File to write.
        """
        lines = [
            f"{name},{value:.6g}  # {self.reasons[name]}" for name, value in self.parameters.items()
        ]
        write_output(path, "\n".join(["# initial gains, from the vehicle file", *lines]) + "\n")


def design_initial_gains(vehicle_file: str | Path | VehicleConfig) -> InitialDesign:
    """Return the parameters of the first dive for a vehicle file.

    Parameters
    ----------
    vehicle_file : str, Path or VehicleConfig
        Name of a shipped vehicle, path of a vehicle file, or its content.

    Returns
    -------
    InitialDesign
        Parameters with reasons, margins and comparison with the paper.

    Raises
    ------
    VehicleError
        The file cannot be used.
    DesignInfeasibleError
        No gains meet the specification, or too few vehicles of the prior are stable.
    """
    config = _config_of(vehicle_file)
    (vehicle, samples, points), limits = _design_within_limits(config)
    model, tailcone = build_model.build(config), config.tailcone
    spec = replace(limits, travel_deg=tailcone.travel_deg, rate_degps=tailcone.rate_degps)
    level_pitch_rad = steady_state.level_pitch_rad(config, model)
    loads = Loads(level_pitch_rad, TRIM_UNCERTAINTY_RAD, TRIM_UNCERTAINTY_RAD)
    gains = {**TABLE_3_INITIAL, **points["heading"].gains, **points["depth"].gains}
    gains |= _integrator_limits(loads, gains)
    gains |= reference_models.heading(
        vehicle,
        gains,
        loads,
        spec,
        partial(steady_state.steady_turn, config, model),
    )
    gains |= _depth_reference(vehicle, gains, loads, spec)
    vehicle_values = vehicle_parameters.autopilot_parameters(config, model)
    nominal = {
        loop: prior.loop_margins(point.shape, point.gains, vehicle)
        for loop, point in points.items()
    }
    over_prior = {
        loop: prior.loop_robustness(point.shape, point.gains, samples)
        for loop, point in points.items()
    }
    comparison = paper_comparison.compare_with_table_3(vehicle, points)
    return InitialDesign(
        parameters={**gains, **{name: value for name, (value, _) in vehicle_values.items()}},
        reasons={
            **{name: _reason(name, gains, nominal, over_prior, comparison) for name in gains},
            **{name: reason for name, (_, reason) in vehicle_values.items()},
        },
        analysis=analyse_loops(vehicle, gains),
        nominal=nominal,
        over_prior=over_prior,
        comparison=comparison,
        spec=limits,
    )


def _integrator_limits(loads: Loads, gains: dict[str, float]) -> dict[str, float]:
    """Return the integrator limits; that of the pitch loop carries the trim, where it has one."""
    if not gains["PTCH_I"]:
        return pid.integrator_limits(loads, gains)
    limits = pid.integrator_limits(loads._replace(elevator_rad=0.0), gains)
    return {**limits, "PTCH_IMAX": loads.elevator_rad}


def _depth_reference(
    vehicle: DesignModel, gains: dict[str, float], loads: Loads, spec: Spec
) -> dict[str, float]:
    """Return the depth reference, with more overshoot where none has as little as specified."""
    *smaller, largest = (factor * spec.depth_overshoot for factor in OVERSHOOT_FACTORS)
    for overshoot in smaller:
        with contextlib.suppress(DesignInfeasibleError):
            return reference_models.depth(
                vehicle, gains, loads, replace(spec, depth_overshoot=overshoot)
            )
    return reference_models.depth(vehicle, gains, loads, replace(spec, depth_overshoot=largest))


class RootLocusDesign(NamedTuple):
    """Selected points on the root loci."""

    vehicle: DesignModel
    """Nominal vehicle of the file."""
    samples: list[DesignModel]
    """Vehicles sampled from the prior."""
    points: dict[str, LocusPoint]
    """Selected point by loop: heading, pitch, depth."""


def _config_of(vehicle: str | Path | VehicleConfig) -> VehicleConfig:
    """Return the content of a vehicle file."""
    return vehicle if isinstance(vehicle, VehicleConfig) else vehicle_files.load(vehicle)


def _design_within_limits(config: VehicleConfig) -> tuple[RootLocusDesign, Spec]:
    """Return the loop gains with the strictest limits that can be met, and these limits."""
    for spec in (SPEC, *RELAXED_SPECS):
        with contextlib.suppress(DesignInfeasibleError):
            return design_on_root_loci(config, spec), spec
    return design_on_root_loci(config, RELAXED_SPECS[-1], last=True), RELAXED_SPECS[-1]


def design_on_root_loci(
    vehicle_file: str | Path | VehicleConfig,
    spec: Spec = SPEC,
    *,
    last: bool = False,
) -> RootLocusDesign:
    """Return the loop gains of a vehicle file, without integrator limits and reference models.

    Parameters
    ----------
    vehicle_file : str, Path or VehicleConfig
        Name of a shipped vehicle, path of a vehicle file, or its content.
    spec : Spec
        Limits of the loops.
    last : bool
        Whether this is the last attempt: with lower zeros too, and with fewer vehicles of the prior
        that have the minimum margins.

    Returns
    -------
    RootLocusDesign
        Nominal vehicle, sampled vehicles and selected points.

    Raises
    ------
    VehicleError
        The file cannot be used.
    DesignInfeasibleError
        No gains meet the specification, or too few vehicles of the prior are stable.
    """
    config = _config_of(vehicle_file)
    vehicle, vehicles = prior.nominal_model(config), list(prior.sample_models(config))
    bounds = constraints.nominal(spec)
    tail_ratio = min(1.0, config.tailcone.damping_ratio / REFERENCE_DAMPING)
    search_limits = SearchLimits(bounds._replace(damping=tail_ratio * bounds.damping), vehicles)
    if last:
        search_limits = search_limits._replace(
            fraction=prior.MIN_STABLE_FRACTION, zeros=(*ZEROS, *LOW_ZEROS)
        )
    pitch, depth = root_locus.depth(
        vehicle, search_limits, math.radians(spec.pitch_per_metre_deg), MIN_PITCH_GAIN
    )
    heading = root_locus.heading(vehicle, search_limits)
    return RootLocusDesign(vehicle, vehicles, {"heading": heading, "pitch": pitch, "depth": depth})


_INTEGRATOR_REASONS = {
    "HDG_IMAX": "an unmeasured rudder bias of 2 deg, and 1 deg",
    "PTCH_I": "the depth integrator compensates the constant load",
    "PTCH_IMAX": "no pitch integrator",
    "DPT_D": "pitch is the rate of depth: the pitch loop provides the lead",
    "DPT_IMAX": ("the level-flight pitch and a fourth, and 2 deg of unmeasured elevator trim"),
    "HDG_REF_W": "a change of heading within the travel left by a bias of 2 deg",
    "DPT_REF_W": "changes of depth with little overshoot settle soonest",
    **reference_models.REASONS,
}
_PITCH_INTEGRATOR_REASONS = {
    "PTCH_I": "half of the largest pitch would not hold the elevator against an unmeasured trim",
    "PTCH_IMAX": "an unmeasured elevator trim of 2 deg",
    "DPT_IMAX": "the level-flight pitch and a fourth",
}
"""Reasons that differ for a pitch loop with an integrator."""


def _reason(
    name: str,
    gains: dict[str, float],
    nominal: dict[str, LoopMargins],
    over_prior: dict[str, LoopRobustness],
    comparison: dict[str, GainComparison],
) -> str:
    """Return the reason for one parameter, for the parameter file."""
    if gains["PTCH_I"] and name in _PITCH_INTEGRATOR_REASONS:
        return _PITCH_INTEGRATOR_REASONS[name]
    if name in _INTEGRATOR_REASONS:
        return _INTEGRATOR_REASONS[name]
    ratio_to_table_3 = f"{comparison[name].times} times Table 3's"
    if name not in ("HDG_D", "PTCH_D", "DPT_P"):
        return f"{comparison[name].why}; {ratio_to_table_3}"
    loop = loop_of(name)
    margins, low_margins = nominal[loop], over_prior[loop]
    return (
        f"{loop} loop: damping {margins.damping:.2f}, GM {margins.gm_db:.1f} dB,"
        f" PM {margins.pm_deg:.0f} deg; on 95 % of the prior {low_margins.damping:.2f},"
        f" {low_margins.gm_db:.1f} dB, {low_margins.pm_deg:.0f} deg;"
        f" {ratio_to_table_3}"
    )
