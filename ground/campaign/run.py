"""Campaign: trim flight, identification tests, refit, redesign and verification in one command.

The seed of a dive depends only on the seed of the campaign and on the mission, so that all sets of
gains are flown in the same sea. As many dives or computations run at the same time as there are
cores; vehicle time is in lockstep, so this does not change the logs. Besides, one process reads
each log when its dive ends and prepares the report while the last dives are under way. A campaign
that was killed is resumed: dives that are recorded as finished are not flown again; all
computations are repeated.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, Executor, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager, suppress
from typing import NamedTuple, ParamSpec

import msgspec

from ground.campaign import computations, prototype, refit, summary, summary_file
from ground.campaign.campaign_folder import MISSIONS_FOLDER, STAGES, CampaignFolder
from ground.campaign.computations import MISSIONS, RETESTS, RetestRecord
from ground.campaign.dives import (
    AnnounceCallback,
    CampaignDives,
    ListenCallback,
    WatchCallback,
)
from ground.campaign.failsafe_limits import (
    LIMIT_REASONS,
    AfloatError,
    FailsafeError,
    limit_dives,
    limit_tests,
)
from ground.campaign.folder_setup import (
    RESULTS,
    FolderLock,
    is_finished,
    prepare_folder,
    refuse_folder,
)
from ground.campaign.preparation import Preparation, PreparationRequest, flown_file, prepare
from ground.campaign.request import ALL_MISSIONS, IDENTIFICATION, TRIM_MISSION, CampaignRequest
from ground.campaign.summary_file import CampaignSummary, DesignSummary, RetestSummary
from ground.campaign.worker import Worker
from ground.output_files import write_whole
from ground.simulation.subprocesses import start_fork_server
from mavlink_io.clock import wall_s
from mavlink_io.errors import InputError

PRELOADED_MODULES = (
    "sysid.refit",
    "sysid.design.pid",
    "sysid.data.readers",
    "sysid.monitor.tracking_metrics",
)
"""Modules of the computations, which the worker loads during the trim flight."""
REPORT_MODULES = ("ground.report.page", "control")
"""Modules of the report, which the worker loads during the tests."""
P = ParamSpec("P")


class _Executors(NamedTuple):
    """Threads and processes of a campaign."""

    slots: Executor
    """One thread per job; each flies a dive or waits for the refit."""
    ahead: Executor
    """One thread, which asks the worker for results that are needed later."""
    worker: Worker
    """Process of the computations."""

    def call_ahead(self, function: Callable[P, None], *args: P.args, **kwargs: P.kwargs) -> None:
        """Have the worker run a function soon; an error appears when its result is needed."""
        with suppress(RuntimeError):  # the executor is shut down: the campaign is being stopped
            self.ahead.submit(lambda: self.worker.call(function, *args, **kwargs))


class Campaign:
    """A running campaign.

    Parameters
    ----------
    request : CampaignRequest
        Options.
    watch, announce, listen
        As those of ``CampaignDives``.
    """

    def __init__(
        self,
        request: CampaignRequest,
        watch: WatchCallback,
        announce: AnnounceCallback,
        listen: ListenCallback | None = None,
    ) -> None:
        self.request, self.announce = request, announce
        self.dives = CampaignDives(request, watch, announce, listen)
        self.retests: list[RetestSummary] = []
        self._prepared = False
        self._lock = FolderLock(request.out)

    def run(self) -> CampaignSummary:
        """Run the campaign; write and return the summary. Raises InputError, OperationError."""
        with self._lock:
            return self._run_locked()

    def _run_locked(self) -> CampaignSummary:
        """Run the campaign in its folder."""
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
        self.dives.records.remove()
        return result

    def _run(self) -> CampaignSummary:
        """Run all stages; return the summary."""
        start_s = wall_s()
        with self._executors() as executors:
            slots, worker = executors.slots, executors.worker
            preparation = self._prepare()
            first = preparation.parameters
            trims = self._measure_trims(executors, first)
            gains = self._first_gains(first, trims)
            self.announce("flying the tests with the initial gains")
            tests = self._begin(slots, "identification", IDENTIFICATION, gains["initial"])
            executors.call_ahead(computations.load_modules, REPORT_MODULES)
            self._read_ahead(executors, "identification", IDENTIFICATION, tests)
            baseline = [(name, mission) for name in gains for mission in MISSIONS]
            # Slots that the last tests leave free fly missions; the last test's slot refits.
            early = self.request.jobs - 1
            missions = self._begin_missions(slots, baseline[:early], gains)
            _finish_dives(tests)
            unlimited, gains = gains, self._apply_failsafe_limits(gains)
            if self.dives.records.afloat_attempts() or gains != unlimited:
                missions = self._begin_again(slots, missions, baseline[:early], gains)
            self.announce(
                f"refitting the model; flying the missions with the {' and the '.join(gains)} gains"
            )
            untrimmed = {name: value for name, value in first.items() if name not in trims}
            redesigning = slots.submit(self._redesign, worker, untrimmed, unlimited["initial"])
            missions += self._begin_missions(slots, baseline[early:], gains)
            design = redesigning.result()
            if self.dives.records.afloat_attempts():
                missions = self._begin_again(slots, missions, baseline, gains)
            self.announce("flying the missions with the redesigned gains")
            redesigned = {
                **design.gains,
                **_not_designed(design.gains, unlimited["initial"]),
                **trims,
            }
            gains |= self._apply_failsafe_limits({"redesigned": redesigned})
            verification = [("redesigned", mission) for mission in MISSIONS]
            missions += self._begin_missions(slots, verification, gains)
            executors.call_ahead(computations.prepare_report, self.request.out, design, gains)
            for (name, mission), dive in zip([*baseline, *verification], missions, strict=True):
                self._read_ahead(executors, STAGES[name], (mission,), (dive,))
            gains = self._finish_missions(slots, missions, gains)
            limited = {
                name: value
                for name, value in gains["redesigned"].items()
                if name in LIMIT_REASONS and value != redesigned.get(name)
            }
            if limited:
                reasons = {name: LIMIT_REASONS[name] for name in limited}
                design = worker.call(
                    computations.add_parameters, self.request.out, design, limited, reasons
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
        if not prototype.is_caribou(r.vehicle):
            if r.include_paper_gains:
                raise InputError(
                    "--include-paper-gains: the paper's gains are for Caribou; "
                    f"leave it out for {r.vehicle}"
                )
            self.announce("designing the first gains")
        asked = PreparationRequest(
            vehicle=r.vehicle,
            scenario=r.scenario,
            truth=r.flown_vehicle,
            seed=r.seed,
            missions=ALL_MISSIONS,
        )
        preparation = prepare(asked, self.announce)
        self._write_folder(preparation)
        for note in preparation.notes:
            self.announce(note)
        for warning in preparation.warnings:
            self.announce(f"warning: {flown_file(asked)}: {warning}")
        return preparation

    def _write_folder(self, preparation: Preparation) -> None:
        """Prepare the folder and write the files of a preparation."""
        prepare_folder(self.request, preparation.notes)
        self._lock.take()  # the folder may be new
        self._prepared = True
        for name, text in preparation.files.items():
            path = self.request.out / name
            path.parent.mkdir(exist_ok=True)
            write_whole(path, text)
        for mission in ALL_MISSIONS:
            if f"{MISSIONS_FOLDER}/{mission}.toml" not in preparation.files:
                (self.request.out / MISSIONS_FOLDER / f"{mission}.toml").unlink(missing_ok=True)
        self.dives.open_records()

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
        results = self.dives.outcomes.values()
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
        _finish_dives(self._begin(executors.slots, "prototype", (TRIM_MISSION,), first))
        log = CampaignFolder(self.request.out).log_path("prototype", TRIM_MISSION)
        return executors.worker.call(refit.measure_trims, log)

    def _redesign(
        self, worker: Worker, first: Mapping[str, float], flown: Mapping[str, float]
    ) -> DesignSummary:
        """Refit, fly the recommended tests, and redesign; return the summary of the design.

        `first` are the first gains without trims, and `flown` these gains with the measured ones.
        """
        self._identify(worker, flown)
        self.announce("redesigning the gains")
        rehearsed = self.dives.rehearsed_items()
        return worker.call(computations.design, self.request.out, first, rehearsed)

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
            self.dives.write_mission(mission, dive.script)
            self.dives.speed_up_descents()
            self.dives.repeat_reductions(mission)
            self.announce(f"not fit: {recommended.reason}; flying {recommended}")
            failures = len(self.dives.records.failed_attempts(f"identification/{dive.base}"))
            limited = limit_dives(flown, self.dives.failsafe_repetitions())
            self.dives.fly("identification", mission, limit_tests(limited, failures))
            flown_s = self.dives.outcomes[f"identification/{mission}"].vehicle_s
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
        slots: Executor,
        missions: Sequence[tuple[str, str]],
        gains: Mapping[str, Mapping[str, float]],
    ) -> list[Future[None]]:
        """Submit missions, given as pairs of set of gains and mission."""
        return [
            dive
            for name, mission in missions
            for dive in self._begin(slots, STAGES[name], (mission,), gains[name])
        ]

    def _begin_again(
        self,
        slots: Executor,
        begun: Sequence[Future[None]],
        missions: Sequence[tuple[str, str]],
        gains: Mapping[str, Mapping[str, float]],
    ) -> list[Future[None]]:
        """Submit missions again, when those under way have ended.

        A test that was flown meanwhile may have changed them, or their limits. Those that were
        flown as they are now are not repeated.
        """
        wait(begun)
        if self.dives.speed_up_descents():
            self.announce("flying all missions again with a descent at full thrust")
        return self._begin_missions(slots, missions, gains)

    def _finish_missions(
        self,
        slots: Executor,
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
                if error.at_full_thrust if isinstance(error, AfloatError) else limited == gains:
                    raise
                wait(missions)  # they load their missions before these are changed
                if isinstance(error, AfloatError):
                    self.dives.speed_up_descents()
                    change = "a descent at full thrust"
                else:
                    gains = limited
                    flown = gains["redesigned"]
                    change = f"{error.parameter} = {flown[error.parameter]:g}"
                self.announce(f"{error}; flying all missions again with {change}")
                repeated = [(name, mission) for name in gains for mission in MISSIONS]
                missions = self._begin_missions(slots, repeated, gains)
            else:
                return gains

    def _apply_failsafe_limits(
        self, gains: Mapping[str, Mapping[str, float]]
    ) -> dict[str, dict[str, float]]:
        """Return the sets of gains with the largest pitch that the failsafes so far permit."""
        repetitions = self.dives.failsafe_repetitions()
        return {name: limit_dives(flown, repetitions) for name, flown in gains.items()}

    def _begin(
        self, slots: Executor, stage: str, missions: Sequence[str], parameters: Mapping[str, float]
    ) -> list[Future[None]]:
        """Submit dives."""
        return [slots.submit(self.dives.fly, stage, mission, parameters) for mission in missions]

    @contextmanager
    def _executors(self) -> Iterator["_Executors"]:
        """Yield the executors of dives and computations; stop them at the end."""
        with ExitStack() as stack:
            slots = stack.enter_context(ThreadPoolExecutor(self.request.jobs))
            ahead = stack.enter_context(ThreadPoolExecutor(1))
            start_fork_server()
            worker = stack.enter_context(Worker(PRELOADED_MODULES))
            stack.callback(self.dives.stop_all)
            stack.callback(ahead.shutdown, wait=False, cancel_futures=True)
            stack.callback(slots.shutdown, wait=False, cancel_futures=True)
            yield _Executors(slots, ahead, worker)


def _not_designed(designed: Mapping[str, float], flown: Mapping[str, float]) -> dict[str, float]:
    """Return the flown parameters that a redesign does not set: trims, travel, cruise speed."""
    return {name: value for name, value in flown.items() if name not in designed}


def _finish_dives(dives: Sequence[Future[None]]) -> None:
    """Wait for the dives; raise the error of the first one that fails."""
    done, _ = wait(dives, return_when=FIRST_EXCEPTION)
    for dive in done:
        dive.result()
