"""Campaign: trim flight, identification tests, refit, redesign and verification in one command.

Each dive has its own simulator and autopilot process and its own log. The seed of a dive depends
only on the seed of the campaign and on the mission, so that all sets of gains are flown in the same
sea. As many dives or computations run at the same time as there are cores; vehicle time is in
lockstep, so this does not change the logs. Besides, one process reads each log when its dive ends
and prepares the report while the last dives are under way. A campaign that was killed is resumed:
dives that are recorded as finished are not flown again; all computations are repeated.
"""

import importlib.metadata
import json
import platform
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, Executor, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import Lock
from typing import NamedTuple, ParamSpec

import msgspec

from ground.campaign import computations, prototype, refit, summary, summary_file
from ground.campaign.campaign_folder import (
    CAMPAIGN_FILE,
    MISSIONS_FOLDER,
    SCENARIO_FILE,
    STAGES,
    TRUTH_FILE,
    CampaignFolder,
)
from ground.campaign.computations import FITTED, HELD_OUT, MISSIONS, RETESTS, RetestRecord
from ground.campaign.dive_records import (
    AFLOAT,
    RECORDS_FILE,
    DiveRecord,
    DiveRecords,
    digest_request,
    temporary_name,
    write_whole,
)
from ground.campaign.preparation import Preparation, PreparationRequest, prepare
from ground.campaign.summary_file import CampaignSummary, DesignSummary, RetestSummary
from ground.campaign.worker import Worker
from ground.client.assessment import assess_log
from ground.client.dive_symptoms import Symptom, SymptomKind
from ground.client.flight import Dive, FlightProgress, TelemetryListener, fly_simulated
from ground.missions import scaling, script
from ground.simulation.processes import SimulatedVehicle, Simulation
from ground.simulation.subprocesses import ForkedProcess, start_fork_server
from mavlink_io.clock import wall_s
from mavlink_io.errors import CaribouError, ErrorCode, InputError, OperationError
from mavlink_io.mission_items import MissionItem
from sysid.data import readers

TRIM_MISSION = "trim"
"""Straight and level mission from which the trims are measured."""
IDENTIFICATION = (*FITTED[:2], *HELD_OUT, *FITTED[2:])
"""Test missions in the order of flying, longest first, so that all cores finish together."""
DEFAULT_EXTRA_WATER_S = 1800.0
"""Default of the vehicle time for recommended tests (s)."""
ALL_MISSIONS = (TRIM_MISSION, *IDENTIFICATION, *MISSIONS)
DIVES = {
    "prototype": (TRIM_MISSION,),
    "identification": (*IDENTIFICATION, *RETESTS),
    **dict.fromkeys(STAGES.values(), MISSIONS),
}
"""Missions by the folder of their logs."""
RESULTS = ("report.html", "summary.json")
"""Files that only a finished campaign has."""
TRIM_WINDOW_S = 60.0
"""Time at the end of the trim mission over which the surface commands are averaged."""
PRELOADED_MODULES = (
    "sysid.refit",
    "sysid.design.pid",
    "sysid.data.readers",
    "sysid.monitor.tracking_metrics",
)
"""Modules of the computations, which the worker loads during the trim flight."""
REPORT_MODULES = ("ground.report.page", "control")
"""Modules of the report, which the worker loads during the tests."""
MAX_REPETITIONS, SMALLER_TESTS = 3, 0.6
"""Number of repetitions of an identification dive that ends with a failsafe, and the factor on the
size of its tests and on the pitch that ends them. The flown vehicle can turn more tightly than the
one of the vehicle file; an unstable one reaches the largest pitch with a test of any size."""
PITCH_LIMIT, PITCH_LIMIT_DEG = "SID_PITCH_MAX", 35.0
"""Parameter of the pitch that ends a test, and its default in the autopilot (deg)."""
DIVE_PITCH, DIVE_PITCH_DEG, MIN_DIVE_PITCH_DEG = "PTCH_LIM_DEG", 20.0, 8.0
"""Parameter of the largest pitch set-point, its default in the autopilot, and the smallest value in
a repetition (deg): at a lower one a buoyant vehicle may not leave the surface."""
DIVE_RATE = "DPT_REF_RATE"
"""Parameter of the largest rate of the depth reference, which needs a pitch in proportion."""
TURN_RATE, MIN_TURN_RATE_DEGPS = "HDG_REF_RATE", 3.0
"""Parameter of the largest rate of the heading reference, and its smallest value in a repetition
(deg/s): a turn of 80 deg then takes half of the shortest legs."""
TAUGHT_REASONS = {
    DIVE_PITCH: "with a larger one a dive of the campaign ended with a failsafe",
    DIVE_RATE: f"slower in proportion to the smaller {DIVE_PITCH}",
    TURN_RATE: "at a larger one the rudder did not end a turn of a mission of the campaign",
}
"""Reasons, in `gains.param`, of the parameters that failsafes have changed."""
MAX_ANGLE_DEG = 90.0
"""Largest size of a test (deg): without effect, because tests are only made smaller."""
_PACKAGES = ("numpy", "scipy", "numba", "control", "mcap", "pymavlink")


