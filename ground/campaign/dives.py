"""Dives of a campaign: each is flown once, and again with smaller tests after a failsafe.

Each dive has its own simulator and autopilot process and its own log. Any thread may fly one.
"""

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from threading import Lock

from ground.campaign.campaign_folder import (
    MISSIONS_FOLDER,
    SCENARIO_FILE,
    STAGES,
    TRUTH_FILE,
    CampaignFolder,
)
from ground.campaign.computations import MISSIONS, REHEARSED
from ground.campaign.dive_records import (
    AFLOAT,
    DiveRecord,
    DiveRecords,
    digest_request,
)
from ground.campaign.failsafe_limits import (
    MAX_REPETITIONS,
    SMALLER_TESTS,
    AfloatError,
    FailsafeError,
    limit_pitch,
)
from ground.campaign.request import (
    ALL_MISSIONS,
    IDENTIFICATION,
    TRIM_MISSION,
    CampaignRequest,
    dive_seed,
)
from ground.client.assessment import assess_read_log
from ground.client.depth_progress import ASCENT_S
from ground.client.dive_symptoms import MIN_AFLOAT_S, Symptom, SymptomKind
from ground.client.flight import Dive, FlightProgress, TelemetryListener, fly_simulated
from ground.missions import scaling, script
from ground.output_files import write_whole
from ground.simulation.processes import SimulatedVehicle, Simulation
from ground.simulation.subprocesses import ForkedProcess, stop_loading_fork_server
from mavlink_io.errors import CaribouError, OperationError
from mavlink_io.mission_items import MissionItem
from sysid.data import readers
from sysid.data.events import Failsafe, FailsafeCause, parse_text
from sysid.monitor.tracking_metrics import SUBMERGED_M
from sysid.monte_carlo.simulate import limit_s

_CRITICAL = 2
"""MAV_SEVERITY_CRITICAL, the severity of texts of failsafes."""
MAX_ANGLE_DEG = 90.0
"""Largest size of a test (deg): without effect, because tests are only made smaller."""
LOCK_TIMEOUT_S = 0.05
"""Wall time (s) for which a start may hold the lock before the fork server is killed."""
WatchCallback = Callable[[str, FlightProgress], None]
"""Called with the name and the progress of a dive."""
AnnounceCallback = Callable[[str], None]
"""Called with a text about what begins."""
ListenCallback = Callable[[str, Sequence[MissionItem]], TelemetryListener]
"""Called with the name and the mission of a dive; returns the listener to its telemetry."""


@dataclass
class _SubmergedTime:
    """Vehicle time below the surface, by the reports of progress of a dive."""

    total_s: float = 0.0
    _last_s: float | None = None
    """Time of the report before, None if the vehicle was at the surface then."""

    def add(self, progress: FlightProgress) -> None:
        """Count the time since the report before, if the vehicle was submerged in both."""
        is_submerged = progress.depth_m > SUBMERGED_M
        if is_submerged and self._last_s is not None:
            self.total_s += progress.vehicle_s - self._last_s
        self._last_s = progress.vehicle_s if is_submerged else None


