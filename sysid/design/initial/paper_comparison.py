"""The gains beside Table 3's initial column, with what sets them apart."""

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
"""Gains that differ by less than this share are called alike."""


class GainComparison(NamedTuple):
    ours: float
    paper: float
    """Table 3's, as much weaker as this vehicle's tail is livelier than Caribou's."""
    ratio: float
    why: str

    @property
    def times(self) -> str:
        """The ratio, spelt."""
        return f"{self.ratio:.2f}" if self.ratio < 10.0 else f"{self.ratio:.0f}"


def compare_with_table_3(
    vehicle: DesignModel, loops_of: Mapping[str, LocusPoint]
) -> dict[str, GainComparison]:
    """By gain; ``loops_of``: where each loop ended on its locus."""
    paper = dict(TABLE_3_INITIAL)
    for plane, prefix in ((vehicle.planes.yaw, "HDG"), (vehicle.planes.pitch, "PTCH")):
        livelier = abs(float(plane.B[1])) / CARIBOU_TURN_PER_S2
        paper |= {
            name: value / livelier
            for name, value in TABLE_3_INITIAL.items()
            if name.startswith(prefix)
        }
    found = {}
    for name in COMPARED:
        loop = loop_of(name)
        ours = loops_of[loop].gains[name]
        ratio = ours / paper[name]
        found[name] = GainComparison(
            ours,
            paper[name],
            ratio,
            _explain_difference(name, ratio, vehicle, loops_of[loop], paper),
        )
    return found


def _explain_difference(
    name: str, ratio: float, vehicle: DesignModel, point: LocusPoint, paper: Gains
) -> str:
    if name.endswith("_I"):
        return _integral(name, point.gains, paper)
    if name in ("HDG_P", "PTCH_P"):
        rate = name.replace("_P", "_D")
        zero, theirs = point.gains[name] / point.gains[rate], paper[name] / paper[rate]
        return f"with {rate}, whose zero lies at {zero:.2f} rad/s, Table 3's at {theirs:.2f}"
    differs = "alike" if abs(ratio - 1.0) < EQUAL_WITHIN else "smaller" if ratio < 1.0 else "larger"
    gains = {
        **point.gains,
        **{gain: paper[gain] for gain in point.shape.free if not gain.endswith("_I")},
    }
    left, delay_s = prior.loop_margins(point.shape, gains, vehicle), _lag(vehicle, point).delay_s
    return (
        f"{differs}: Table 3's would leave damping {left.damping:.2f}, {left.gm_db:.1f} dB and"
        f" {left.pm_deg:.0f} deg behind {delay_s:.2f} s of delay"
    )


def _lag(vehicle: DesignModel, point: LocusPoint) -> Lag:
    return vehicle.yaw_lag if point.shape.loop == "heading" else vehicle.pitch_lag


def _integral(name: str, gains: Gains, paper: Gains) -> str:
    proportional = name.replace("_I", "_P")
    ours, theirs = gains[proportional] / gains[name], paper[proportional] / paper[name]
    return (
        f"of a load that nobody has measured yet a third is left {ours:.0f} s after its worst, with"
        f" Table 3's {theirs:.0f} s"
    )