class CampaignRequest(NamedTuple):
    """Options of a campaign."""

    out: Path
    vehicle: str = "caribou_truth"
    scenario: str = "disturbed"
    seed: int = 1
    speed: str = "max"
    include_paper_gains: bool = False
    """Whether to fly the missions also with the paper's improved gains."""
    force: bool = False
    """Replace the campaign that is in the folder."""
    resume: bool = False
    """Continue the campaign that is in the folder; begin it if the folder is empty."""
    jobs: int = 1
    """Number of dives and computations that run at the same time; each uses about one core."""
    truth: str = ""
    """Vehicle file that is flown, or `perturbed`; empty: `prototype.default_truth`."""
    extra_water_s: float = DEFAULT_EXTRA_WATER_S
    """Vehicle time for the tests that the assessment recommends for a model that is not fit (s)."""

    @property
    def flown_vehicle(self) -> str:
        """Vehicle file that is flown, or `perturbed`."""
        return self.truth or prototype.default_truth(self.vehicle)


P = ParamSpec("P")
WatchCallback = Callable[[str, FlightProgress], None]
"""Called with the name and the progress of a dive."""
AnnounceCallback = Callable[[str], None]
"""Called with a text about what begins."""
ListenCallback = Callable[[str, Sequence[MissionItem]], TelemetryListener]
"""Called with the name and the mission of a dive; returns the listener to its telemetry."""


