"""What leaving runs out moved: every design number, in its own standard deviations."""

import msgspec

from sysid.models.model_file import IdentifiedModel, ParameterEstimate
from sysid.screening.influence import shifts


def test_a_number_that_moved_is_told_in_its_standard_deviations(model: IdentifiedModel) -> None:
    assert all(shift.sds == 0.0 for shift in shifts(model, model))
    yaw = model.planes["yaw"]
    b1 = yaw.b1_per_s2
    assert b1.sd is not None
    moved = msgspec.structs.replace(yaw, b1_per_s2=ParameterEstimate(b1.value + 2.0 * b1.sd, b1.sd))
    before = msgspec.structs.replace(model, planes=model.planes | {"yaw": moved})
    told = {(s.plane, s.number): s for s in shifts(before, model)}
    assert abs(told["yaw", "b1_per_s2"].sds - 2.0) < 1e-9
    assert told["yaw", "b1_per_s2"].value == b1.value
    assert told["pitch", "b1_per_s2"].sds == 0.0
    assert ("yaw", "restoring_per_s2") not in told
    assert len(told) == 6 + 7
