"""Influence of left-out runs on the design numbers, in standard deviations."""

import msgspec

from sysid.models.model_file import IdentifiedModel, ParameterEstimate
from sysid.planes import Plane
from sysid.screening.refit_loop import shifts


def test_shifts_are_in_standard_deviations(model: IdentifiedModel) -> None:
    assert all(shift.sds == 0.0 for shift in shifts(model, model))
    yaw = model.planes[Plane.YAW]
    b1 = yaw.b1_per_s2
    assert b1.sd is not None
    changed_yaw = msgspec.structs.replace(
        yaw, b1_per_s2=ParameterEstimate(b1.value + 2.0 * b1.sd, b1.sd)
    )
    with_all = msgspec.structs.replace(model, planes=model.planes | {"yaw": changed_yaw})
    by_number = {(shift.plane, shift.number): shift for shift in shifts(with_all, model)}
    assert abs(by_number[Plane.YAW, "b1_per_s2"].sds - 2.0) < 1e-9
    assert by_number[Plane.YAW, "b1_per_s2"].value == b1.value
    assert by_number[Plane.PITCH, "b1_per_s2"].sds == 0.0
    assert ("yaw", "restoring_per_s2") not in by_number
    assert len(by_number) == 6 + 7
