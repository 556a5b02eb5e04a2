"""First gains for a vehicle of one's own, designed from her file."""

from typing import Any

from ground.errors import InputError, OperationError
from sysid.design import initial
from sysid.design.initial import InitialDesign
from sysid.design.pid import DesignInfeasibleError
from sysid.refit import VehicleFileError

CARIBOU = ("caribou_truth", "caribou_nominal")
"""Vehicles for which the autopilot's defaults, the paper's prototype controller, were made."""

TRIM_LEARNING = {"TRIM_AUTO_S": 10.0}
"""Caribou's trims are unknown in a first dive, and the paper's first gains hardly integrate.

With 10 s the heading loop keeps 11.6 dB and 48 deg (12.0 dB and 67 deg without learning), and 6 deg
of rudder bias are carried within a minute.
"""


def first_dive_parameters(vehicle: str) -> dict[str, float]:
    """What to set before a simulated vehicle's first dive: nothing for Caribou. Raises as
    ``design``."""
    return {} if vehicle in CARIBOU else design(vehicle).parameters


def trim_learning_for(vehicle: str) -> dict[str, float]:
    """Return what makes a simulated vehicle learn its trims in a first dive.

    Nothing for a vehicle file, whose first gains carry an unknown trim.
    """
    return dict(TRIM_LEARNING) if vehicle in CARIBOU else {}


def prior_file_of(vehicle: str) -> str:
    """The vehicle file that an engineer would have of a simulated vehicle."""
    return "caribou_nominal" if vehicle in CARIBOU else vehicle


def design(vehicle: str) -> InitialDesign:
    """The prototype controller of a vehicle file.

    Raises:
        BadInputError: the file cannot be used, or is the simulated truth.
        FailedError: no gains make this vehicle behave.
    """

    if vehicle == "caribou_truth":
        raise InputError(
            "vehicle 'caribou_truth': is the simulated truth; "
            "give caribou_nominal, or a vehicle file"
        )
    try:
        return initial.design_initial_gains(vehicle)
    except DesignInfeasibleError as refusal:
        raise OperationError(f"{vehicle}: {refusal}") from None
    except VehicleFileError as error:
        raise InputError(str(error)) from None


def format_text(found: InitialDesign) -> str:
    """Every parameter with its reason; how the loops stand; and Table 3's initial column beside
    them."""
    lines = [
        f"{name:16s} {value:<10.5g} {found.reasons[name]}"
        for name, value in found.parameters.items()
    ]
    lines += [
        "",
        "Loops on the vehicle of the file, and on 95 % of those that the prior allows for",
    ]
    lines += [f"  {'':8s}{'damping':>14s}{'gain margin, dB':>18s}{'phase margin, deg':>20s}"]
    for loop, low in found.over_prior.items():
        own = found.nominal[loop]
        lines.append(
            f"  {loop:8s}{own.damping:7.2f}{low.damping:7.2f}{own.gm_db:11.1f}{low.gm_db:7.1f}"
            f"{own.pm_deg:13.0f}{low.pm_deg:7.0f}"
            f"   {100 * low.stable:.0f} % of {low.vehicles} stable"
        )
    lines += [
        "",
        "Beside Table 3's initial gains, as much weaker as this tail is livelier than Caribou's",
    ]
    lines += [f"  {'':8s}{'ours':>10s}{'Table 3':>10s}{'ratio':>7s}"]
    for name, row in found.comparison.items():
        lines.append(f"  {name:8s}{row.ours:10.3g}{row.paper:10.3g}{row.times:>7s}  {row.why}")
    return "\n".join(lines)


def as_json(found: InitialDesign) -> dict[str, Any]:
    return {
        "parameters": found.parameters,
        "reasons": found.reasons,
        "loops": {
            loop: {"nominal": own._asdict(), "prior": found.over_prior[loop]._asdict()}
            for loop, own in found.nominal.items()
        },
        "table_3": {name: row._asdict() for name, row in found.comparison.items()},
    }
