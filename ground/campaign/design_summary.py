"""What a redesign was asked for beside what it reached, a row a limit: for a terminal and for a
campaign's page."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

LIMITED_CUTS = ("rudder", "heading", "elevator", "depth")
"""Where the specification limits margins and sensitivity. The pitch loop by itself, opened at the
pitch error with no depth loop around it, is analysed and reported but not limited."""


class LimitRow(NamedTuple):
    limit: str
    asked: str
    reached: str
    where: str
    """The loop, cut or vehicles that come closest to the limit."""


def rows(design: Mapping[str, Any]) -> list[LimitRow]:
    """``design``: as ``summary.of_design`` tells it."""
    return [
        *_nominal_rows(design["specification"], design["redesigned"]),
        *_robustness_rows(design),
    ]


def format_lines(design: Mapping[str, Any]) -> list[str]:
    """The rows as lines, and below them what else was held: a design that misses any of it is
    refused."""
    head = f"  {'':32s}{'asked':>9s}{'reached':>10s}"
    lines = [
        f"  {row.limit:32s}{row.asked:>9s}{row.reached:>10s}  {row.where}".rstrip()
        for row in rows(design)
    ]
    return [head, *lines, f"  held besides: {describe_other_limits(design['specification'])}"]


def describe_other_limits(spec: Mapping[str, Any]) -> str:
    """Limits that a design keeps or is refused, of which there is no one figure."""
    return (
        f"a constant load gone but for {100 * spec['finish_left']:.0f} % in {spec['finish_s']:g} s,"
        f" {spec['heading_step_deg']:g} deg of heading within {spec['travel_deg']:g} deg of travel,"
        f" {spec['depth_step_m']:g} m of depth with at most {100 * spec['depth_overshoot']:.0f} %"
        f" beyond it, at most {spec['command_noise_deg']:g} deg of noise in a command"
    )


def _nominal_rows(spec: Mapping[str, Any], reached: Mapping[str, Any]) -> Iterator[LimitRow]:
    loop, damping = min(reached["damping"].items(), key=lambda item: item[1])
    yield LimitRow("damping", f">= {spec['damping']:g}", f"{damping:.2f}", loop)
    margins = {cut: m for cut, m in reached["margins"].items() if cut in LIMITED_CUTS}
    for name, key, digits in (("gain margin, dB", "gm_db", 1), ("phase margin, deg", "pm_deg", 0)):
        found = {cut: m[key] for cut, m in margins.items() if m[key] is not None}
        if found:
            cut, least = min(found.items(), key=lambda item: item[1])
            yield LimitRow(name, f">= {spec[key]:g}", f"{least:.{digits}f}", cut)
    cut, largest = max(((cut, m["ms"]) for cut, m in margins.items()), key=lambda item: item[1])
    yield LimitRow("largest sensitivity", f"<= {spec['ms']:g}", f"{largest:.2f}", cut)


def _robustness_rows(design: Mapping[str, Any]) -> Iterator[LimitRow]:
    spec, trust = design["specification"], design["trust"]
    limits = (
        f"GM {spec['least_gm_db']:g} dB, PM {spec['least_pm_deg']:g} deg, damping"
        f" {spec['damping']:g}"
    )
    if trust is None:
        yield LimitRow(
            "vehicles that keep it",
            "",
            "",
            f"not known: that takes the vehicle's file (--prior); {limits}",
        )
        return
    asked, kept = f">= {100 * spec['probability']:.0f} %", f"{100 * trust['specification']:.0f} %"
    most = f"; most others miss the {trust['worst']}" if trust["worst"] else ""
    of = f"of {trust['vehicles']} that the model allows for"
    yield LimitRow("vehicles that keep it", asked, kept, f"{of}: {limits}{most}")
    yield LimitRow(
        "vehicles that keep it, relaxed",
        "",
        f"{100 * trust['relaxed']:.0f} %",
        "GM 5 dB, PM 40 deg, damping 0.5",
    )
