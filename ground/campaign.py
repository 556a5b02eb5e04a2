"""Prototype, identify, redesign, verify: the paper's afternoon at sea as one command.

Each dive has its own pair of processes and its own log. A dive's seed depends on the campaign's seed and the mission
alone, so the initial and the redesigned gains meet the same sea. Dives that do not wait for one another fly two at a
time; vehicle time is lockstepped, so that changes nothing in any log.
"""

import importlib.metadata
import json
import platform
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, NamedTuple

from ground import refit, summary
from ground.errors import BadInputError, FailedError
from ground.flight import Dive, Outcome, Progress, fly_simulated
from ground.folder import CampaignFolder
from ground.processes import SimulatedVehicle, Simulation
from link.clock import wall_s

if TYPE_CHECKING:
    from sysid.design import Design

TRIM_MISSION = "trim"
MISSIONS = ("straight_run", "depth_change", "combined", "shallow_1m")
FITTED = ("rudder_steps", "elevator_steps", "rudder_sweeps", "elevator_sweeps")
"""The paper's steps, and the sweeps that tell what steps leave open: the dynamics near crossover."""
HELD_OUT = ("rudder_heldout", "elevator_heldout")
AT_ONCE = 2
"""Dives flown at the same time: a lockstepped pair keeps one core busy."""
CAMPAIGN_FILE = "campaign.toml"
TRIM_WINDOW_S = 60.0
"""The end of the trim mission over which the commands are averaged."""
_PACKAGES = ("numpy", "scipy", "numba", "control", "mcap", "pymavlink")


class Request(NamedTuple):
    """What is asked of a campaign."""

    out: Path
    vehicle: str = "field"
    scenario: str = "disturbed"
    seed: int = 1
    speed: str = "max"


Watch = Callable[[str, Progress], None]
"""Gets the name of a dive and where it stands."""
Announce = Callable[[str], None]
"""Gets what begins now, in words."""


