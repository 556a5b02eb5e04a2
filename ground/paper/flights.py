"""Flights that the paper's tables and figures need, all on the simulated vehicle.

A campaign with the paper's improved gains gives Tables 1, 2, 3 and 5 and Figures 5, 6 and 8 to 15.
A bench test gives Figure 4, and a dive with rudder steps about the bias Figure 7.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ground.bench_tests import bench
from ground.campaign import refit
from ground.campaign.campaign_folder import STAGES, CampaignFolder
from ground.campaign.dives import AnnounceCallback, WatchCallback
from ground.campaign.request import CampaignRequest
from ground.campaign.run import Campaign
from ground.client import flight
from ground.client.flight import Dive
from ground.report import figures
from ground.simulation.processes import SimulatedVehicle, Simulation
from mavlink_io.errors import InputError, OperationError
from mavlink_io.logging.mcap_reader import McapChannel, McapMessage, McapReader
from sysid.data.dataset import Log
from sysid.estimation.bench_test import AxisBench
from sysid.monitor import tracking_metrics
from sysid.monitor.tracking_metrics import SteadyWindow
from sysid.reproduction import steady_flight
from sysid.reproduction.paper_poles import LOOPS

Array = NDArray[np.float64]

VEHICLE = "caribou_truth"
"""Simulated vehicle: it linearises to Table 1's adjusted column and has figure 7's bias."""
TRUTH_TOPIC = "/auv/truth"
"""Topic of the simulator's truth log."""
BENCH_AMPLITUDES_DEG = (10.0, 30.0)
"""Amplitudes of figure 4 (deg peak to peak)."""
FIGURE_7_MISSION = "rudder_bias_steps"
FIGURE_7_TRIM_DEG = 6.0
"""Trim (deg) about which the steps of figure 7 are commanded: 5 and 7 deg are -1 and +1 from it."""
STRAIGHT_RUN, SHALLOW_RUN = "straight_run", "shallow_1m"


class PaperRequest(NamedTuple):
    """Options of a reproduction."""

    folder: Path
    """Folder for the logs."""
    campaign: Path | None = None
    """Folder of a finished campaign with the paper's gains; None to fly one."""
    seed: int = 1
    jobs: int = 1
    """Number of dives of the campaign that run at the same time."""


class BiasSteps(NamedTuple):
    """Log of figure 7's dive and the true duct angle, which the autopilot does not know."""

    log: Log
    time_s: Array
    """Vehicle time of the true angles (s)."""
    rudder_rad: Array
    """True rudder (rad)."""


class PaperFlights(NamedTuple):
    """Results of all flights."""

    campaign: CampaignFolder
    bench: AxisBench
    """Bench test of the elevator."""
    bias_steps: BiasSteps

    def steady(
        self, role: str, mission: str = STRAIGHT_RUN, loops: Sequence[str] = LOOPS
    ) -> SteadyWindow:
        """Return the errors of a mission with one leg from the time when these loops are steady."""
        log = self.campaign.log(STAGES[role], mission)
        start_s = max(steady_flight.settling_s(loop) for loop in loops)
        return tracking_metrics.window(log, start_s, figures.end_s(log))


def fly(request: PaperRequest, watch: WatchCallback, announce: AnnounceCallback) -> PaperFlights:
    """Fly everything that the comparison needs.

    Parameters
    ----------
    request : PaperRequest
        Folder, campaign and seed.
    watch : WatchCallback
        Called with the name and the progress of each dive.
    announce : AnnounceCallback
        Called with what begins.

    Returns
    -------
    PaperFlights
        Logs and results.

    Raises
    ------
    InputError
        The given campaign is not one of Caribou with the paper's gains.
    OperationError
        A flight failed.
    """
    campaign = _campaign(request, watch, announce)
    announce("bench test of the elevator (figure 4)")
    measured = _bench(request, watch)
    announce("rudder steps about the bias (figure 7)")
    steps = _bias_steps(request, watch)
    return PaperFlights(campaign, measured, steps)


def _campaign(
    request: PaperRequest, watch: WatchCallback, announce: AnnounceCallback
) -> CampaignFolder:
    """Return the given campaign, or fly one."""
    if request.campaign is not None:
        return _checked(request.campaign)
    out = request.folder / "campaign"
    wanted = CampaignRequest(
        out=out,
        vehicle=VEHICLE,
        seed=request.seed,
        include_paper_gains=True,
        jobs=request.jobs,
    )
    Campaign(wanted, watch, announce).run()
    return CampaignFolder(out)


def _checked(path: Path) -> CampaignFolder:
    """Return a finished campaign of Caribou with the paper's gains. Raises InputError."""
    folder = CampaignFolder(path)
    if folder.prior != "caribou_nominal":
        raise InputError(f"--campaign {path}: flew {folder.prior}; the paper's vehicle is Caribou")
    if "improved" not in folder.summary.gains:
        raise InputError(
            f"--campaign {path}: has no dives with the paper's improved gains; fly it with"
            " --include-paper-gains"
        )
    return folder


def _bench(request: PaperRequest, watch: WatchCallback) -> AxisBench:
    """Measure the elevator on the bench."""
    folder = request.folder / "bench"
    folder.mkdir(parents=True)
    session = bench.Session(folder, axes=("elevator",), amplitudes_deg=BENCH_AMPLITUDES_DEG)
    simulation = Simulation(vehicle=VEHICLE, scenario="bench", seed=request.seed)
    result = bench.measure(
        session, SimulatedVehicle(simulation), lambda progress: watch("bench", progress)
    )
    return result["elevator"]


def _bias_steps(request: PaperRequest, watch: WatchCallback) -> BiasSteps:
    """Fly the steps of figure 7 and read the true duct angle."""
    truth = request.folder / "figure_7_truth.mcap"
    gains = refit.initial_gains() | {"TRIM_RUD_DEG": FIGURE_7_TRIM_DEG}
    log = _dive(request, FIGURE_7_MISSION, "disturbed", gains, watch, truth)
    return BiasSteps(refit.read_log(log), *_true_rudder(truth))


def _dive(
    request: PaperRequest,
    mission: str,
    scenario: str,
    parameters: Mapping[str, float],
    watch: WatchCallback,
    truth: Path | None = None,
) -> Path:
    """Fly one dive; return its log. Raises OperationError after a failsafe."""
    log = request.folder / f"{mission}_{scenario}.mcap"
    simulation = Simulation(vehicle=VEHICLE, scenario=scenario, seed=request.seed, truth=truth)
    outcome = flight.fly_simulated(
        Dive.load(mission, log, parameters=parameters),
        SimulatedVehicle(simulation),
        lambda progress: watch(mission, progress),
    )
    if outcome.failsafes:
        raise OperationError(f"{mission}: {outcome.failsafes[0]}")
    return log


def _true_rudder(path: Path) -> tuple[Array, Array]:
    """Return vehicle time (s) and rudder (rad) of a truth log."""
    rows: list[tuple[float, float]] = []
    with path.open("rb") as file:
        for item in McapReader(file, _is_truth).items():
            if isinstance(item, McapMessage):
                truth = json.loads(item.data)
                rows.append((1e-6 * truth["time_us"], truth["rudder_rad"]))
    time_s, rudder_rad = np.array(rows).reshape(-1, 2).T
    return time_s, rudder_rad


def _is_truth(channel: McapChannel) -> bool:
    """Return whether a channel is the truth."""
    return channel.topic == TRUTH_TOPIC
