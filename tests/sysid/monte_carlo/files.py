"""Models for simulation that are made from a prior instead of a fit."""

import msgspec

from sysid.estimation.map.problem import Prior
from sysid.models import model_export
from sysid.models.model_file import IdentifiedModel
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
    return msgspec.structs.replace(bare, method="map", joint=joint)
