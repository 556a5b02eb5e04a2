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
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

# As in the ``ground`` command: one thread of linear algebra, and no traceback of Ctrl-C during the
# imports.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_DFL)

from ground.campaign import prototype, refit
from ground.campaign.campaign_folder import CampaignFolder
from ground.campaign.dives import CampaignDives
from ground.campaign.preparation import PreparationRequest, prepare
from ground.campaign.request import CampaignRequest
from ground.errors import INTERRUPTED
from mavlink_io.clock import wall_s
from mavlink_io.errors import CaribouError
from sysid.refit import RefitRequest

TESTS = ("rudder_sweeps", "elevator_sweeps")
"""Shortest test mission of each plane."""
STAGE = "prototype"
"""Folder of the logs: that of dives before a refit."""
STEADY = "straight_run"
"""Mission with steady windows, whose performance is compared with the predicted one."""
OTHER_VEHICLE = "xfin_auv"
"""Vehicle whose missions are simulated without processes; those of Caribou are not."""
MISSIONS = ("shallow_1m", "rudder_sweeps")
"""Missions of that simulation: the shortest one, and the shortest with tests."""


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
    logs = _fly(request)
    steady_log = logs.pop()
    prior = prototype.prior_file_of(request.vehicle)
    prepare(
        PreparationRequest(
            vehicle=OTHER_VEHICLE,
            scenario=request.scenario,
            truth=OTHER_VEHICLE,
            seed=request.seed,
            missions=MISSIONS,
        ),
        announce=lambda _: None,
    )
    # Two logs may be too few for the checks of a campaign, which have no kernels: use force.
    model = refit.refit(
        RefitRequest(paths=logs, prior=prior, alternative_methods=("paper",)), force=True
    )
    design = refit.redesign(model, prior=prior, force=True)
    refit.monitor_log(refit.read_log(steady_log), design.baseline)


def _fly(request: CampaignRequest) -> list[Path]:
    """Fly the test missions and the steady one as a campaign does; return their logs."""
    dives = CampaignDives(request, watch=lambda *_: None, announce=lambda _: None)
    dives.open_records()
    parameters = {**refit.initial_gains(), **prototype.trim_learning_for(request.vehicle)}
    missions = *TESTS, STEADY
    with ThreadPoolExecutor(len(TESTS)) as pool:
        flown = [pool.submit(dives.fly, STAGE, mission, parameters) for mission in missions]
        try:
            for dive in flown:
                dive.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            dives.stop_all()
            raise
    return [CampaignFolder(request.out).log_path(STAGE, mission) for mission in missions]


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
