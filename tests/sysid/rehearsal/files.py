"""Models to rehearse with, made up from a belief instead of fitted to anything."""

import msgspec

from sysid import assemble
from sysid.experiment.belief import Belief
from sysid.joint.problem import Prior
from sysid.model import IdentifiedModel


def model_of(belief: Belief) -> IdentifiedModel:
    """A model of method ``map`` that believes as ``belief`` does; it knows no sea."""
    bare = assemble.from_paper({}, Prior(belief.config, belief.biases_rad, belief.mean, belief.covariance), "bench")
    covariance = tuple(tuple(row) for row in belief.covariance.tolist())
    joint = msgspec.structs.replace(bare.joint, z=tuple(belief.mean.tolist()), covariance=covariance)
    return msgspec.structs.replace(bare, method="map", joint=joint)
