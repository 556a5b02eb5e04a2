"""Prototype, identify, redesign, verify: the paper's afternoon at sea as one command.

Each dive has its own pair of processes and its own log. A dive's seed depends on the campaign's
seed and the mission alone, so the initial and the redesigned gains meet the same sea. What does not
wait for something else goes on two at a time, a dive or a computation: vehicle time is lockstepped,
so that changes nothing in any log."""

import importlib.metadata
import json
import platform
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, Executor, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import Any, NamedTuple

from ground.campaign import prototype, readiness, refit, summary
from ground.campaign.campaign_folder import CAMPAIGN_FILE, STAGES, CampaignFolder
from ground.campaign.worker import Worker
from ground.client.flight import Dive, FlightProgress, FlightResult, fly_simulated
from ground.errors import InputError, OperationError
from ground.report import page
from ground.simulation.processes import SimulatedVehicle, Simulation
from ground.simulation.subprocesses import ForkedProcess
from mavlink_io.clock import wall_s

TRIM_MISSION = "trim"
MISSIONS = ("straight_run", "depth_change", "combined", "shallow_1m")
FITTED = ("rudder_steps", "elevator_steps", "rudder_sweeps", "elevator_sweeps")
"""The paper's steps, and the sweeps that tell what steps leave open: the dynamics near
crossover."""
HELD_OUT = ("rudder_heldout", "elevator_heldout")
IDENTIFICATION = (*FITTED[:2], *HELD_OUT, *FITTED[2:])
"""In the order of flying, the longest first: so both places are busy until the last."""
ALL_MISSIONS = (TRIM_MISSION, *IDENTIFICATION, *MISSIONS)
DIVES = {
    "prototype": (TRIM_MISSION,),
    "identification": IDENTIFICATION,
    **dict.fromkeys(STAGES.values(), MISSIONS),
}
"""Missions by the folder in which their logs are kept."""
RESULTS = ("report.html", "summary.json")
"""Files that only a campaign which came to its end has."""
PARALLEL_DIVES = 2
"""Dives and computations that go on at the same time: each keeps about one core busy."""
TRIM_WINDOW_S = 60.0
"""The end of the trim mission over which the commands are averaged."""
PRELOADED_MODULES = (
    "sysid.refit",
    "sysid.design.pid",
    "sysid.data.readers",
    "sysid.monitor.tracking_metrics",
)
"""What the computations need, loaded while the trims are measured."""
_PACKAGES = ("numpy", "scipy", "numba", "control", "mcap", "pymavlink")


class CampaignRequest(NamedTuple):
    """What is asked of a campaign."""

    out: Path
    vehicle: str = "caribou_truth"
    scenario: str = "disturbed"
    seed: int = 1
    speed: str = "max"
    include_paper_gains: bool = False
    """The paper's improved gains fly the missions too."""
    force: bool = False
    """Replace the campaign that the folder holds."""


WatchCallback = Callable[[str, FlightProgress], None]
"""Gets the name of a dive and where it stands."""
AnnounceCallback = Callable[[str], None]
"""Gets what begins now, in words."""


