"""Dives simulated in this process: the identified vehicle with the autopilot's own tick."""

from collections.abc import Mapping
from pathlib import Path

from autopilot.control import params
from caribou_auv.identification import model_of
from caribou_auv.parameters import checked
from ground.campaign import refit
from ground.log_tools.replay import ReplayRequest, replay_log
from ground.missions import plans
from sysid.models import prediction
from sysid.models.model_file import IdentifiedModel
from sysid.monte_carlo import samples
from sysid.monte_carlo import simulate as simulation
from sysid.monte_carlo.replay import Replayed
from sysid.monte_carlo.simulate import Sea, SimulatedDive
from sysid.test_design import prior as design_priors
from sysid.test_design.prior import DesignPrior

DEFAULT_VEHICLE = "caribou_nominal"


def simulate(
    mission: str | Path,
    parameters: Mapping[str, float] | None = None,
    *,
    model: IdentifiedModel | str | Path | None = None,
    vehicle: str | Path | None = None,
    sea: Sea | None = None,
    seed: int = 1,
) -> SimulatedDive:
    """Simulate a dive in this process, without sockets, hundreds of times faster than real time.

    Parameters
    ----------
    mission : str or Path
        Name of a shipped mission, or a mission file.
    parameters : mapping, optional
        Parameters of the autopilot by name; others have their defaults. Trims that are not given
        are those that a trim flight would find.
    model : IdentifiedModel, str or Path, optional
        The vehicle and its disturbance: a model, or its ``model.json``.
    vehicle : str or Path, optional
        Name or path of a vehicle file: the vehicle without a model, or the prior of a model in
        place of the one in it. The default is ``caribou_nominal``.
    sea : Sea, optional
        Factor on the identified disturbance, current, and change of the rudder bias.
    seed : int
        Seed of disturbance, sensor noise and direction of the current.

    Returns
    -------
    SimulatedDive
        ``log``, ``true_depth_m``, ``finished`` and ``failsafe``.

    Raises
    ------
    CaribouError
        The mission, a parameter, the model or the vehicle cannot be used.
    """
    prior = _prior(model, vehicle)
    craft = prior.vehicle(prior.mean)
    values = {**samples.trims_deg(craft), **checked(parameters)}
    items = plans.load_items(str(mission))
    config = params.config(values)
    return simulation.fly(craft, prior.noise, items, config, sea or Sea(), (seed,))


def replay(
    log: str | Path,
    parameters: Mapping[str, float],
    *,
    model: IdentifiedModel | str | Path | None = None,
    vehicle: str | Path | None = None,
    mission: str | Path | None = None,
    controller: str | Path | None = None,
    new_controller: str | Path | None = None,
) -> Replayed:
    """Fly a recorded dive again with other gains and its own disturbances.

    Parameters
    ----------
    log : str or Path
        Log of the dive.
    parameters : mapping
        Parameters that replace recorded ones.
    model : IdentifiedModel, str or Path, optional
        As for `simulate`.
    vehicle : str or Path, optional
        As for `simulate`.
    mission : str or Path, optional
        Mission of the dive, if the log does not contain it.
    controller : str or Path, optional
        File of the LQG controllers of the recorded dive, if it had any.
    new_controller : str or Path, optional
        File of LQG controllers that replace the recorded loops.

    Returns
    -------
    Replayed
        Replays with the recorded and with the other parameters, and their differences.

    Raises
    ------
    CaribouError
        The log cannot be replayed, or a parameter, the model or the vehicle cannot be used.
    """
    prior = _prior(model, vehicle)
    request = ReplayRequest(
        Path(log),
        checked(parameters),
        mission=str(mission) if mission else None,
        controller=Path(controller) if controller else None,
        new_controller=Path(new_controller) if new_controller else None,
    )
    return replay_log(request, prior)


def _prior(model: IdentifiedModel | str | Path | None, vehicle: str | Path | None) -> DesignPrior:
    """Return the vehicle and its disturbance."""
    if model is None:
        name = str(vehicle or DEFAULT_VEHICLE)
        return design_priors.from_file(refit.read_vehicle(name), name)
    given = refit.read_vehicle(str(vehicle)) if vehicle else None
    identified = model_of(model)
    return design_priors.from_model(identified, prediction.prior_vehicle(identified, given))
