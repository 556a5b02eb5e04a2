"""Models for simulation that are made from a prior instead of a fit, and a mission."""

import math
from pathlib import Path

import msgspec

from sitl.vehicle import config
from sysid.estimation.map.problem import Prior
from sysid.models import model_export, model_file, prediction
from sysid.models.model_file import IdentifiedModel, ParameterEstimate
from sysid.test_design import prior as design_priors
from sysid.test_design.prior import DesignPrior

SHORT_MISSION = """
name = "short"

[[step]]
depth_m = 2.0
heading_deg = 10.0
thrust_pct = 58.0
duration_s = 42.0

[[step]]
surface = true
"""


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


def write_known_model(path: Path) -> None:
    """Write a model of Caribou with known trims and a tenth of the prior standard deviations."""
    known = design_priors.with_trim(
        design_priors.from_file(config.load("caribou_nominal")),
        math.radians(6.0),
        math.radians(0.4),
    )
    model_file.write(model_of(known._replace(covariance=0.01 * known.covariance)), path)


def with_planes_of_vehicle(model: IdentifiedModel) -> IdentifiedModel:
    """Return a model whose planes are those of its vehicle, as in a fit."""
    planes = dict(model.planes)
    derived = model_export.derived_numbers(prediction.vehicles(model)[0])
    for (plane, name), value in derived.items():
        if getattr(planes[plane], name) is not None:
            estimate = ParameterEstimate(value, None)
            planes[plane] = msgspec.structs.replace(planes[plane], **{name: estimate})
    return msgspec.structs.replace(model, planes=planes)