@dataclass
class Campaign:
    """One campaign under way."""

    request: CampaignRequest
    watch: WatchCallback
    announce: AnnounceCallback
    outcomes: dict[str, FlightResult] = field(default_factory=dict)
    _afloat: list[SimulatedVehicle] = field(default_factory=list)
    _lock: Lock = field(default_factory=Lock)
    _cancelled: bool = False
    _prepared: bool = False

    def run(self) -> dict[str, Any]:
        """The whole campaign; returns the summary that is also written. Raises BadInputError,
        FailedError."""
        refuse_folder(self.request)
        try:
            return self._run()
        except BaseException:
            # stopped between the summary and the report: neither may tell of a campaign that is
            # complete
            for name in RESULTS if self._prepared else ():
                (self.request.out / name).unlink(missing_ok=True)
            raise

    def _run(self) -> dict[str, Any]:
        began_s = wall_s()
        with self._at_work() as (places, worker):
            first = self._first_parameters(worker)
            self._prepare()
            trims = self._measure_trims(places, worker, first)
            gains = self._first_gains(first, trims)
            self.announce("flying the tests with the initial gains")
            _finish_dives(self._begin(places, "identification", IDENTIFICATION, gains["initial"]))
            self.announce(
                f"refitting the model; flying the missions with the {' and the '.join(gains)} gains"
            )
            redesigning = places.submit(self._redesign, worker)
            missions = [
                dive
                for name in gains
                for dive in self._begin(places, STAGES[name], MISSIONS, gains[name])
            ]
            design = redesigning.result()
            self.announce("flying the missions with the redesigned gains")
            gains["redesigned"] = {
                **design["gains"],
                **_beside(design["gains"], gains["initial"]),
                **trims,
            }
            _finish_dives(
                [
                    *missions,
                    *self._begin(places, STAGES["redesigned"], MISSIONS, gains["redesigned"]),
                ]
            )
            self.announce("comparing")
            found = worker.call(summary.build, self.folder, design, gains, trims, MISSIONS)
            result = {**self._account(wall_s() - began_s), **found}
            _write(self.request.out / "summary.json", json.dumps(result, indent=1) + "\n")
            self.announce("writing the report")
            worker.call(_report, self.folder)
        return result

    def _prepare(self) -> None:
        prepare_folder(self.request)
        self._prepared = True

    @cached_property
    def folder(self) -> CampaignFolder:
        """What has been flown, read back."""
        return CampaignFolder(self.request.out)

    def _first_parameters(self, worker: Worker) -> dict[str, float]:
        """Return the parameters of the first dive: Table 3 for Caribou, a prototype design for
        other vehicles.

        Raises BadInputError where it can be foreseen that the campaign cannot be completed.
        """
        vehicle, scenario = self.request.vehicle, self.request.scenario
        content = readiness.scenario_content(scenario)
        readiness.check_scenario(scenario, content, ALL_MISSIONS)
        if vehicle in prototype.CARIBOU:
            return refit.initial_gains()
        if self.request.include_paper_gains:
            raise InputError(
                "--include-paper-gains: the paper's gains are for Caribou; "
                f"leave it out for {vehicle}"
            )
        self.announce("designing the first gains; rehearsing the missions with the vehicle file")
        return worker.call(readiness.first_parameters, vehicle, scenario, content, ALL_MISSIONS)

    def _first_gains(
        self, first: Mapping[str, float], trims: Mapping[str, float]
    ) -> dict[str, dict[str, float]]:
        """The sets of gains that are there before any model, by name."""
        gains = {"initial": {**first, **trims}}
        if self.request.include_paper_gains:
            gains["improved"] = {**refit.improved_gains(), **trims}
        return gains

    def _account(self, spent_s: float) -> dict[str, Any]:
        """What was flown, and in what time."""
        flown = self.outcomes.values()
        return {
            "wall_s": round(spent_s, 3),
            "vehicle_s": round(sum(outcome.vehicle_s for outcome in flown), 3),
            "messages": sum(outcome.messages for outcome in flown),
            "lost_frames": sum(outcome.lost_frames for outcome in flown),
            "seed": self.request.seed,
        }

    def _measure_trims(
        self, places: Executor, worker: Worker, first: Mapping[str, float]
    ) -> dict[str, float]:
        self.announce("prototype flight: measuring the trims")
        _finish_dives(self._begin(places, "prototype", (TRIM_MISSION,), first))
        return worker.call(
            refit.measure_trims, self.folder.log_path("prototype", TRIM_MISSION), TRIM_WINDOW_S
        )

    def _redesign(self, worker: Worker) -> dict[str, Any]:
        worker.call(_identify, self.folder)
        self.announce("redesigning the gains")
        return worker.call(_design, self.folder)

    def _begin(
        self, places: Executor, stage: str, missions: Sequence[str], parameters: Mapping[str, float]
    ) -> list[Future[None]]:
        return [places.submit(self._fly, stage, mission, parameters) for mission in missions]

    def _fly(self, stage: str, mission: str, parameters: Mapping[str, float]) -> None:
        log = self.folder.log_path(stage, mission)
        log.parent.mkdir(exist_ok=True)
        name = f"{stage}/{mission}"
        notes = {"stage": stage, "seed": str(dive_seed(self.request.seed, mission))}
        dive = Dive.load(mission, log, parameters=parameters, notes=notes)
        outcome = fly_simulated(dive, self._launch(mission), lambda at: self.watch(name, at))
        if outcome.failsafes:
            raise OperationError(f"{name}: {outcome.failsafes[0]}")
        self.outcomes[name] = outcome

    def _launch(self, mission: str) -> SimulatedVehicle:
        r = self.request
        with self._lock:
            if self._cancelled:
                raise OperationError("cancelled")
            simulation = Simulation(r.vehicle, r.scenario, dive_seed(r.seed, mission), r.speed)
            simulated = SimulatedVehicle(simulation, start=ForkedProcess)
            self._afloat.append(simulated)
        return simulated

    @contextmanager
    def _at_work(self) -> Iterator[tuple[Executor, Worker]]:
        """Places for dives and computations, and who computes; in the end all are free, whatever
        was under way."""
        with ExitStack() as stack:
            places = stack.enter_context(ThreadPoolExecutor(PARALLEL_DIVES))
            worker = stack.enter_context(Worker(PRELOADED_MODULES))
            stack.callback(self._stop_all)
            stack.callback(places.shutdown, wait=False, cancel_futures=True)
            yield places, worker

    def _stop_all(self) -> None:
        with self._lock:
            self._cancelled = True
            for simulated in self._afloat:
                simulated.stop()


