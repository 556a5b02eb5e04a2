"""First gains for a vehicle of one's own, designed from her file."""

from ground.errors import BadInputError, FailedError
from sysid import prototype
from sysid.design import DesignRefused
from sysid.prototype import Prototype
from sysid.refit import VehicleError

CARIBOU = ("field", "bench")
"""Vehicles for which the autopilot's defaults, the paper's prototype controller, were made."""


def parameters_for(vehicle: str) -> dict[str, float]:
    """What to set before a simulated vehicle's first dive: nothing for Caribou. Raises as ``design``."""
    return {} if vehicle in CARIBOU else design(vehicle).parameters


def known_beforehand(vehicle: str) -> str:
    """The vehicle file that an engineer would have of a simulated vehicle."""
    return "bench" if vehicle in CARIBOU else vehicle


def design(vehicle: str) -> Prototype:
    """The prototype controller of a vehicle file.

    Raises:
        BadInputError: the file cannot be used, or is the simulated truth.
        FailedError: no gains make this vehicle behave.
    """
    if vehicle == "field":
        raise BadInputError("vehicle 'field': is the simulated truth; give bench, or a vehicle file")
    try:
        return prototype.prototype(vehicle)
    except DesignRefused as refusal:
        raise FailedError(f"{vehicle}: {refusal}") from None
    except VehicleError as error:
        raise BadInputError(str(error)) from None
