"""A whole campaign as `ground campaign` runs it, but without processes and sockets.

The supplied missions are simulated with the autopilot's tick and the simulator's step. The
telemetry is read, screened, fitted and validated like a log.
"""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ground.campaign.computations import FITTED, HELD_OUT
from ground.campaign.refit import TRIM_WINDOW_S
from ground.campaign.request import TRIM_MISSION, dive_seed
from ground.missions import script
from sitl.vehicle import config
from sysid import prior_knowledge, refit
from sysid.data import segments
from sysid.data.dataset import Actuators, Attitude, Depth, DuctAngles, Log, LogEvent, Setpoints
from sysid.data.events import parse_text
from sysid.data.runs import Run
from sysid.design import pid
from sysid.design.pid import Design, DesignInfeasibleError
from sysid.models import model_file as models
from sysid.models.model_file import IdentifiedModel, ModelError
from sysid.reproduction.paper_tables import TABLE_3_IMPROVED, TABLE_3_INITIAL
from sysid.screening import screen
from sysid.validation.assess import with_assessment
from tests.helpers.closed_loop import Dive

VEHICLE, PRIOR, SEA = "caribou_truth", "caribou_nominal", "disturbed"
LONGEST_S = 3600.0
_INFO = 6
"""MAV_SEVERITY_INFO."""
OURS = "ours"
GAIN_SETS = ("initial", "paper", OURS)
Values = dict[str, float]
"""Parameters by name."""


class Campaign(NamedTuple):
    """Model of a campaign, and the trims measured before it."""

    model: IdentifiedModel
    trims: Values


def load_or_fly(model: Path | None, seed: int) -> Campaign:
    """Return a campaign with a given model, or run a new one.

    Raises ModelError.
    """
    return Campaign(models.read(model), measured_trims(seed)) if model else fly(seed)


@contextmanager
def exit_on_error() -> Iterator[None]:
    """Exit with a message if the model cannot be read or the design is infeasible."""
    try:
        yield
    except ModelError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
    except DesignInfeasibleError as refusal:
        print(refusal, file=sys.stderr)
        sys.exit(1)


def fly(seed: int) -> Campaign:
    """Measure the trims, fly the tests with the initial gains, fit and validate."""
    trims = measured_trims(seed)
    values = {**TABLE_3_INITIAL, **trims}
    fitted, held_out = (_kept(missions, seed, values) for missions in (FITTED, HELD_OUT))
    prior_file = config.load(PRIOR)
    prior = prior_knowledge.prior_of(fitted, prior_file)
    model, refitted = refit.identify_without_outliers(fitted, prior, PRIOR)
    return Campaign(
        with_assessment(model, refitted.accepted_runs, held_out, TABLE_3_INITIAL, prior_file), trims
    )


def measured_trims(seed: int) -> Values:
    """Return mean rudder and elevator at the end of the trim mission."""
    dive = flown(TRIM_MISSION, seed, TABLE_3_INITIAL)
    window = dive.during(dive.surfacing_s - TRIM_WINDOW_S, dive.surfacing_s)
    rudder_deg, elevator_deg = (
        float(np.degrees(dive[name][window].mean())) for name in ("rudder", "elevator")
    )
    return {"TRIM_RUD_DEG": round(rudder_deg, 3), "TRIM_ELE_DEG": round(elevator_deg, 3)}


def flown(mission: str, seed: int, values: Values) -> Dive:
    """Simulate a supplied mission with the seed that the campaign of ``seed`` gives it."""
    items = script.compile_items(script.load(mission))
    return Dive(
        items,
        vehicle=VEHICLE,
        sea=SEA,
        seed=dive_seed(seed, mission),
        values=values,
        limit_s=LONGEST_S,
    )


def _kept(missions: Sequence[str], seed: int, values: Values) -> list[Run]:
    """Return the tests of the missions that pass screening."""
    logs = [log(flown(mission, seed, values), mission, values) for mission in missions]
    return [
        each.run
        for each in screen([run for log in logs for run in segments.cut_runs(log)])
        if each.accepted
    ]


def log(dive: Dive, name: str, values: Values) -> Log:
    """Return the telemetry of a dive at the rate of the tick."""
    t, nothing = dive["t_s"], np.empty(0)
    angles = dive["roll"], dive["pitch"], np.unwrap(dive["heading"])
    return Log(
        name=name,
        sha256="",
        attitude=Attitude(t, *angles, dive["p_radps"], dive["q_radps"], dive["r_radps"]),
        actuators=Actuators(t, dive["rudder"], dive["elevator"], dive["thrust"]),
        depth=Depth(t, dive["depth_m"], dive["depth_rate_mps"]),
        setpoints=Setpoints(nothing, nothing, nothing, nothing, nothing),
        events=tuple(LogEvent(time_s, parse_text(_INFO, text)) for time_s, text in dive.told),
        parameters=dict(values),
        duct=DuctAngles(nothing, nothing, nothing),
    )


def redesigned(flown: Campaign) -> Design:
    """Redesign the gains from the campaign's model.

    Raises DesignInfeasibleError.
    """
    return pid.redesign(flown.model)


def gain_sets(trims: Values, ours: Values) -> dict[str, Values]:
    """Return the gains to compare, with the same trims: Table 3's two columns, and the redesign."""
    paper = TABLE_3_INITIAL, TABLE_3_IMPROVED
    return {name: {**gains, **trims} for name, gains in zip(GAIN_SETS, (*paper, ours), strict=True)}