@dataclass
class Campaign:
    """A running campaign."""

    request: CampaignRequest
    watch: WatchCallback
    announce: AnnounceCallback
    listen: ListenCallback | None = None
    outcomes: dict[str, DiveRecord] = field(default_factory=dict)
    retests: list[RetestSummary] = field(default_factory=list)
    _simulated: list[SimulatedVehicle] = field(default_factory=list)
    _lock: Lock = field(default_factory=Lock)
    _cancelled: bool = False
    _prepared: bool = False
    _records: DiveRecords = field(init=False)

    def run(self) -> CampaignSummary:
        """Run the campaign; write and return the summary. Raises InputError, OperationError."""
        refuse_folder(self.request)
        if self.request.resume and is_finished(self.request.out):
            return summary_file.read(self.request.out / "summary.json")
        try:
            result = self._run()
        except BaseException:
            # Stopped between summary and report: neither may look like that of a finished campaign.
            for name in RESULTS if self._prepared else ():
                (self.request.out / name).unlink(missing_ok=True)
            raise
        self._records.remove()
        return result

    def _run(self) -> CampaignSummary:
        """Run all stages; return the summary."""
        start_s = wall_s()
        with self._executors() as executors:
            dives, worker = executors.dives, executors.worker
            preparation = self._prepare()
            first = preparation.parameters
            trims = self._measure_trims(executors, first)
            gains = self._first_gains(first, trims)
            self.announce("flying the tests with the initial gains")
            tests = self._begin(dives, "identification", IDENTIFICATION, gains["initial"])
            executors.call_ahead(computations.load_modules, REPORT_MODULES)
            self._read_ahead(executors, "identification", IDENTIFICATION, tests)
            baseline = [(name, mission) for name in gains for mission in MISSIONS]
            # Slots that the last tests leave free fly missions; the last test's slot refits.
            early = self.request.jobs - 1
            missions = self._begin_missions(dives, baseline[:early], gains)
            _finish_dives(tests)
            untaught, gains = gains, self._limit_as_taught(gains)
            if self._records.afloat_attempts() or gains != untaught:
                wait(missions)
                missions = self._begin_missions(dives, baseline[:early], gains)
            self.announce(
                f"refitting the model; flying the missions with the {' and the '.join(gains)} gains"
            )
            untrimmed = {name: value for name, value in first.items() if name not in trims}
            redesigning = dives.submit(self._redesign, worker, untrimmed, untaught["initial"])
            missions += self._begin_missions(dives, baseline[early:], gains)
            design = redesigning.result()
            self.announce("flying the missions with the redesigned gains")
            redesigned = {
                **design.gains,
                **_not_designed(design.gains, untaught["initial"]),
                **trims,
            }
            gains |= self._limit_as_taught({"redesigned": redesigned})
            verification = [("redesigned", mission) for mission in MISSIONS]
            missions += self._begin_missions(dives, verification, gains)
            executors.call_ahead(computations.prepare_report, self.request.out, design, gains)
            for (name, mission), dive in zip([*baseline, *verification], missions, strict=True):
                self._read_ahead(executors, STAGES[name], (mission,), (dive,))
            gains = self._finish_missions(dives, missions, gains)
            taught = {
                name: value
                for name, value in gains["redesigned"].items()
                if name in TAUGHT_REASONS and value != redesigned.get(name)
            }
            if taught:
                reasons = {name: TAUGHT_REASONS[name] for name in taught}
                design = worker.call(
                    computations.add_parameters, self.request.out, design, taught, reasons
                )
            self.announce("comparing")
            result = worker.call(
                computations.compare, self.request.out, self._totals(), design, gains, trims
            )
            result = msgspec.structs.replace(
                result, wall_s=round(wall_s() - start_s, 3), retests=tuple(self.retests)
            )
            summary_file.write(result, self.request.out / "summary.json")
            self.announce("writing the report")
            worker.call(computations.report, self.request.out)
        return result

    def _prepare(self) -> Preparation:
        """Prepare the folder; return the parameters of the first dive and what was scaled.

        The parameters are the paper's Table 3 for Caribou, and a prototype design for other
        vehicles. Raises InputError if a check shows that the campaign cannot be completed.
        """
        r = self.request
        if r.vehicle not in prototype.CARIBOU:
            if r.include_paper_gains:
                raise InputError(
                    "--include-paper-gains: the paper's gains are for Caribou; "
                    f"leave it out for {r.vehicle}"
                )
            self.announce("designing the first gains; adapting the missions in simulation")
        asked = PreparationRequest(
            vehicle=r.vehicle,
            scenario=r.scenario,
            truth=r.flown_vehicle,
            seed=r.seed,
            missions=ALL_MISSIONS,
        )
        preparation = prepare(asked)
        self._write_folder(preparation)
        for note in preparation.notes:
            self.announce(note)
        return preparation

    def _write_folder(self, preparation: Preparation) -> None:
        """Prepare the folder and write the files of a preparation."""
        prepare_folder(self.request, preparation.notes)
        self._prepared = True
        self._records = DiveRecords(self.request.out)
        for name, text in preparation.files.items():
            path = self.request.out / name
            path.parent.mkdir(exist_ok=True)
            write_whole(path, text)
        for mission in ALL_MISSIONS:
            if f"{MISSIONS_FOLDER}/{mission}.toml" not in preparation.files:
                (self.request.out / MISSIONS_FOLDER / f"{mission}.toml").unlink(missing_ok=True)
        for mission in IDENTIFICATION:
            self._repeat_reductions(mission)
        self.outcomes.update(self._records.afloat_attempts())
        self._speed_up_descents()

    def _repeat_reductions(self, mission: str) -> None:
        """Make the tests of a mission as small as they were after the failsafes of its dives."""
        attempts = self._records.failed_attempts(f"identification/{mission}")
        for _ in range(min(len(attempts), MAX_REPETITIONS)):
            self._shrink_tests(mission)

    def _first_gains(
        self, first: Mapping[str, float], trims: Mapping[str, float]
    ) -> dict[str, dict[str, float]]:
        """Return the sets of gains that need no model, by name."""
        gains = {"initial": {**first, **trims}}
        if self.request.include_paper_gains:
            gains["improved"] = {**refit.improved_gains(), **trims}
        return gains

    def _totals(self) -> summary.Totals:
        """Return the totals of the dives."""
        results = self.outcomes.values()
        return summary.Totals(
            vehicle_s=round(sum(outcome.vehicle_s for outcome in results), 3),
            messages=sum(outcome.messages for outcome in results),
            lost_frames=sum(outcome.lost_frames for outcome in results),
            seed=self.request.seed,
        )

    def _measure_trims(
        self, executors: "_Executors", first: Mapping[str, float]
    ) -> dict[str, float]:
        """Fly the trim mission; return the trim parameters."""
        self.announce("prototype flight: measuring the trims")
        _finish_dives(self._begin(executors.dives, "prototype", (TRIM_MISSION,), first))
        log = CampaignFolder(self.request.out).log_path("prototype", TRIM_MISSION)
        return executors.worker.call(refit.measure_trims, log, TRIM_WINDOW_S)

    def _redesign(
        self, worker: Worker, first: Mapping[str, float], flown: Mapping[str, float]
    ) -> DesignSummary:
        """Refit, fly the recommended tests, and redesign; return the summary of the design.

        `first` are the first gains without trims, and `flown` these gains with the measured ones.
        """
        self._identify(worker, flown)
        self.announce("redesigning the gains")
        return worker.call(computations.design, self.request.out, first)

    def _identify(self, worker: Worker, flown: Mapping[str, float]) -> None:
        """Refit; while the model is not fit and water time is left, fly the recommended test."""
        out, left_s, records = self.request.out, self.request.extra_water_s, list[RetestRecord]()
        assessment = worker.call(computations.identify, out)
        for mission in RETESTS:
            if assessment is None or assessment.fit_for_redesign:
                return
            if assessment.next_test is None:
                self.announce(f"not fit, and no test can make it fit: {assessment.obstacle}")
                return
            recommended = assessment.next_test
            dive = worker.call(computations.plan_retest, out, recommended, mission)
            if dive is None:
                return
            if dive.planned_s > left_s:
                self.announce(
                    f"not fit: {recommended.reason}; {recommended} needs {dive.planned_s:.0f} s of"
                    f" the {max(left_s, 0.0):.0f} s left (--extra-water-time)"
                )
                return
            self._write_mission(mission, dive.script)
            self._speed_up_descents()
            self._repeat_reductions(mission)
            self.announce(f"not fit: {recommended.reason}; flying {recommended}")
            failures = len(self._records.failed_attempts(f"identification/{dive.base}"))
            taught = _limit_dives(flown, self._taught_repetitions())
            self._fly("identification", mission, _limit_tests(taught, failures))
            flown_s = self.outcomes[f"identification/{mission}"].vehicle_s
            left_s -= flown_s
            records.append(RetestRecord(mission, dive.held_out))
            assessment = worker.call(computations.identify, out, tuple(records))
            self.retests.append(
                RetestSummary(
                    mission=mission,
                    test=str(recommended),
                    reason=recommended.reason,
                    vehicle_s=round(flown_s, 3),
                    fit_for_redesign=assessment is not None and assessment.fit_for_redesign,
                )
            )

    def _read_ahead(
        self,
        executors: "_Executors",
        stage: str,
        missions: Sequence[str],
        flown: Sequence[Future[None]],
    ) -> None:
        """Have the worker read each log as soon as its dive has ended."""

        def read(mission: str) -> Callable[[Future[None]], None]:
            return lambda _: executors.call_ahead(
                computations.read_log, self.request.out, stage, mission
            )

        for mission, dive in zip(missions, flown, strict=True):
            dive.add_done_callback(read(mission))

    def _begin_missions(
        self,
        dives: Executor,
        missions: Sequence[tuple[str, str]],
        gains: Mapping[str, Mapping[str, float]],
    ) -> list[Future[None]]:
        """Submit missions, given as pairs of set of gains and mission."""
        return [
            dive
            for name, mission in missions
            for dive in self._begin(dives, STAGES[name], (mission,), gains[name])
        ]

    def _finish_missions(
        self,
        dives: Executor,
        missions: Sequence[Future[None]],
        gains: dict[str, dict[str, float]],
    ) -> dict[str, dict[str, float]]:
        """Wait for the missions of all sets of gains; return the gains with which they were flown.

        After a failsafe all sets fly again, so that they stay comparable: with a descent at full
        thrust if the vehicle did not leave the surface, with slower turns if the rudder had no
        effect, otherwise with a smaller largest pitch. Raises FailsafeError if they were flown so
        already.
        """
        while True:
            try:
                _finish_dives(missions)
            except FailsafeError as error:
                limited = {name: error.limit(flown) for name, flown in gains.items()}
                afloat = isinstance(error, AfloatError)
                if limited == gains and not afloat:
                    raise
                wait(missions)  # they load their missions before these are changed
                if not afloat:
                    gains = limited
                    flown = gains["redesigned"]
                    change = f"{error.parameter} = {flown[error.parameter]:g}"
                elif self._speed_up_descents():
                    change = "a descent at full thrust"
                else:
                    raise
                self.announce(f"{error}; flying all missions again with {change}")
                repeated = [(name, mission) for name in gains for mission in MISSIONS]
                missions = self._begin_missions(dives, repeated, gains)
            else:
                return gains

    def _limit_as_taught(
        self, gains: Mapping[str, Mapping[str, float]]
    ) -> dict[str, dict[str, float]]:
        """Return the sets of gains with the largest pitch that failsafes so far have taught."""
        repetitions = self._taught_repetitions()
        return {name: _limit_dives(flown, repetitions) for name, flown in gains.items()}

    def _taught_repetitions(self) -> int:
        """Return the largest number of failed attempts of a dive with planned tests."""
        attempts = (self._records.failed_attempts(f"identification/{m}") for m in IDENTIFICATION)
        return min(MAX_REPETITIONS, max(len(failed) for failed in attempts))

    def _begin(
        self, dives: Executor, stage: str, missions: Sequence[str], parameters: Mapping[str, float]
    ) -> list[Future[None]]:
        """Submit dives."""
        return [dives.submit(self._fly, stage, mission, parameters) for mission in missions]

    def _fly(self, stage: str, mission: str, parameters: Mapping[str, float]) -> None:
        """Fly one dive, unless it is recorded; repeat one with tests after a failsafe.

        Raises FailsafeError after a failsafe of another dive, or of the last repetition.
        """
        name = f"{stage}/{mission}"
        repetitions = MAX_REPETITIONS if stage == "identification" else 0
        failed = self._records.failed_attempts(name)
        self.outcomes.update(failed)
        for number in range(min(len(failed), repetitions), repetitions + 1):
            failsafe = self._leave_surface(stage, mission, _limit_pitch(parameters, number))
            if not failsafe:
                return
            if number < repetitions:
                self.announce(
                    f"{name}: {failsafe}; repeating it with tests and largest pitch of"
                    f" {SMALLER_TESTS:g} times the size"
                )
                self._shrink_tests(mission)
        symptom = self._symptom(stage, mission)
        advice = f"; {symptom.message}: {symptom.remedy}" if symptom else ""
        raise FailsafeError(f"{name}: {failsafe}{advice}", symptom)

    def _leave_surface(self, stage: str, mission: str, parameters: Mapping[str, float]) -> str:
        """Fly one dive; again with a descent at full thrust if it does not leave the surface.

        Returns the first failsafe, empty without one. Raises AfloatError if a descent at full
        thrust does not help, or if it is to be flown with other sets of gains, too.
        """
        try:
            return self._fly_once(stage, mission, parameters)
        except AfloatError as error:
            if stage in STAGES.values() or not self._speed_up_descents():
                raise
            self.announce(f"{error}; repeating it with a descent at full thrust")
            return self._fly_once(stage, mission, parameters)

    def _symptom(self, stage: str, mission: str) -> Symptom | None:
        """Return the gravest symptom of a dive with a remedy; None without any."""
        log = CampaignFolder(self.request.out).log_path(stage, mission)
        try:
            symptoms = assess_log(readers.read(log)).symptoms
        except CaribouError:
            return None
        return next((symptom for symptom in symptoms if symptom.remedy), None)

    def _speed_up_descents(self) -> bool:
        """Write missions with a descent at full thrust, as far as dives have taught that.

        A first dive that did not leave the surface changes all missions; another dive its own one
        and those of all sets of gains. Returns whether a mission was changed.
        """
        folder = CampaignFolder(self.request.out)
        changed = False
        with self._lock:
            afloat = {key.removesuffix(AFLOAT) for key in self._records.afloat_attempts()}
            taught = {dive.split("/")[1] for dive in afloat}
            if afloat:
                taught |= set(ALL_MISSIONS if TRIM_MISSION in taught else MISSIONS)
            for mission in taught:
                flown = script.load(folder.mission_file(mission))
                if not scaling.descends_at_full_thrust(flown):
                    self._write_mission(mission, scaling.descend_at_full_thrust(flown))
                    changed = True
        return changed

    def _write_mission(self, mission: str, steps: script.Script) -> None:
        """Write a mission into the folder."""
        path = self.request.out / MISSIONS_FOLDER / f"{mission}.toml"
        path.parent.mkdir(exist_ok=True)
        write_whole(path, scaling.encode(steps))

    def _shrink_tests(self, mission: str) -> None:
        """Write a mission with smaller tests into the folder."""
        folder = CampaignFolder(self.request.out)
        asked = script.load(folder.mission_file(mission))
        tests = sum(step.test is not None for step in asked.step)
        smaller = scaling.scale_tests(
            asked, dict.fromkeys(range(tests), SMALLER_TESTS), defaultdict(lambda: MAX_ANGLE_DEG)
        )
        self._write_mission(mission, smaller)

    def _fly_once(self, stage: str, mission: str, parameters: Mapping[str, float]) -> str:
        """Fly one dive, unless it is recorded; return the first failsafe, empty without one."""
        log = CampaignFolder(self.request.out).log_path(stage, mission)
        log.parent.mkdir(exist_ok=True)
        name = f"{stage}/{mission}"
        notes = {"stage": stage, "seed": str(dive_seed(self.request.seed, mission))}
        mission_file = CampaignFolder(self.request.out).mission_file(mission)
        dive = Dive.load(mission_file, log, parameters=parameters, notes=notes)
        dive = replace(dive, mission=mission)
        request_sha256 = digest_request(
            parameters, dive.items, dive_seed(self.request.seed, mission)
        )
        if record := self._records.find(name, log, request_sha256):
            self.outcomes[name] = record
            return ""
        listener = self.listen(name, dive.items) if self.listen else None
        outcome = fly_simulated(
            dive,
            self._launch(mission),
            lambda progress: self.watch(name, progress),
            follower=listener,
        )
        if outcome.failsafes:
            symptom = self._symptom(stage, mission)
            if symptom and symptom.kind is SymptomKind.AFLOAT:
                failed = f"{name}{AFLOAT}"
                self.outcomes[failed] = self._records.add(failed, request_sha256, outcome)
                remedy = symptom.remedy
                if scaling.descends_at_full_thrust(script.load(mission_file)):
                    remedy = "add ballast; a descent at full thrust is not enough"
                raise AfloatError(f"{name}: {symptom.message}: {remedy}")
            failed = f"{name}, attempt {len(self._records.failed_attempts(name)) + 1}"
            self.outcomes[failed] = self._records.add(failed, request_sha256, outcome)
            return outcome.failsafes[0]
        self.outcomes[name] = self._records.add(name, request_sha256, outcome)
        return ""

    def _launch(self, mission: str) -> SimulatedVehicle:
        """Start the processes of a dive. Raises OperationError after a cancellation."""
        r = self.request
        with self._lock:
            if self._cancelled:
                raise OperationError("cancelled")
            folder = CampaignFolder(r.out)
            simulation = Simulation(
                vehicle=folder.flown(TRUTH_FILE, r.flown_vehicle),
                scenario=folder.flown(SCENARIO_FILE, r.scenario),
                seed=dive_seed(r.seed, mission),
                speed=r.speed,
            )
            simulated = SimulatedVehicle(simulation, start=ForkedProcess)
            self._simulated.append(simulated)
        return simulated

    @contextmanager
    def _executors(self) -> Iterator["_Executors"]:
        """Yield the executors of dives and computations; stop them at the end."""
        with ExitStack() as stack:
            dives = stack.enter_context(ThreadPoolExecutor(self.request.jobs))
            ahead = stack.enter_context(ThreadPoolExecutor(1))
            start_fork_server()
            worker = stack.enter_context(Worker(PRELOADED_MODULES))
            stack.callback(self._stop_all)
            stack.callback(ahead.shutdown, wait=False, cancel_futures=True)
            stack.callback(dives.shutdown, wait=False, cancel_futures=True)
            yield _Executors(dives, ahead, worker)

    def _stop_all(self) -> None:
        """Stop all simulations, and start no more."""
        with self._lock:
            self._cancelled = True
            for simulated in self._simulated:
                simulated.stop()


