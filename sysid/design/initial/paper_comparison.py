"""Comparison of initial gains with Table 3's initial column."""

from collections.abc import Mapping
from typing import NamedTuple

from sysid.control_analysis.loop_transfer import Gains, Lag
from sysid.design.design_model import DesignModel
from sysid.design.initial import prior
from sysid.design.initial.loop_structure import loop_of
from sysid.design.initial.root_locus import LocusPoint
from sysid.reproduction.paper_tables import CARIBOU_TURN_PER_S2, TABLE_3_INITIAL

COMPARED = ("HDG_P", "HDG_D", "HDG_I", "PTCH_P", "PTCH_D", "DPT_P", "DPT_I")
EQUAL_WITHIN = 0.1
"""Relative difference below which gains are called alike."""


class GainComparison(NamedTuple):
    """One gain compared with the paper's."""

    ours: float
    paper: float
    """Table 3's gain, divided by this vehicle's control effectiveness relative to Caribou's."""
    ratio: float
    why: str
    """Reason for the difference."""

    @property
    def times(self) -> str:
        """The ratio as text."""
        return f"{self.ratio:.2f}" if self.ratio < 10.0 else f"{self.ratio:.0f}"


def compare_with_table_3(
    vehicle: DesignModel, points: Mapping[str, LocusPoint]
) -> dict[str, GainComparison]:
    """Return the comparison by gain.

    Parameters
    ----------
    vehicle : DesignModel
        Nominal vehicle.
    points : Mapping
        Selected point on the root locus, by loop.

    Returns
    -------
    dict
        One comparison for each of `COMPARED`.
    """
    paper = dict(TABLE_3_INITIAL)
    for plane, prefix in ((vehicle.planes.yaw, "HDG"), (vehicle.planes.pitch, "PTCH")):
        effectiveness = abs(float(plane.B[1])) / CARIBOU_TURN_PER_S2
        paper |= {
            name: value / effectiveness
            for name, value in TABLE_3_INITIAL.items()
            if name.startswith(prefix)
        }
    comparisons = {}
    for name in COMPARED:
        loop = loop_of(name)
        ours = points[loop].gains[name]
        ratio = ours / paper[name]
        comparisons[name] = GainComparison(
            ours=ours,
            paper=paper[name],
            ratio=ratio,
            why=_explain_difference(name, ratio, vehicle, points[loop], paper),
        )
    return comparisons


def _explain_difference(
    name: str, ratio: float, vehicle: DesignModel, point: LocusPoint, paper: Gains
) -> str:
    """Return the reason why a gain differs from the paper's."""
    if name.endswith("_I"):
        return _integral(name, point.gains, paper)
    if name in ("HDG_P", "PTCH_P"):
        rate = name.replace("_P", "_D")
        zero, paper_zero = point.gains[name] / point.gains[rate], paper[name] / paper[rate]
        return f"with {rate}, whose zero lies at {zero:.2f} rad/s, Table 3's at {paper_zero:.2f}"
    difference = (
        "alike" if abs(ratio - 1.0) < EQUAL_WITHIN else "smaller" if ratio < 1.0 else "larger"
    )
    gains = {
        **point.gains,
        **{gain: paper[gain] for gain in point.shape.free if not gain.endswith("_I")},
    }
    paper_margins = prior.loop_margins(point.shape, gains, vehicle)
    delay_s = _lag(vehicle, point).delay_s
    return (
        f"{difference}: Table 3's would leave damping {paper_margins.damping:.2f},"
        f" {paper_margins.gm_db:.1f} dB and {paper_margins.pm_deg:.0f} deg behind {delay_s:.2f} s"
        " of delay"
    )


def _lag(vehicle: DesignModel, point: LocusPoint) -> Lag:
    """Return the tailcone of the point's plane."""
    return vehicle.yaw_lag if point.shape.loop == "heading" else vehicle.pitch_lag


def _integral(name: str, gains: Gains, paper: Gains) -> str:
    """Return the reason for an integral gain."""
    proportional = name.replace("_I", "_P")
    ours_s, paper_s = gains[proportional] / gains[name], paper[proportional] / paper[name]
    return (
        f"a third of an unmeasured load's largest error is left after {ours_s:.0f} s, with"
        f" Table 3's after {paper_s:.0f} s"
    )
