"""Limits of a specification and the values that a design reaches, one row per limit."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

LIMITED_CUTS = ("rudder", "heading", "elevator", "depth")
"""Points at which the specification limits margins and sensitivity. The pitch loop alone, opened at
the pitch error without the depth loop, is analysed and reported but not limited."""


class LimitRow(NamedTuple):
    """One limit, and the value that the design reaches."""

    limit: str
    asked: str
    reached: str
    where: str
    """Loop, point or vehicles with the value closest to the limit."""


def rows(design: Mapping[str, Any]) -> list[LimitRow]:
    """Return the limits of a design, which is a result of `summary.summarise_design`."""
    return [
        *_nominal_rows(design["specification"], design["redesigned"]),
        *_robustness_rows(design),
    ]


def format_lines(design: Mapping[str, Any]) -> list[str]:
    """Return the rows as text, with a line about the other limits that the design meets."""
    head = f"  {'':32s}{'asked':>9s}{'reached':>10s}"
    lines = [
        f"  {row.limit:32s}{row.asked:>9s}{row.reached:>10s}  {row.where}".rstrip()
        for row in rows(design)
    ]
    return [head, *lines, f"  other limits met: {describe_other_limits(design['specification'])}"]


def describe_other_limits(spec: Mapping[str, Any]) -> str:
    """Return the limits that every design meets and for which no value is reported, as text."""
    return (
        f"{100 * spec['finish_left']:.0f} % of a constant load left after {spec['finish_s']:g} s,"
        f" {spec['heading_step_deg']:g} deg of heading within {spec['travel_deg']:g} deg of travel,"
        f" {spec['depth_step_m']:g} m of depth with at most {100 * spec['depth_overshoot']:.0f} %"
        f" overshoot, at most {spec['command_noise_deg']:g} deg of noise in a command"
    )


def _nominal_rows(spec: Mapping[str, Any], reached: Mapping[str, Any]) -> Iterator[LimitRow]:
    """Yield the limits on the identified model."""
    loop, damping = min(reached["damping"].items(), key=lambda item: item[1])
    yield LimitRow("damping", f">= {spec['damping']:g}", f"{damping:.2f}", loop)
    margins = {cut: m for cut, m in reached["margins"].items() if cut in LIMITED_CUTS}
    for name, key, digits in (("gain margin, dB", "gm_db", 1), ("phase margin, deg", "pm_deg", 0)):
        values = {cut: m[key] for cut, m in margins.items() if m[key] is not None}
        if values:
            cut, least = min(values.items(), key=lambda item: item[1])
            yield LimitRow(name, f">= {spec[key]:g}", f"{least:.{digits}f}", cut)
    cut, largest = max(((cut, m["ms"]) for cut, m in margins.items()), key=lambda item: item[1])
    yield LimitRow("largest sensitivity", f"<= {spec['ms']:g}", f"{largest:.2f}", cut)


def _robustness_rows(design: Mapping[str, Any]) -> Iterator[LimitRow]:
    """Yield the limits on vehicles sampled from the model."""
    spec, trust = design["specification"], design["trust"]
    limits = (
        f"GM {spec['least_gm_db']:g} dB, PM {spec['least_pm_deg']:g} deg, damping"
        f" {spec['damping']:g}"
    )
    if trust is None:
        yield LimitRow(
            "vehicles that meet it",
            "",
            "",
            f"not known: needs the vehicle file (--prior); {limits}",
        )
        return
    asked, reached = (
        f">= {100 * spec['probability']:.0f} %",
        f"{100 * trust['specification']:.0f} %",
    )
    most = f"; most others miss the {trust['worst']}" if trust["worst"] else ""
    source = f"of {trust['vehicles']} sampled from the model"
    yield LimitRow("vehicles that meet it", asked, reached, f"{source}: {limits}{most}")
    yield LimitRow(
        "vehicles that meet it, relaxed",
        "",
        f"{100 * trust['relaxed']:.0f} %",
        "GM 5 dB, PM 40 deg, damping 0.5",
    )
