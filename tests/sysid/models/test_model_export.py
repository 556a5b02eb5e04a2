"""Numbers of a model file that an estimate does not determine."""

import pytest

from sysid.models import linear_planes, model_export
from sysid.planes import Plane


@pytest.mark.parametrize(
    ("slow_per_s", "slow_sd", "is_bounded"),
    [(-0.1, 0.05, True), (-0.1, 0.06, False), (0.1, 0.05, True), (0.1, 0.06, False)],
)
def test_static_gain_is_unbounded_if_the_slow_pole_may_be_zero(
    slow_per_s: float, slow_sd: float, is_bounded: bool
) -> None:
    """Fieller's interval of a ratio is bounded if the denominator differs from zero by 1.96 sd."""
    names = (*linear_planes.SmallSignal._fields, "delay_s", "actuator_bias_deg")
    derived = {(Plane.PITCH, name): (1.0, 0.2) for name in names}
    derived[Plane.PITCH, "p_slow_per_s"] = slow_per_s, slow_sd
    plane = model_export._plane(Plane.PITCH, derived)
    assert plane.static_gain_per_s.value == 1.0
    assert plane.static_gain_per_s.sd == (0.2 if is_bounded else None)
    assert plane.p_slow_per_s.sd == slow_sd
