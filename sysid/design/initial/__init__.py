"""Gains for a vehicle that has never been to sea, from her file alone: the prototype controller of
a first dive.

The paper's way: rate feedback with its zero where the tailcone is still quick, and the gain off a
root locus with the tailcone's lag and a Pade delay. The gain is the largest that is damped and
keeps its margins on the vehicle of the file, and keeps hold of nine tenths of the vehicles that the
prior of identification allows for."""

import math
from pathlib import Path
from typing import NamedTuple

from sitl.vehicle import build_model
from sitl.vehicle import config as vehicle_files
from sysid.control_analysis.margins import Analysis
from sysid.design import constraints, pid
from sysid.design.design_model import DesignModel, analyse_loops
from sysid.design.initial import (
    paper_comparison as beside,
)
from sysid.design.initial import (
    prior,
    root_locus,
    vehicle_parameters,
)
from sysid.design.initial.loop_structure import loop_of
from sysid.design.initial.paper_comparison import GainComparison
from sysid.design.initial.prior import LoopMargins, LoopRobustness
from sysid.design.initial.root_locus import LocusPoint
from sysid.design.pid import Loads, Spec, reference_models
from sysid.estimation.map import fit
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

SPEC = Spec(damping=0.5, gm_db=8.0, pm_deg=50.0, ms=1.8)
"""What a loop through the tailcone's whole lag can keep. The lag is undone once it has been
measured."""
TRIM_UNCERTAINTY_RAD = math.radians(2.0)
"""Rudder bias and elevator trim that nobody has measured yet."""


class InitialDesign(NamedTuple):
    """What a first dive sets, and how the loops stand on the vehicle's own linear planes and over
    the prior."""

    parameters: dict[str, float]
    """By parameter name."""
    reasons: dict[str, str]
    analysis: Analysis
    stands: dict[str, LoopMargins]
    """By loop: heading, pitch, depth."""
    held: dict[str, LoopRobustness]
    beside: dict[str, GainComparison]
    """By gain: Table 3's initial one, and why ours differs."""

    def write_params(self, path: Path) -> None:
        """Parameter file: ``NAME,VALUE  # reason``."""
        lines = [
            f"{name},{value:.6g}  # {self.reasons[name]}" for name, value in self.parameters.items()
        ]
        path.write_text(
            "\n".join(["# prototype controller, from the vehicle file", *lines]) + "\n",
            encoding="utf-8",
        )


def design_initial_gains(name_or_path: str | Path) -> InitialDesign:
    """Parameters for a vehicle file.

    Raises:
        VehicleError: the file cannot be used. DesignRefused: no gains meet the specification on
        this vehicle, or too few vehicles of the prior are held.
    """
    vehicle, drawn, found = design_on_root_loci(name_or_path)
    config = vehicle_files.load(name_or_path)
    model, spec = build_model.build(config), SPEC._replace(travel_deg=config.tailcone.travel_deg)
    loads = Loads(fit.level_pitch_rad(config, model), TRIM_UNCERTAINTY_RAD, TRIM_UNCERTAINTY_RAD)
    gains = {**TABLE_3_INITIAL, **found["heading"].gains, **found["depth"].gains}
    gains |= pid.integrator_limits(loads, gains)
    gains |= reference_models.heading(vehicle, gains, loads, spec) | reference_models.depth(
        vehicle, gains, loads, spec
    )
    about = vehicle_parameters.autopilot_parameters(config, model)
    stands = {
        loop: prior.loop_margins(point.shape, point.gains, vehicle) for loop, point in found.items()
    }
    held = {
        loop: prior.loop_robustness(point.shape, point.gains, drawn)
        for loop, point in found.items()
    }
    compared = beside.compare_with_table_3(vehicle, found)
    return InitialDesign(
        parameters={**gains, **{name: value for name, (value, _) in about.items()}},
        reasons={
            **{name: _reason(name, stands, held, compared) for name in gains},
            **{name: why for name, (_, why) in about.items()},
        },
        analysis=analyse_loops(vehicle, gains),
        stands=stands,
        held=held,
        beside=compared,
    )


class RootLocusDesign(NamedTuple):
    """Where the loops ended on their root loci."""

    vehicle: DesignModel
    """As the file gives her."""
    drawn: list[DesignModel]
    """Vehicles of the prior."""
    found: dict[str, LocusPoint]
    """By loop: heading, pitch, depth."""


def design_on_root_loci(name_or_path: str | Path) -> RootLocusDesign:
    """The loops of a vehicle file, without their limits and ways. Raises as
    ``design_initial_gains``."""
    config, bounds = vehicle_files.load(name_or_path), constraints.nominal(SPEC)
    vehicle, drawn = prior.nominal_model(config), list(prior.sample_models(config))
    pitch, depth = root_locus.depth(vehicle, drawn, bounds, math.radians(SPEC.pitch_per_metre_deg))
    heading = root_locus.heading(vehicle, drawn, bounds)
    return RootLocusDesign(vehicle, drawn, {"heading": heading, "pitch": pitch, "depth": depth})


_INTEGRATOR_REASONS = {
    "HDG_IMAX": "a rudder bias of 2 deg that nobody has measured, and 1 deg",
    "PTCH_I": "the depth integrator carries the constant load",
    "PTCH_IMAX": "no pitch integrator",
    "PTCH_FF": "elevator that holds the pitch of a steady climb against the righting moment",
    "DPT_D": "pitch is the rate of depth: the pitch loop is the lead",
    "DPT_IMAX": (
        "the level-flight pitch and a fourth, and 2 deg of elevator that nobody has measured"
    ),
    "HDG_REF_W": "a new heading within the travel that a bias of 2 deg leaves",
    "HDG_REF_RATE": "share of the rate of turn that the free travel holds",
    "DPT_REF_W": "a new depth with little overshoot",
    "DPT_REF_RATE": "share of the speed",
}


def _reason(
    name: str,
    stands: dict[str, LoopMargins],
    held: dict[str, LoopRobustness],
    compared: dict[str, GainComparison],
) -> str:
    if name in _INTEGRATOR_REASONS:
        return _INTEGRATOR_REASONS[name]
    of_table_3 = f"{compared[name].times} times Table 3's"
    if name not in ("HDG_D", "PTCH_D", "DPT_P"):
        return f"{compared[name].why}; {of_table_3}"
    loop = loop_of(name)
    own, low = stands[loop], held[loop]
    return (
        f"{loop} loop: damping {own.damping:.2f}, GM {own.gm_db:.1f} dB, PM {own.pm_deg:.0f} deg;"
        f" on 95 % of the prior {low.damping:.2f}, {low.gm_db:.1f} dB, {low.pm_deg:.0f} deg;"
        f" {of_table_3}"
    )
