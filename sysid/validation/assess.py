"""Add validation, held-out errors and assessment to a fitted model."""

import importlib.metadata
from collections.abc import Mapping, Sequence

import msgspec

from sitl.vehicle.config import VehicleConfig
from sysid.data.runs import Run
from sysid.models import prediction
from sysid.models.model_file import IdentifiedModel
from sysid.validation.acceptance import assess
from sysid.validation.validate import validate

PACKAGES = ("caribou-auv", "numpy", "scipy", "numba", "msgspec")
"""Packages whose versions a model records."""


def with_assessment(
    model: IdentifiedModel,
    fitted: Sequence[Run],
    held_out: Sequence[Run],
    gains: Mapping[str, float] | None = None,
    prior: VehicleConfig | None = None,
) -> IdentifiedModel:
    """Add held-out errors, validation, assessment and package versions to a model.

    Parameters
    ----------
    model : IdentifiedModel
        Fitted model.
    fitted : sequence of Run
        Runs that were fitted.
    held_out : sequence of Run
        Runs that were not fitted.
    gains : mapping of str to float, optional
        Gains of the loops during the tests, by parameter name.
    prior : VehicleConfig, optional
        Prior vehicle; by default the vehicle file in the model.

    Returns
    -------
    IdentifiedModel
        The model with its validation.
    """
    validation = validate(model, fitted, held_out, gains, prior)
    return msgspec.structs.replace(
        model,
        held_out=prediction.quality(model, held_out, prior),
        validation=validation,
        assessment=assess(model, validation),
        versions={package: importlib.metadata.version(package) for package in PACKAGES},
    )
