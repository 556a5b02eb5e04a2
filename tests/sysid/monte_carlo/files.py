"""Models to rehearse with, made up from a belief instead of fitted to anything."""

import msgspec

from sysid.estimation.map.problem import Prior
from sysid.models import model_export
from sysid.models.model_file import IdentifiedModel
from sysid.test_design.prior import DesignPrior


def model_of(belief: DesignPrior) -> IdentifiedModel:
    """A model of method ``map`` that believes as ``belief`` does; it knows no sea."""
    bare = model_export.from_paper(
        {},
        Prior(belief.config, belief.biases_rad, belief.mean, belief.covariance),
        "caribou_nominal",
    )
    covariance = tuple(tuple(row) for row in belief.covariance.tolist())
    joint = msgspec.structs.replace(
        bare.joint, z=tuple(belief.mean.tolist()), covariance=covariance
    )
    return msgspec.structs.replace(bare, method="map", joint=joint)