@dataclass
class CampaignDives:
    """The dives of a campaign, finished ones and those under way."""

    request: CampaignRequest
    watch: WatchCallback
    announce: AnnounceCallback
    listen: ListenCallback | None = None
    outcomes: dict[str, DiveRecord] = field(default_factory=dict)
    """Record of each dive and of each attempt that ended with a failsafe, or that did not leave the
    surface before a mission was repeated; missions that all sets of gains flew again count once."""
    records: DiveRecords = field(init=False)
    """Records in the folder, also those from before the campaign was resumed."""
    _rehearsed: script.Script = field(init=False)
    """Mission `REHEARSED` as it was prepared."""
    _simulated: list[SimulatedVehicle] = field(default_factory=list)
    _lock: Lock = field(default_factory=Lock)
    _cancelled: bool = False

    def open_records(self) -> None:
        """Read the records of a prepared folder, and change its missions by these records."""
        self.records = DiveRecords(self.request.out)
        self._rehearsed = script.load(CampaignFolder(self.request.out).mission_file(REHEARSED))
        for mission in IDENTIFICATION:
            self.repeat_reductions(mission)
        self.outcomes.update(self._afloat_before_missions())
        self.speed_up_descents()

    def rehearsed_items(self) -> tuple[MissionItem, ...]:
        """Return the items of the mission in which sets of gains are compared in simulation.

        It begins with a descent at full thrust if the trim dive or a test did not leave the
        surface. Dives of the sets of gains do not count: at the time of the redesign they are
        flown in a resumed campaign, and may be under way in another one.
        """
        steps = self._rehearsed
        if self._afloat_before_missions() and not scaling.descends_at_full_thrust(steps):
            steps = scaling.descend_at_full_thrust(steps)
        return script.compile_items(steps)

    def _afloat_before_missions(self) -> dict[str, DiveRecord]:
        """Return the records of the trim dives and tests that did not leave the surface."""
        attempts = self.records.afloat_attempts().items()
        return {key: record for key, record in attempts if _stage_of(key) not in STAGES.values()}

    def fly(self, stage: str, mission: str, parameters: Mapping[str, float]) -> None:
        """Fly one dive, unless it is recorded; repeat one with tests after a failsafe.

        Raises FailsafeError after a failsafe of another dive, or of the last repetition.
        """
        name = f"{stage}/{mission}"
        repetitions = MAX_REPETITIONS if stage == "identification" else 0
        failed = self.records.failed_attempts(name)
        self.outcomes.update(failed)
        for number in range(min(len(failed), repetitions), repetitions + 1):
            failsafe = self._leave_surface(stage, mission, limit_pitch(parameters, number))
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
        thrust does not help, and for a mission that all sets of gains then have to fly again.
        """
        try:
            return self._fly_once(stage, mission, parameters)
        except AfloatError as error:
            if stage in STAGES.values() or not self.speed_up_descents():
                raise
            self.announce(f"{error}; repeating it with a descent at full thrust")
            return self._fly_once(stage, mission, parameters)

    def repeat_reductions(self, mission: str) -> None:
        """Make the tests of a mission as small as they were after the failsafes of its dives."""
        attempts = self.records.failed_attempts(f"identification/{mission}")
        for _ in range(min(len(attempts), MAX_REPETITIONS)):
            self._shrink_tests(mission)

    def failsafe_repetitions(self) -> int:
        """Return the largest number of failed attempts of a dive with planned tests."""
        attempts = (self.records.failed_attempts(f"identification/{m}") for m in IDENTIFICATION)
        return min(MAX_REPETITIONS, max(len(failed) for failed in attempts))

    def _symptom(self, stage: str, mission: str) -> Symptom | None:
        """Return the gravest symptom of a dive with a remedy; None without any."""
        log = CampaignFolder(self.request.out).log_path(stage, mission)
        try:
            symptoms = assess_read_log(readers.read(log)).symptoms
        except CaribouError:
            return None
        return next((symptom for symptom in symptoms if symptom.remedy), None)

    def speed_up_descents(self) -> bool:
        """Write missions with a descent at full thrust, where dives did not leave the surface.

        A first dive that did not leave the surface changes all missions; another dive its own one
        and those of all sets of gains. Returns whether a mission was changed.
        """
        folder = CampaignFolder(self.request.out)
        changed = False
        with self._lock:
            afloat = {key.removesuffix(AFLOAT) for key in self.records.afloat_attempts()}
            affected = {dive.split("/")[1] for dive in afloat}
            if afloat:
                affected |= set(ALL_MISSIONS if TRIM_MISSION in affected else MISSIONS)
            for mission in affected:
                flown = script.load(folder.mission_file(mission))
                if not scaling.descends_at_full_thrust(flown):
                    self.write_mission(mission, scaling.descend_at_full_thrust(flown))
                    changed = True
        return changed

    def write_mission(self, mission: str, steps: script.Script) -> None:
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
        self.write_mission(mission, smaller)

    def _fly_once(self, stage: str, mission: str, parameters: Mapping[str, float]) -> str:
        """Fly one dive, unless it is recorded; return the first failsafe, empty without one."""
        log = CampaignFolder(self.request.out).log_path(stage, mission)
        log.parent.mkdir(exist_ok=True)
        name = f"{stage}/{mission}"
        notes = {"stage": stage, "seed": str(dive_seed(self.request.seed, mission))}
        mission_file = CampaignFolder(self.request.out).mission_file(mission)
        at_full_thrust = scaling.descends_at_full_thrust(script.load(mission_file))
        dive = Dive.load(mission_file, log, parameters=parameters, notes=notes)
        dive = replace(dive, mission=mission)
        request_sha256 = digest_request(
            parameters, dive.items, dive_seed(self.request.seed, mission)
        )
        if record := self.records.find(name, log, request_sha256):
            self.outcomes[name] = record
            return ""
        log.unlink(missing_ok=True)  # of a dive that was interrupted or is repeated
        listener = self.listen(name, dive.items) if self.listen else None
        submerged = _SubmergedTime()
        outcome = fly_simulated(
            dive,
            self._launch(mission),
            partial(self._watch, name, limit_s(dive.items) + ASCENT_S, submerged),
            listener=listener,
        )
        # the log is read only where it can show that the vehicle did not leave the surface
        if outcome.failsafes or outcome.vehicle_s - submerged.total_s >= MIN_AFLOAT_S:
            symptom = self._symptom(stage, mission)
            if symptom and symptom.kind is SymptomKind.AFLOAT:
                failed = f"{name}{AFLOAT}"
                record = self.records.add(failed, request_sha256, outcome)
                if stage not in STAGES.values():
                    self.outcomes[failed] = record
                remedy = symptom.remedy
                if at_full_thrust:
                    remedy = "add ballast; a descent at full thrust is not enough"
                raise AfloatError(
                    f"{name}: {symptom.message}: {remedy}", at_full_thrust=at_full_thrust
                )
        if outcome.failsafes:
            if not _only_floated_up(outcome.failsafes):
                failed = f"{name}, attempt {len(self.records.failed_attempts(name)) + 1}"
                self.outcomes[failed] = self.records.add(failed, request_sha256, outcome)
                return outcome.failsafes[0]
            self.announce(f"{name}: all steps flown; then {outcome.failsafes[0]}")
        self.outcomes[name] = self.records.add(name, request_sha256, outcome)
        return ""

    def _watch(
        self, name: str, longest_s: float, submerged: _SubmergedTime, progress: FlightProgress
    ) -> None:
        """Pass on the progress of a dive. Raises OperationError if it takes too long."""
        submerged.add(progress)
        if progress.vehicle_s > longest_s:
            raise OperationError(
                f"{name}: {progress.depth_m:.1f} m deep {progress.vehicle_s:.0f} s after its start,"
                " and has not ended: does the vehicle float up by itself?"
            )
        self.watch(name, progress)

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

    def stop_all(self) -> None:
        """Stop all simulations, and start no more."""
        self._cancelled = True
        stop_loading_fork_server()
        # a start that waits for the fork server holds the lock, and may have begun another server
        while not self._lock.acquire(timeout=LOCK_TIMEOUT_S):
            stop_loading_fork_server()
        try:
            for simulated in self._simulated:
                simulated.stop()
        finally:
            self._lock.release()


def _stage_of(name: str) -> str:
    """Return the stage in the name of a dive or of an attempt."""
    return name.partition("/")[0]


def _only_floated_up(failsafes: Sequence[str]) -> bool:
    """Return whether the only failsafe stopped the propeller of the ascent after the last step."""
    events = [parse_text(_CRITICAL, text) for text in failsafes]
    return all(
        isinstance(event, Failsafe) and event.cause is FailsafeCause.NO_RISE for event in events
    )
