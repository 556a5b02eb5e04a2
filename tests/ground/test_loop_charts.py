"""Charts of the control loops against known properties of loops."""

import numpy as np
import pytest

from ground.report import loop_charts
from sysid.control_analysis.loop_transfer import Lag
from sysid.control_analysis.margins import Planes
from sysid.design import design_model
from sysid.design.design_model import DEFAULT_DISTURBANCE
from sysid.models.linear_planes import pitch_plane, yaw_plane
from sysid.planes import Plane
from sysid.reproduction.paper_tables import TABLE_1_ADJUSTED, TABLE_3_IMPROVED, TABLE_3_INITIAL

LAG = Lag(0.33)


@pytest.fixture(scope="module")
def drawn() -> loop_charts.LoopCharts:
    """Charts of the paper's adjusted model with both columns of its Table 3."""
    planes = Planes(yaw_plane(TABLE_1_ADJUSTED), pitch_plane(TABLE_1_ADJUSTED))
    disturbance = dict.fromkeys(Plane, DEFAULT_DISTURBANCE)
    vehicle = design_model.build(planes, LAG, LAG, disturbance)
    gains = {"initial": TABLE_3_INITIAL, "redesigned": TABLE_3_IMPROVED}
    return loop_charts.loop_charts(vehicle, gains)


def trace(
    drawn: loop_charts.LoopCharts, key: str, name: str, axis: str = "y"
) -> dict[str, list[float]]:
    found: dict[str, list[float]]
    (found,) = [
        each
        for each in drawn.charts[key]["data"]
        if each["name"] == name and each.get("yaxis", "y") == axis
    ]
    return found


def test_every_loop_has_its_charts(drawn: loop_charts.LoopCharts) -> None:
    cuts = {"rudder", "heading", "elevator", "pitch", "depth"}
    assert set(drawn.bode) == {f"bode-{cut}" for cut in cuts}
    assert set(drawn.nyquist) == {f"nyquist-{cut}" for cut in cuts}
    assert set(drawn.charts) == {*drawn.bode, *drawn.nyquist, *drawn.steps, *drawn.loci}


def test_sensitivity_peak_of_bode_is_the_circle_of_nyquist(drawn: loop_charts.LoopCharts) -> None:
    for cut in ("rudder", "elevator"):
        peak_db = max(trace(drawn, f"bode-{cut}", "redesigned gains", "y3")["y"])
        (circle,) = [
            each["name"]
            for each in drawn.charts[f"nyquist-{cut}"]["data"]
            if each["name"].startswith("Ms")
        ]
        # drawn frequencies lie up to 3 % apart
        assert 10.0 ** (peak_db / 20.0) == pytest.approx(float(circle[5:]), rel=0.01)


def test_gain_and_phase_are_those_of_the_sensitivity(drawn: loop_charts.LoopCharts) -> None:
    """|S| = 1 / |1 + L| with L from the drawn gain and phase."""
    gain, phase, sensitivity = (
        np.array(trace(drawn, "bode-rudder", "initial gains", axis)["y"])
        for axis in ("y", "y2", "y3")
    )
    loop = 10.0 ** (gain / 20.0) * np.exp(1j * np.radians(phase))
    assert -20.0 * np.log10(np.abs(1.0 + loop)) == pytest.approx(sensitivity, abs=0.01)


def test_designed_poles_lie_on_the_root_locus(drawn: loop_charts.LoopCharts) -> None:
    assert drawn.loci
    for key in drawn.loci:
        branches, poles = (
            np.array(each["x"]) + 1j * np.array(each["y"])
            for each in (trace(drawn, key, "loop gain 0 to 3"), trace(drawn, key, "designed gain"))
        )
        for pole in poles:
            # neighbouring gains differ by 4 %
            assert np.min(np.abs(branches - pole)) < 0.06, (key, pole)


def test_step_of_heading_ends_at_its_set_point(drawn: loop_charts.LoopCharts) -> None:
    """The heading loop has a pole at zero in its plant: no steady error without an integrator."""
    response = trace(drawn, "closed-heading", "initial gains")["y"]
    assert response[0] == 0.0
    assert response[-1] == pytest.approx(1.0, abs=0.02)
