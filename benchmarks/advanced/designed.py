"""PID gains and LQG controllers designed from one model, and their predicted performance."""

from dataclasses import replace
from time import process_time
from typing import NamedTuple

from msgspec.structs import asdict

from autopilot.control import loops, params
from autopilot.control.lqg import LqgControllers
from autopilot.control.setpoints import Setpoint
from autopilot.control.types import LoopMemory, VehicleEstimate
from benchmarks.redesign.campaign import Values
from benchmarks.study import Figure
from mavlink_io.tick import TICK_S
from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import Margins
from sysid.design import lqg as optimal
from sysid.design import pid as design
from sysid.design.design_model import from_model
from sysid.design.lqg import LqgDesign, loop_analysis
from sysid.design.pid import Design
from sysid.design.specification import DesignRobustness, Response
from sysid.models.model_file import IdentifiedModel
from sysid.planes import Plane

TICKS = 2000


class Contender(NamedTuple):
    """Controller of one of the two designs."""

    values: Values
    controllers: LqgControllers | None


Contenders = dict[str, Contender]


class Designed(NamedTuple):
    """Both designs from one model."""

    pid: Design
    lqg: LqgDesign
    contenders: Contenders


def designed(model: IdentifiedModel, trims: Values) -> Designed:
    """Design both with the same reference models and limits.

    Raises DesignInfeasibleError.
    """
    pid, lqg = design.redesign(model), optimal.design_lqg(model)
    values = {**pid.gains, **trims}
    return Designed(
        pid,
        lqg,
        {
            "PID": Contender(values, None),
            "LQG": Contender(values, optimal.autopilot_controllers(lqg)),
        },
    )


def promised(model: IdentifiedModel, found: Designed) -> list[Figure]:
    """Return predicted rms responses, margins, and fractions of vehicles that meet the limits."""
    pid, lqg = found.pid, found.lqg
    figures = [
        *_response("PID", pid.predicted),
        *_response("LQG", lqg.predicted),
        *_margins("PID", pid.analysis.margins),
        *_margins("LQG", _cuts(model, lqg)),
        *_trust("PID", pid.robustness),
        *_trust("LQG", lqg.robustness),
    ]
    return [*figures, *(_cost(name, each) for name, each in found.contenders.items())]


def _response(name: str, found: Response) -> list[Figure]:
    """Return the predicted rms values in the model's sea."""
    return [
        Figure(
            f"{name}: {field.rpartition('_')[0]} rms, predicted",
            value,
            unit=field.rpartition("_")[2],
        )
        for field, value in asdict(found).items()
    ]


def _cuts(model: IdentifiedModel, lqg: LqgDesign) -> dict[str, Margins]:
    """Return the margins of the LQG loops, opened at each input and output."""
    vehicle = from_model(model)
    loops = {
        Plane.YAW: (loop_analysis.measured_plane(vehicle, Plane.YAW), lqg.heading),
        Plane.PITCH: (loop_analysis.measured_plane(vehicle, Plane.PITCH), lqg.depth),
    }
    return {
        name: loop_transfer.margins(cut)
        for plane, controller in loops.values()
        for name, cut in zip(plane.names, loop_analysis.cuts(plane, controller), strict=True)
    }


def _margins(name: str, found: dict[str, Margins]) -> list[Figure]:
    """Return the smallest margins and the largest sensitivity."""
    cuts = [found[cut] for cut in ("rudder", "heading", "elevator", "depth")]
    return [
        Figure(f"{name}: least gain margin", min(cut.gm_db for cut in cuts), unit="dB"),
        Figure(f"{name}: least phase margin", min(cut.pm_deg for cut in cuts), unit="deg"),
        Figure(f"{name}: largest sensitivity", max(cut.max_sensitivity for cut in cuts)),
    ]


def _trust(name: str, found: DesignRobustness | None) -> list[Figure]:
    """Return the fractions of vehicles that meet the full and the relaxed specification."""
    if found is None:
        return []
    return [
        Figure(
            f"{name}: vehicles that keep the specification", 100.0 * found.specification, unit="%"
        ),
        Figure(f"{name}: vehicles that keep the relaxed one", 100.0 * found.relaxed, unit="%"),
    ]


def _cost(name: str, contender: Contender) -> Figure:
    """Return the CPU time of the loops per tick."""
    config = replace(params.config(contender.values), lqg_controllers=contender.controllers)
    estimate, memory = VehicleEstimate(speed_mps=config.cruise_speed_mps), LoopMemory()
    began_s = process_time()
    for _ in range(TICKS):
        _, memory = loops.step_loops(
            estimate, Setpoint(), memory, config, TICK_S, heading=True, depth=True
        )
    return Figure(
        f"{name}: CPU time of the loops in a tick",
        1e6 * (process_time() - began_s) / TICKS,
        unit="us",
    )
