"""First gains of a vehicle, designed from its vehicle file."""

from functools import cache
from typing import Any

import msgspec
from numpy.linalg import LinAlgError

from mavlink_io.errors import InputError
from sysid import prior_knowledge
from sysid.design import initial
from sysid.design.initial import InitialDesign, vehicle_parameters
from sysid.design.pid import DesignInfeasibleError
from sysid.test_design.prior import DesignPrior

CARIBOU = ("caribou_truth", "caribou_nominal")
"""Vehicles that need no first design: the autopilot's defaults are the paper's prototype gains."""

PERTURBED = "perturbed"
"""Flown vehicle that is a random change of the vehicle file within its uncertainty."""

TRIM_LEARNING = {"TRIM_AUTO_S": 10.0}
"""Parameters by which Caribou learns its trims in a first dive.

The trims are unknown then, and the integral gains of the paper's prototype are small. With a time
constant of 10 s the heading loop has margins of 11.6 dB and 48 deg (12.0 dB and 67 deg without trim
learning), and a rudder bias of 6 deg is compensated within a minute.
"""


def is_caribou(vehicle: Any) -> bool:
    """Return whether a vehicle is Caribou.

    The name in a vehicle file does not decide: a copy of the shipped file with other values is
    another vehicle.

    Parameters
    ----------
    vehicle : str or VehicleConfig
        Name or path of the vehicle file: Caribou if it is the name of a shipped file of Caribou.
        Or the content of a vehicle file: Caribou if all values equal those of ``caribou_nominal``.

    Returns
    -------
    bool
        Whether the autopilot's defaults are the gains of this vehicle.
    """
    if isinstance(vehicle, str):
        return vehicle in CARIBOU
    nominal = _nominal_caribou()
    return bool(msgspec.structs.replace(vehicle, name=nominal.name) == nominal)


@cache
def _nominal_caribou() -> Any:
    """Return the content of ``caribou_nominal``."""
    return prior_knowledge.vehicle_file("caribou_nominal")


def check_flown(vehicle: str) -> tuple[str, ...]:
    """Check the vehicle of a simulated flight before it is started.

    Parameters
    ----------
    vehicle : str
        Name or path of the vehicle file.

    Returns
    -------
    tuple of str
        Warnings about unusual values; empty for a shipped vehicle.

    Raises
    ------
    InputError
        The file cannot be used, the vehicle is physically impossible, or an instrument is missing
        without which the autopilot does not arm.
    """
    return prior_knowledge.check_flown_vehicle(vehicle)


def first_dive_parameters(vehicle: str) -> dict[str, float]:
    """Return the parameters of a vehicle's first dive; raises as `design`.

    Parameters
    ----------
    vehicle : str
        Name or path of the vehicle file.

    Returns
    -------
    dict
        Values by parameter name; empty for Caribou.
    """
    return {} if is_caribou(vehicle) else design(vehicle).parameters


def parameters_of(vehicle: DesignPrior) -> dict[str, float]:
    """Return the parameters that describe a vehicle, such as travel and cruise.

    Parameters
    ----------
    vehicle : DesignPrior
        Vehicle file with its uncertainty.

    Returns
    -------
    dict
        Values by parameter name, without trims; empty for Caribou, whose values are the
        autopilot's defaults.
    """
    if is_caribou(vehicle.config):
        return {}
    values = vehicle_parameters.values(vehicle.config)
    return {name: value for name, value in values.items() if not name.startswith("TRIM_")}


def trim_learning_for(vehicle: str) -> dict[str, float]:
    """Return the parameters by which a simulated vehicle learns its trims in a first dive.

    Parameters
    ----------
    vehicle : str
        Name or path of the vehicle file.

    Returns
    -------
    dict
        Values by parameter name; empty for a vehicle file, whose first gains compensate an unknown
        trim by integral action.
    """
    return dict(TRIM_LEARNING) if is_caribou(vehicle) else {}


def prior_file_of(vehicle: str) -> str:
    """Return the vehicle file that is known of a simulated vehicle before any test."""
    return "caribou_nominal" if is_caribou(vehicle) else vehicle


def default_truth(vehicle: str) -> str:
    """Return the vehicle that a campaign flies: Caribou itself, and a perturbed one for others."""
    return vehicle if is_caribou(vehicle) else PERTURBED


def design(vehicle: Any) -> InitialDesign:
    """Design the first gains of a vehicle from its file.

    Parameters
    ----------
    vehicle : str or VehicleConfig
        Name or path of the vehicle file, or its content.

    Returns
    -------
    InitialDesign
        Gains and the other parameters of a first dive, with reasons.

    Raises
    ------
    InputError
        The file cannot be used, or is that of the simulated truth.
    OperationError
        No gains meet the specification.
    """
    if vehicle == "caribou_truth":
        raise InputError(
            "vehicle 'caribou_truth': is the simulated truth; "
            "give caribou_nominal, or a vehicle file"
        )
    if isinstance(vehicle, str):
        prior_knowledge.check_vehicle(vehicle)
    name = getattr(vehicle, "name", vehicle)
    try:
        return initial.design_initial_gains(vehicle)
    except DesignInfeasibleError as error:
        raise DesignInfeasibleError(f"{name}: {error}") from None
    except LinAlgError as error:
        raise DesignInfeasibleError(f"{name}: its linear model is singular ({error})") from None


def format_text(initial_design: InitialDesign) -> str:
    """Return parameters with reasons, margins of the loops, and a comparison with Table 3."""
    lines = [
        f"{name:16s} {value:<10.5g} {initial_design.reasons[name]}"
        for name, value in initial_design.parameters.items()
    ]
    lines += [
        "",
        "Loops on the vehicle of the file, and on 95 % of the vehicles sampled from the prior",
    ]
    lines += [f"  {'':8s}{'damping':>14s}{'gain margin, dB':>18s}{'phase margin, deg':>20s}"]
    for loop, low in initial_design.over_prior.items():
        own = initial_design.nominal[loop]
        lines.append(
            f"  {loop:8s}{own.damping:7.2f}{low.damping:7.2f}{own.gm_db:11.1f}{low.gm_db:7.1f}"
            f"{own.pm_deg:13.0f}{low.pm_deg:7.0f}"
            f"   {100 * low.stable:.0f} % of {low.vehicles} stable"
        )
    lines += [
        "",
        "Compared with Table 3's initial gains, scaled with the tail's effectiveness",
    ]
    lines += [f"  {'':8s}{'ours':>10s}{'Table 3':>10s}{'ratio':>7s}"]
    for name, row in initial_design.comparison.items():
        lines.append(f"  {name:8s}{row.ours:10.3g}{row.paper:10.3g}{row.times:>7s}  {row.why}")
    return "\n".join(lines)


def as_json(initial_design: InitialDesign) -> dict[str, Any]:
    """Return parameters, margins and the comparison with Table 3 as plain numbers."""
    return {
        "parameters": initial_design.parameters,
        "reasons": initial_design.reasons,
        "loops": {
            loop: {"nominal": own._asdict(), "prior": initial_design.over_prior[loop]._asdict()}
            for loop, own in initial_design.nominal.items()
        },
        "table_3": {name: row._asdict() for name, row in initial_design.comparison.items()},
    }