def dive_seed(seed: int, mission: str) -> int:
    """The seed of a mission's sea: its own for every mission, the same for every set of gains."""
    return seed * 1000 + (TRIM_MISSION, *MISSIONS, *FITTED, *HELD_OUT).index(mission)


def refuse_folder(request: CampaignRequest) -> None:
    """Raise BadInputError where the folder cannot take this campaign: a file, other files, or a
    campaign to keep."""
    out = request.out
    if out.is_dir():
        if any(out.iterdir()) and not (out / CAMPAIGN_FILE).is_file():
            raise InputError(
                f"--out {out}: holds files that are no campaign; give a new or an empty folder"
            )
        if (out / CAMPAIGN_FILE).is_file() and not request.force:
            state = (
                "a finished"
                if all((out / name).is_file() for name in RESULTS)
                else "an interrupted"
            )
            logs = sum(path.suffix == ".mcap" for path in _campaign_files(out))
            raise InputError(
                f"--out {out}: holds {state} campaign ({logs} logs); give a new folder, or --force"
                " to replace it"
            )
    elif out.exists():
        raise InputError(f"--out {out}: is a file; give a folder")


def prepare_folder(request: CampaignRequest) -> None:
    """Make the campaign folder, remove the campaign that it replaces, and note what was asked.

    Files that no campaign writes stay. Raises BadInputError as ``refuse_folder``.
    """
    refuse_folder(request)
    out = request.out
    for path in _campaign_files(out):
        path.unlink()
    for stage in DIVES:
        if (out / stage).is_dir() and not any((out / stage).iterdir()):
            (out / stage).rmdir()
    out.mkdir(parents=True, exist_ok=True)
    _write(out / CAMPAIGN_FILE, _campaign_toml(request))


def _campaign_files(out: Path) -> list[Path]:
    """Return the files in a folder that a campaign writes; the note of what was asked comes
    last."""
    logs = [
        CampaignFolder(out).log_path(stage, name)
        for stage, names in DIVES.items()
        for name in names
    ]
    results = [out / name for name in (*RESULTS, "model.json", "gains.param", CAMPAIGN_FILE)]
    return [path for path in (*logs, *results) if path.is_file() or path.is_symlink()]


def _campaign_toml(request: CampaignRequest) -> str:
    asked = request._asdict()
    lines = [
        f"{key} = {json.dumps(value)}"
        for key, value in asked.items()
        if key not in ("out", "force")
    ]
    lines += ["", "[seeds]"]
    lines += [
        f"{m} = {dive_seed(request.seed, m)}" for m in (TRIM_MISSION, *MISSIONS, *FITTED, *HELD_OUT)
    ]
    lines += ["", "[versions]", f"python = {json.dumps(platform.python_version())}"]
    lines += [
        f"{package} = {json.dumps(importlib.metadata.version(package))}" for package in _PACKAGES
    ]
    return "\n".join(lines) + "\n"


def _beside(designed: Mapping[str, float], flown: Mapping[str, float]) -> dict[str, float]:
    """Return the parameters that were flown and that a redesign does not set: trims, travel, cruise
    speed."""
    return {name: value for name, value in flown.items() if name not in designed}


def _identify(folder: CampaignFolder) -> None:
    """Write ``model.json``."""
    fitted, held_out = (
        [folder.log_path("identification", name) for name in names] for names in (FITTED, HELD_OUT)
    )
    model = refit.refit(fitted, held_out=held_out, prior=folder.prior, beside=("paper",))
    refit.write_model(model, folder.path / "model.json")


def _design(folder: CampaignFolder) -> dict[str, Any]:
    """Write ``gains.param``; returns what there is to tell of them."""
    design = refit.redesign(folder.model, prior=folder.prior)
    design.write_params(folder.path / "gains.param")
    return summary.summarise_design(design)


def _report(folder: CampaignFolder) -> None:
    """Write ``report.html``."""

    page.write(folder)


def _finish_dives(dives: Sequence[Future[None]]) -> None:
    """Wait for the dives, or raise what makes the first of them fail."""
    done, _ = wait(dives, return_when=FIRST_EXCEPTION)
    for dive in done:
        dive.result()


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
