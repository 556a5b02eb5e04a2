"""Limits of a specification and the values that a design reaches, one row per limit."""

from collections.abc import Iterator
from typing import NamedTuple

from ground.campaign.summary_file import DesignSummary, LoopAnalysis
from sysid.design.specification import Spec

INNER_LOOP = "pitch"
"""Loop inside the depth loop. Alone it is never flown, and a design does not limit its damping."""


class LimitRow(NamedTuple):
    """One limit, and the value that the design reaches."""

    limit: str
    asked: str
    reached: str
    where: str
    """Loop, point or vehicles with the value closest to the limit."""


def rows(design: DesignSummary) -> list[LimitRow]:
    """Return the limits of a design, a result of `summary.summarise_design`."""
    return [
        *_nominal_rows(design.specification, design.redesigned),
        *_robustness_rows(design),
    ]


def format_lines(design: DesignSummary) -> list[str]:
    """Return the rows as text, with a line about the other limits that the design meets."""
    head = f"  {'':32s}{'asked':>9s}{'reached':>10s}"
    lines = [
        f"  {row.limit:32s}{row.asked:>9s}{row.reached:>10s}  {row.where}".rstrip()
        for row in rows(design)
    ]
    return [head, *lines, f"  other limits met: {describe_other_limits(design.specification)}"]


def describe_other_limits(spec: Spec) -> str:
    """Return the limits that every design meets and for which no value is reported, as text."""
    return (
        f"{100 * spec.integral_residual:.0f} % of a constant load left after"
        f" {spec.integral_settling_s:g} s,"
        f" {spec.heading_step_deg:g} deg of heading within {spec.travel_deg:g} deg of travel,"
        f" {spec.depth_step_m:g} and {2 * spec.depth_step_m:g} m of depth with at most"
        f" {100 * spec.depth_overshoot * spec.depth_step_m:.0f} cm of overshoot, at most"
        f" {spec.command_noise_deg:g} deg of noise in a command"
    )


def _nominal_rows(spec: Spec, reached: LoopAnalysis) -> Iterator[LimitRow]:
    """Yield the limits on the identified model."""
    flown = {loop: ratio for loop, ratio in reached.damping.items() if loop != INNER_LOOP}
    loop, damping = min(flown.items(), key=lambda item: item[1])
    yield LimitRow(
        limit="damping", asked=f">= {spec.damping:g}", reached=f"{damping:.2f}", where=loop
    )
    if INNER_LOOP in reached.damping:
        yield LimitRow(
            limit="damping of pitch alone",
            asked="",
            reached=f"{reached.damping[INNER_LOOP]:.2f}",
            where="not limited: the depth loop, whose damping is, always acts on pitch",
        )
    margins = reached.margins
    gains = {cut: m.gm_db for cut, m in margins.items() if m.gm_db is not None}
    if gains:
        cut, least = min(gains.items(), key=lambda item: item[1])
        yield LimitRow(
            limit="gain margin, dB", asked=f">= {spec.gm_db:g}", reached=f"{least:.1f}", where=cut
        )
    phases = {cut: m.pm_deg for cut, m in margins.items() if m.pm_deg is not None}
    if phases:
        cut, least = min(phases.items(), key=lambda item: item[1])
        yield LimitRow(
            limit="phase margin, deg",
            asked=f">= {spec.pm_deg:g}",
            reached=f"{least:.0f}",
            where=cut,
        )
    cut = max(margins, key=lambda name: margins[name].max_sensitivity)
    yield LimitRow(
        limit="largest sensitivity",
        asked=f"<= {spec.max_sensitivity:g}",
        reached=f"{margins[cut].max_sensitivity:.2f}",
        where=cut,
    )


def _robustness_rows(design: DesignSummary) -> Iterator[LimitRow]:
    """Yield the limits on vehicles sampled from the model."""
    spec, robustness = design.specification, design.robustness
    limits = f"GM {spec.robust_gm_db:g} dB, PM {spec.robust_pm_deg:g} deg, damping {spec.damping:g}"
    if robustness is None:
        yield LimitRow(
            limit="vehicles that meet it",
            asked="",
            reached="",
            where=f"not known: the model has no covariance; {limits}",
        )
        return
    most = f"; most others miss the {robustness.worst}" if robustness.worst else ""
    source = f"of {robustness.vehicles} sampled from the model"
    yield LimitRow(
        limit="vehicles that meet it",
        asked=f">= {100 * spec.robust_fraction:.0f} %",
        reached=f"{100 * robustness.specification:.0f} %",
        where=f"{source}: {limits}{most}",
    )
    yield LimitRow(
        limit="vehicles that meet it, relaxed",
        asked="",
        reached=f"{100 * robustness.relaxed:.0f} %",
        where="GM 5 dB, PM 40 deg, damping 0.5",
    )
