"""Models for simulation that are made from a prior instead of a fit."""

import msgspec

from sysid.design import design_model
from sysid.estimation.map.problem import Prior
from sysid.models import model_export, prediction
from sysid.models.linear_planes import SmallSignal, small_signal
from sysid.models.model_file import IdentifiedModel, ParameterEstimate
from sysid.planes import Plane
from sysid.test_design.prior import DesignPrior


def model_of(prior: DesignPrior) -> IdentifiedModel:
    """Return a model of method ``map`` with the prior's distribution and no disturbance."""
    bare = model_export.from_paper(
        {},
        Prior(prior.config, prior.biases_rad, prior.mean, prior.covariance),
        "caribou_nominal",
    )
    covariance = tuple(tuple(row) for row in prior.covariance.tolist())
    joint = msgspec.structs.replace(bare.joint, z=tuple(prior.mean.tolist()), covariance=covariance)
    return with_planes_of_vehicle(msgspec.structs.replace(bare, method="map", joint=joint))


def with_planes_of_vehicle(model: IdentifiedModel) -> IdentifiedModel:
    """Return a model whose planes are those of its vehicle, as in a fit."""
    planes = dict(model.planes)
    actuators = prediction.vehicles(model)[0].actuators
    for plane, linear in zip(Plane, design_model.from_model(model).planes, strict=True):
        numbers = {name: getattr(small_signal(linear), name) for name in SmallSignal._fields[:-1]}
        numbers["delay_s"] = actuators[plane].delay_s
        estimates = {name: ParameterEstimate(value, None) for name, value in numbers.items()}
        planes[plane] = msgspec.structs.replace(planes[plane], **estimates)
    return msgspec.structs.replace(model, planes=planes)