@dataclass
class Campaign:
    """One campaign under way."""

    request: Request
    watch: Watch
    announce: Announce
    outcomes: dict[str, Outcome] = field(default_factory=dict)
    _afloat: list[SimulatedVehicle] = field(default_factory=list)
    _lock: Lock = field(default_factory=Lock)
    _cancelled: bool = False

    def run(self) -> dict[str, Any]:
        """The whole campaign; returns the summary that is also written. Raises BadInputError, FailedError."""
        began_s = wall_s()
        prepare_folder(self.request)
        with self._stopping_all():
            trims = self._measure_trims()
            initial = {**refit.initial_gains(), **trims}
            self.announce("flying the missions and the step tests with the initial gains")
            identification = [("identification", mission) for mission in (*FITTED, *HELD_OUT)]
            self._fly_all([*identification, *(("baseline", mission) for mission in MISSIONS)], initial)
            self.announce("refitting the model")
            design = self._redesign()
            self.announce("flying the missions with the redesigned gains")
            self._fly_all([("verification", mission) for mission in MISSIONS], {**design.gains, **trims})
        self.announce("comparing")
        gains = {"initial": initial, "redesigned": {**design.gains, **trims}}
        result = summary.build(self.folder, design, gains, trims, MISSIONS)
        flown = self.outcomes.values()
        result = {
            "wall_s": round(wall_s() - began_s, 3),
            "vehicle_s": round(sum(outcome.vehicle_s for outcome in flown), 3),
            "messages": sum(outcome.messages for outcome in flown),
            "lost_frames": sum(outcome.lost_frames for outcome in flown),
            "seed": self.request.seed,
            **result,
        }
        _write(self.request.out / "summary.json", json.dumps(result, indent=1) + "\n")
        return result

    @cached_property
    def folder(self) -> CampaignFolder:
        """What has been flown, read back."""
        return CampaignFolder(self.request.out)

    def _measure_trims(self) -> dict[str, float]:
        self.announce("prototype flight: measuring the trims")
        self._fly_all([("prototype", TRIM_MISSION)], refit.initial_gains())
        return refit.measure_trims(self.folder.log_path("prototype", TRIM_MISSION), TRIM_WINDOW_S)

    def _redesign(self) -> "Design":
        out = self.request.out
        fitted = [self.folder.log_path("identification", mission) for mission in FITTED]
        held_out = [self.folder.log_path("identification", mission) for mission in HELD_OUT]
        model = refit.refit(fitted, held_out=held_out, beside=("paper",))
        refit.write_model(model, out / "model.json")
        self.announce("redesigning the gains")
        design = refit.redesign(model)
        design.write_params(out / "gains.param")
        return design

    def _fly_all(self, dives: Sequence[tuple[str, str]], parameters: Mapping[str, float]) -> None:
        with ThreadPoolExecutor(AT_ONCE) as pool:
            flying = [pool.submit(self._fly, stage, mission, parameters) for stage, mission in dives]
            try:
                done, _ = wait(flying, return_when=FIRST_EXCEPTION)
                _raise_first(done)
            except BaseException:
                self._cancel(flying)
                raise

    def _fly(self, stage: str, mission: str, parameters: Mapping[str, float]) -> None:
        log = self.folder.log_path(stage, mission)
        log.parent.mkdir(exist_ok=True)
        name = f"{stage}/{mission}"
        simulated = self._launch(mission)
        notes = {"stage": stage, "seed": str(dive_seed(self.request.seed, mission))}
        outcome = fly_simulated(
            Dive.load(mission, log, parameters=parameters, notes=notes), simulated, lambda at: self.watch(name, at)
        )
        if outcome.failsafes:
            raise FailedError(f"{name}: {outcome.failsafes[0]}")
        self.outcomes[name] = outcome

    def _launch(self, mission: str) -> SimulatedVehicle:
        r = self.request
        with self._lock:
            if self._cancelled:
                raise FailedError("cancelled")
            simulated = SimulatedVehicle(Simulation(r.vehicle, r.scenario, dive_seed(r.seed, mission), r.speed))
            self._afloat.append(simulated)
        return simulated

    def _cancel(self, flying: Sequence[Future[None]]) -> None:
        for future in flying:
            future.cancel()
        with self._lock:
            self._cancelled = True
            for simulated in self._afloat:
                simulated.stop()

    @contextmanager
    def _stopping_all(self) -> Iterator[None]:
        try:
            yield
        finally:
            for simulated in self._afloat:
                simulated.stop()


def dive_seed(seed: int, mission: str) -> int:
    """The seed of a mission's sea: its own for every mission, the same for every set of gains."""
    return seed * 1000 + (TRIM_MISSION, *MISSIONS, *FITTED, *HELD_OUT).index(mission)


def prepare_folder(request: Request) -> None:
    """Make the campaign folder and note what was asked.

    Raises:
        BadInputError: the folder holds something that is no campaign.
    """
    out = request.out
    if out.is_file():
        raise BadInputError(f"--out {out}: is a file; give a folder")
    if out.is_dir() and any(out.iterdir()) and not (out / CAMPAIGN_FILE).is_file():
        raise BadInputError(f"--out {out}: holds files that are no campaign; give a new or an empty folder")
    out.mkdir(parents=True, exist_ok=True)
    _write(out / CAMPAIGN_FILE, _campaign_toml(request))


def _campaign_toml(request: Request) -> str:
    asked = {"vehicle": request.vehicle, "scenario": request.scenario, "speed": request.speed}
    lines = [f"{key} = {json.dumps(value)}" for key, value in asked.items()]
    lines += [f"seed = {request.seed}", "", "[seeds]"]
    lines += [f"{m} = {dive_seed(request.seed, m)}" for m in (TRIM_MISSION, *MISSIONS, *FITTED, *HELD_OUT)]
    lines += ["", "[versions]", f"python = {json.dumps(platform.python_version())}"]
    lines += [f"{package} = {json.dumps(importlib.metadata.version(package))}" for package in _PACKAGES]
    return "\n".join(lines) + "\n"


def _raise_first(done: set[Future[None]]) -> None:
    """Raise what made a dive fail; a cancelled dive is a consequence, not a cause."""
    for future in done:
        if (error := future.exception()) is not None:
            raise error


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