class FailsafeError(OperationError):
    """A dive ended with a failsafe."""

    code = ErrorCode.FAILSAFE

    def __init__(self, message: str, symptom: Symptom | None = None) -> None:
        super().__init__(message)
        self._turns = (
            symptom is not None
            and symptom.axis == "heading"
            and symptom.kind in (SymptomKind.REVERSED, SymptomKind.STUCK)
        )

    @property
    def parameter(self) -> str:
        """Parameter that is reduced in a repetition."""
        return TURN_RATE if self._turns else DIVE_PITCH

    def limit(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Return the parameters of a repetition of the mission."""
        return _limit_turns(parameters) if self._turns else _limit_dives(parameters, 1)


class AfloatError(FailsafeError):
    """A dive ended with a failsafe because the vehicle did not leave the surface."""

    code = ErrorCode.AFLOAT


class _Executors(NamedTuple):
    """Threads and processes of a campaign."""

    dives: Executor
    """One thread per job; each flies a dive or waits for the refit."""
    ahead: Executor
    """One thread, which asks the worker for results that are needed later."""
    worker: Worker
    """Process of the computations."""

    def call_ahead(self, function: Callable[P, None], *args: P.args, **kwargs: P.kwargs) -> None:
        """Have the worker run a function soon; an error appears when its result is needed."""
        with suppress(RuntimeError):  # the executor is shut down: the campaign is being stopped
            self.ahead.submit(lambda: self.worker.call(function, *args, **kwargs))


def dive_seed(seed: int, mission: str) -> int:
    """Return the seed of a dive: different for each mission, equal for all sets of gains.

    Parameters
    ----------
    seed : int
        Seed of the campaign.
    mission : str
        Name of a mission of the campaign.

    Returns
    -------
    int
        Seed of the simulation.
    """
    return seed * 1000 + (TRIM_MISSION, *MISSIONS, *FITTED, *HELD_OUT, *RETESTS).index(mission)


def is_finished(out: Path) -> bool:
    """Return whether a folder holds a finished campaign.

    Parameters
    ----------
    out : Path
        The folder.

    Returns
    -------
    bool
        Whether all results are there and the records of the dives were removed.
    """
    results = all((out / name).is_file() for name in RESULTS)
    return results and not (out / RECORDS_FILE).exists()


def refuse_folder(request: CampaignRequest) -> None:
    """Raise InputError if the folder is a file, or holds other files or another campaign."""
    out = request.out
    if request.resume and request.force:
        raise InputError("--resume cannot be combined with --force, which starts again")
    if out.is_dir():
        if any(_foreign_files(out)) and not (out / CAMPAIGN_FILE).is_file():
            raise InputError(
                f"--out {out}: holds files that are no campaign; give a new or an empty folder"
            )
        if (out / CAMPAIGN_FILE).is_file() and not request.force:
            if request.resume:
                _refuse_other_options(request)
                return
            state, hint = "an interrupted", ", --resume to continue it"
            if is_finished(out):
                state, hint = "a finished", ""
            logs = sum(path.suffix == ".mcap" for path in _campaign_files(out))
            raise InputError(
                f"--out {out}: holds {state} campaign ({logs} logs); give a new folder{hint}, or"
                " --force to replace it"
            )
    elif out.exists():
        raise InputError(f"--out {out}: is a file; give a folder")


def _foreign_files(out: Path) -> Iterator[Path]:
    """Return the entries of a folder without those of a campaign that was killed as it began."""
    return (path for path in out.iterdir() if path.name != temporary_name(CAMPAIGN_FILE))


def _refuse_other_options(request: CampaignRequest) -> None:
    """Raise InputError if the campaign in the folder has other options."""
    folder = CampaignFolder(request.out)
    for key, value in _options(request).items():
        if (begun := folder.options.get(key)) != value:
            raise InputError(
                f"--resume: {request.out / CAMPAIGN_FILE} has {key} = {json.dumps(begun)}, not"
                f" {json.dumps(value)}; give the options of that campaign"
            )


def prepare_folder(request: CampaignRequest, scaled: Sequence[str] = ()) -> None:
    """Create the campaign folder, remove an old campaign from it, and write the options.

    `scaled` says what was scaled to the vehicle.

    A campaign that is resumed keeps its files. Files that no campaign writes are kept too. Raises
    InputError, as `refuse_folder`, and for a campaign that other versions of the programs began.
    """
    refuse_folder(request)
    out = request.out
    text = _campaign_toml(request, scaled)
    if request.resume and (out / CAMPAIGN_FILE).is_file():
        if CampaignFolder(out).asked != text:
            raise InputError(
                f"--resume: {out / CAMPAIGN_FILE} was written by other versions of Python or of the"
                " packages, which may give another model; use them, or --force to start again"
            )
        return
    for path in _campaign_files(out):
        path.unlink()
    for stage in (*DIVES, MISSIONS_FOLDER):
        if (out / stage).is_dir() and not any((out / stage).iterdir()):
            (out / stage).rmdir()
    out.mkdir(parents=True, exist_ok=True)
    write_whole(out / CAMPAIGN_FILE, text)


def _campaign_files(out: Path) -> list[Path]:
    """Return the files of a campaign that are in a folder; the file of its options is last."""
    logs = [
        CampaignFolder(out).log_path(stage, name)
        for stage, names in DIVES.items()
        for name in names
    ]
    missions = [out / MISSIONS_FOLDER / f"{name}.toml" for name in (*ALL_MISSIONS, *RETESTS)]
    prepared = [out / name for name in (SCENARIO_FILE, TRUTH_FILE)]
    results = [out / name for name in (*RESULTS, "model.json", "gains.param", CAMPAIGN_FILE)]
    known = (out / RECORDS_FILE, *logs, *missions, *prepared, *results)
    return [path for path in known if path.is_file() or path.is_symlink()]


def _options(request: CampaignRequest) -> dict[str, object]:
    """Return the options that decide about the results."""
    options = {**request._asdict(), "truth": request.flown_vehicle}
    return {
        key: value
        for key, value in options.items()
        if key not in ("out", "force", "resume", "jobs")
    }


def _campaign_toml(request: CampaignRequest, scaled: Sequence[str]) -> str:
    """Return options, seeds and versions of a campaign as TOML."""
    lines = [f"{key} = {json.dumps(value)}" for key, value in _options(request).items()]
    if scaled:
        lines += ["scaled = [", *(f"  {json.dumps(note)}," for note in scaled), "]"]
    lines += ["", "[seeds]"]
    lines += [
        f"{m} = {dive_seed(request.seed, m)}" for m in (TRIM_MISSION, *MISSIONS, *FITTED, *HELD_OUT)
    ]
    lines += ["", "[versions]", f"python = {json.dumps(platform.python_version())}"]
    lines += [
        f"{package} = {json.dumps(importlib.metadata.version(package))}" for package in _PACKAGES
    ]
    return "\n".join(lines) + "\n"


def _limit_pitch(parameters: Mapping[str, float], repetition: int) -> dict[str, float]:
    """Return the parameters of a repetition: smaller pitch of tests and of depth changes."""
    return _limit_tests(_limit_dives(parameters, repetition), repetition)


def _limit_tests(parameters: Mapping[str, float], repetition: int) -> dict[str, float]:
    """Return parameters with a smaller pitch that ends a test."""
    if repetition == 0:
        return dict(parameters)
    limit_deg = parameters.get(PITCH_LIMIT, PITCH_LIMIT_DEG) * SMALLER_TESTS**repetition
    return {**parameters, PITCH_LIMIT: round(limit_deg, 1)}


def _limit_dives(parameters: Mapping[str, float], repetition: int) -> dict[str, float]:
    """Return parameters with a smaller largest pitch set-point, and depth changes as much slower.

    A change of depth can need the elevator at its limits; a vehicle that is nearly unstable in
    pitch may then turn its nose down too far.
    """
    if repetition == 0:
        return dict(parameters)
    first_deg = parameters.get(DIVE_PITCH, DIVE_PITCH_DEG)
    smaller_deg = max(MIN_DIVE_PITCH_DEG, first_deg * SMALLER_TESTS**repetition)
    limited = {**parameters, DIVE_PITCH: round(min(first_deg, smaller_deg), 1)}
    if DIVE_RATE in limited:
        limited[DIVE_RATE] *= limited[DIVE_PITCH] / first_deg
    return limited


def _limit_turns(parameters: Mapping[str, float]) -> dict[str, float]:
    """Return parameters with a slower heading reference, if they limit it.

    The flown vehicle can turn on against its rudder, hard over, from a rate that the vehicle of the
    file could leave.
    """
    if TURN_RATE not in parameters:
        return dict(parameters)
    first_degps = parameters[TURN_RATE]
    slower_degps = max(MIN_TURN_RATE_DEGPS, SMALLER_TESTS * first_degps)
    return {**parameters, TURN_RATE: round(min(first_degps, slower_degps), 1)}


def _not_designed(designed: Mapping[str, float], flown: Mapping[str, float]) -> dict[str, float]:
    """Return the flown parameters that a redesign does not set: trims, travel, cruise speed."""
    return {name: value for name, value in flown.items() if name not in designed}


def _finish_dives(dives: Sequence[Future[None]]) -> None:
    """Wait for the dives; raise the error of the first one that fails."""
    done, _ = wait(dives, return_when=FIRST_EXCEPTION)
    for dive in done:
        dive.result()
