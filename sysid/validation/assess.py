"""A fitted model with everything that its runs, fitted and held out, say of it."""

import importlib.metadata
from collections.abc import Mapping, Sequence

import msgspec

from sitl.vehicle.config import VehicleConfig
from sysid.data.segments import Run
from sysid.models import prediction
from sysid.models.model_file import IdentifiedModel
from sysid.validation.acceptance import assess
from sysid.validation.validate import validate

PACKAGES = ("caribou-auv", "numpy", "scipy", "numba", "msgspec")


def with_assessment(
    model: IdentifiedModel,
    fitted: Sequence[Run],
    held_out: Sequence[Run],
    gains: Mapping[str, float] | None = None,
    prior: VehicleConfig | None = None,
) -> IdentifiedModel:
    """Errors on held-out runs, validation and verdict added. Arguments as for
    ``validate.validate``."""
    found = validate(model, fitted, held_out, gains, prior)
    return msgspec.structs.replace(
        model,
        held_out=prediction.quality(model, held_out, prior),
        validation=found,
        verdict=assess(model, found),
        versions={package: importlib.metadata.version(package) for package in PACKAGES},
    )
