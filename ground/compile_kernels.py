"""Compile every kernel that a campaign uses, so that no campaign waits for the compiler.

    python -m ground.compile_kernels

Numba stores the machine code of a kernel on disk, keyed by the content of its source. This program
takes each step of a campaign once, in the same processes: the simulated mission by which a campaign
checks a new vehicle, a test dive for each plane, a refit with the paper's method for comparison, a
redesign and a comparison with the predicted performance. A new kernel that one of these steps calls
is compiled too; no list of kernels has to be kept.
"""

import os
import signal
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from pathlib import Path

# As in the ``ground`` command: one thread of linear algebra, and no traceback of Ctrl-C during the
# imports.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_DFL)

from ground.campaign import prototype, refit
from ground.campaign.preparation import PreparationRequest, prepare
from ground.campaign.request import CampaignRequest, dive_seed
from ground.client.flight import Dive, fly_simulated
from ground.errors import INTERRUPTED
from ground.simulation.processes import SimulatedVehicle, Simulation
from ground.simulation.subprocesses import ForkedProcess, stop_loading_fork_server
from mavlink_io.clock import wall_s
from mavlink_io.errors import CaribouError
from sysid.refit import RefitRequest

TESTS = ("rudder_sweeps", "elevator_sweeps")
"""Shortest test mission of each plane."""
STEADY = "straight_run"
"""Mission with steady windows, whose performance is compared with the predicted one."""
OTHER_VEHICLE = "xfin_auv"
"""Vehicle whose missions are simulated without processes; those of Caribou are not."""
MISSIONS = ("shallow_1m", "rudder_sweeps")
"""Missions of that simulation: the shortest one, and the shortest with tests."""


STOP_PERIOD_S = 0.2
"""Wall time after which dives that still run are stopped again: one may have started meanwhile."""


def compile_kernels(folder: Path) -> None:
    """Simulate, fly, refit, redesign and compare once.

    Parameters
    ----------
    folder : Path
        Existing folder for the logs.

    Raises
    ------
    InputError, OperationError
        A step fails.
    """
    request = CampaignRequest(folder)
    simulated: list[SimulatedVehicle] = []
    with ThreadPoolExecutor(len(TESTS)) as pool:
        dives = [pool.submit(_fly, request, mission, simulated) for mission in (*TESTS, STEADY)]
        try:
            *logs, steady_log = [dive.result() for dive in dives]
        except BaseException:
            _stop(dives, simulated)
            raise
    prior = prototype.prior_file_of(request.vehicle)
    prepare(
        PreparationRequest(
            vehicle=OTHER_VEHICLE,
            scenario=request.scenario,
            truth=OTHER_VEHICLE,
            seed=request.seed,
            missions=MISSIONS,
        )
    )
    # Two logs may be too few for the checks of a campaign, which have no kernels: use force.
    model = refit.refit(
        RefitRequest(paths=logs, prior=prior, alternative_methods=("paper",)), force=True
    )
    design = refit.redesign(model, prior=prior, force=True)
    refit.monitor_log(refit.read_log(steady_log), design.baseline)


def _fly(request: CampaignRequest, mission: str, simulated: list[SimulatedVehicle]) -> Path:
    """Fly a mission with the vehicle and the scenario of a campaign; return the log.

    The vehicle is added to `simulated`.
    """
    simulation = Simulation(
        vehicle=request.vehicle, scenario=request.scenario, seed=dive_seed(request.seed, mission)
    )
    parameters = {**refit.initial_gains(), **prototype.trim_learning_for(request.vehicle)}
    dive = Dive.load(mission, request.out / f"{mission}.mcap", parameters=parameters)
    vehicle = SimulatedVehicle(simulation, start=ForkedProcess)
    simulated.append(vehicle)
    return fly_simulated(dive, vehicle).log


def _stop(dives: Sequence[Future[Path]], simulated: Sequence[SimulatedVehicle]) -> None:
    """Stop the dives, also those whose start waits for the compilation of the simulator."""
    for dive in dives:
        dive.cancel()
    while wait(dives, timeout=STOP_PERIOD_S).not_done:
        stop_loading_fork_server()
        for vehicle in simulated:
            vehicle.stop()


def main() -> None:
    """Compile the kernels; print the time that it took, or the reason of a failure.

    Exit status 130 after Ctrl-C.
    """
    start_s = wall_s()
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        with tempfile.TemporaryDirectory() as folder:
            compile_kernels(Path(folder))
    except CaribouError as error:
        sys.exit(f"compile_kernels: {error}; each kernel is compiled at its first use instead")
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    sys.stdout.write(f"kernels of a campaign compiled in {wall_s() - start_s:.0f} s\n")


if __name__ == "__main__":
    main()
