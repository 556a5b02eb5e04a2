"""A campaign that is killed at any stage and resumed gives the files of one that was not killed.

Dives and computations are replaced by short ones that write their inputs into their results; order,
records, folder and threads are the campaign's own. `test_run.py` kills a real campaign.
"""

import hashlib
import os
import signal
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from ground import output_files
from ground.campaign import (
    computations,
    dive_records,
    dives,
    folder_setup,
    run,
    summary_file,
)
from ground.campaign.campaign_folder import CampaignFolder
from ground.campaign.dive_records import RECORDS_FILE, DiveRecords, digest_request
from ground.campaign.dives import CampaignDives
from ground.campaign.preparation import Preparation
from ground.campaign.request import CampaignRequest
from ground.campaign.run import Campaign
from ground.client.dive_symptoms import Symptom, SymptomKind
from ground.client.flight import Dive, FlightResult
from ground.missions import scaling, script
from mavlink_io.errors import InputError
from mavlink_io.mission_items import MavCmd
from sysid.planes import Plane
from sysid.validation.results import NextTest
from tests.helpers.subprocesses import process

CHIRP = NextTest(
    plane=Plane.YAW, signal="chirp", magnitude_deg=5.0, duration_s=30.0, reason="gain not known"
)
KILLED_DIVES = (
    *("prototype/trim", "identification/elevator_sweeps", "identification/retest_1"),
    *("baseline/straight_run", "verification/shallow_1m"),
)
"""Dives at whose begin, middle, end and record a campaign is killed."""
LARGEST_DEG = {"identification/elevator_sweeps": 2.5, "identification/retest_1": 4.0}
"""Largest tests (deg) of dives that end with a failsafe otherwise, so that they are repeated."""
WRITE_WHOLE = output_files.write_whole
FLYING = "flying "
"""Begin of the name of a stage that exists only while a dive is flown."""
SAID = "said "
"""Begin of the name of a stage at which the campaign announces something."""
AFLOAT_DIVES = (
    *("prototype/trim", "identification/retest_1"),
    *("baseline/combined", "verification/straight_run"),
)
"""Dives of campaigns in which one does not leave the surface."""


class FakeSummary(msgspec.Struct):
    """Results that are compared between two campaigns; the wall time differs."""

    wall_s: float
    retests: tuple[Any, ...]
    vehicle_s: float
    messages: int


class Stages:
    """Names of the stages that were reached; the process is killed at one of them."""

    def __init__(self, out: Path, kill_at: str) -> None:
        self._file, self._kill_at = out.with_suffix(".stages"), kill_at

    def reach(self, name: str) -> None:
        """Note a stage, or end the process."""
        with self._file.open("a") as file:
            file.write(name + "\n")
        if name == self._kill_at:
            os.kill(os.getpid(), signal.SIGKILL)


class FakeWorker:
    """Computations whose results depend on all bytes that they read."""

    def __init__(self, out: Path, stages: Stages) -> None:
        self._out, self._stages = out, stages

    def __enter__(self) -> "FakeWorker":
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def call(self, function: Callable[..., Any], *args: Any, **_: Any) -> Any:
        """Return the result of a computation."""
        name = function.__name__
        self._stages.reach(f"begin {name}")
        result = getattr(self, f"_{name}", lambda *args: None)(*args)
        self._stages.reach(f"end {name}")
        return result

    def _prepare(self, *_: object) -> Preparation:
        return Preparation({"HDG_P": 1.0}, {"truth.toml": "mass_kg = 1\n"}, ("scaled",))

    def _measure_trims(self, log: Path, *_: object) -> dict[str, float]:
        return {"TRIM_RUD_DEG": int(digest(log)[:6], 16) / 1e6}

    def _identify(self, out: Path, retests: Any = ()) -> Any:
        logs = sorted((out / "identification").glob("*.mcap"))
        names = {*computations.FITTED, *computations.HELD_OUT, *(r.mission for r in retests)}
        text = "".join(digest(log) for log in logs if log.stem in names)
        (out / "model.json").write_text(text)
        return SimpleNamespace(fit_for_redesign=len(retests) == 2, next_test=CHIRP)

    def _plan_retest(self, out: Path, recommended: NextTest, mission: str) -> Any:
        return computations.plan_retest(out, recommended, mission)

    def _design(self, out: Path, _: object, rehearsed: object) -> Any:
        text = digest(out / "model.json") + repr(rehearsed)
        gain = int(hashlib.sha256(text.encode()).hexdigest()[:6], 16) / 1e6
        (out / "gains.param").write_text(f"HDG_P,{gain}\n")
        return SimpleNamespace(gains={"HDG_P": gain})

    def _compare(self, out: Path, totals: Any, *_: object) -> FakeSummary:
        return FakeSummary(0.0, (), totals.vehicle_s, totals.messages)

    def _report(self, out: Path) -> None:
        (out / "report.html").write_text("<html>")
        self._stages.reach("half of the report")
        (out / "report.html").write_text("<html></html>")


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def run_campaign(out: Path, kill_at: str = "", afloat: str = "") -> None:
    """Run or resume a campaign in this process, which may be killed.

    The dive ``afloat`` leaves the surface only with a descent at full thrust.
    """
    stages = Stages(out, kill_at)

    def symptom(self: CampaignDives, stage: str, mission: str) -> Symptom | None:
        flown = script.load(CampaignFolder(out).mission_file(mission))
        if f"{stage}/{mission}" != afloat or scaling.descends_at_full_thrust(flown):
            return None
        return Symptom(SymptomKind.AFLOAT, "depth", "does not leave the surface", "fly faster")

    def fly(dive: Dive, *_: object, **__: object) -> FlightResult:
        name = f"{dive.log.parent.name}/{dive.log.stem}"
        text = repr((sorted(dive.parameters.items()), dive.items, dive.notes["seed"]))
        stages.reach(FLYING + name)
        dive.log.write_text(text[: len(text) // 2])
        stages.reach(f"{FLYING}half of {name}")
        dive.log.write_text(text)
        stages.reach(f"{FLYING}end of {name}")
        sizes_deg = [abs(item.p2) for item in dive.items if item.command == MavCmd.USER_1]
        too_large = name in LARGEST_DEG and max(sizes_deg) > LARGEST_DEG[name]
        failsafes = ("Failsafe: pitch 60 deg",) if too_large else ()
        vehicle_s = 100.0 if name == afloat else 10.0  # its log is read
        return FlightResult(dive.log, vehicle_s, 1.0, len(text), 0, (), failsafes, "")

    def write(path: Path, text: str) -> None:
        name = f"{path.relative_to(out)}{text.count('log_sha256')}"
        path.with_name(output_files.temporary_name(path.name)).write_text(text[: len(text) // 2])
        stages.reach(f"half of {name}")
        WRITE_WHOLE(path, text)
        stages.reach(f"end of {name}")

    patch = pytest.MonkeyPatch()  # never undone: the process ends
    patch.setattr(dives, "fly_simulated", fly)
    patch.setattr(run, "Worker", lambda *_: FakeWorker(out, stages))
    patch.setattr(run, "start_fork_server", lambda: None)
    patch.setattr(CampaignDives, "_launch", lambda *_: None)
    patch.setattr(CampaignDives, "_symptom", symptom)
    for module in (run, dives, folder_setup, dive_records):
        patch.setattr(module, "write_whole", write)
    patch.setattr(
        summary_file, "write", lambda summary, path: path.write_bytes(msgspec.json.encode(summary))
    )
    patch.setattr(summary_file, "read", lambda path: None)
    request = CampaignRequest(out, resume=True)
    Campaign(request, lambda name, at: None, lambda text: stages.reach(SAID + text)).run()


def fork_campaign(out: Path, kill_at: str = "", afloat: str = "") -> int:
    """Run a campaign in a forked process, which has imported everything; return its status."""
    pid = os.fork()
    if not pid:
        status = 1
        try:
            run_campaign(out, kill_at, afloat)
            status = 0
        except Exception:
            traceback.print_exc()
        finally:
            os._exit(status)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def results(out: Path) -> dict[str, Any]:
    """Return the content of all files of a campaign, without its wall time."""
    files: dict[str, Any] = {
        str(path.relative_to(out)): path.read_text() for path in out.rglob("*") if path.is_file()
    }
    files["summary.json"] = msgspec.json.decode(files["summary.json"]) | {"wall_s": 0.0}
    return files


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.timeout(600)
def test_campaign_killed_at_any_stage_and_resumed_is_identical(tmp_path: Path) -> None:
    with process("-m", __name__, str(tmp_path)) as checks:  # one thread, so that it may fork
        ended = checks.finish(timeout_s=580.0)
    assert ended.status == 0, ended.stderr


def check_all_stages(tmp_path: Path) -> None:
    """Kill a campaign at each stage and resume it."""
    run_campaign(tmp_path / "whole")
    expected = results(tmp_path / "whole")
    assert RECORDS_FILE not in expected
    assert {"missions/retest_1.toml", "missions/retest_2.toml"} <= expected.keys()
    reached = (tmp_path / "whole.stages").read_text().splitlines()
    stages = dict.fromkeys(reached)
    assert reached.count(f"{FLYING}end of identification/elevator_sweeps") == 3
    assert reached.count(f"{FLYING}end of identification/retest_1") == 2
    ends = sum(name.startswith(f"{FLYING}end of") for name in reached)
    dives = [name for name in stages if name.startswith(FLYING)]
    uncounted = FLYING, SAID, f"half of {RECORDS_FILE}"
    others = [name for name in stages if not name.startswith(uncounted)]
    others = [name for name in others if not name.startswith(f"end of {RECORDS_FILE}")]
    killed = [name for name in dives if name.endswith(KILLED_DIVES)] + others
    killed += [f"{part} of {RECORDS_FILE}{count}" for part in ("half", "end") for count in (1, 9)]
    assert len(killed) > 40
    for number, stage in enumerate(killed):
        out = tmp_path / str(number)
        assert fork_campaign(out, kill_at=stage) == -signal.SIGKILL, stage
        assert fork_campaign(out) == 0, stage
        assert results(out) == expected, stage
        flown = [
            name
            for name in out.with_suffix(".stages").read_text().splitlines()
            if name.startswith(f"{FLYING}end of")
        ]
        assert len(flown) <= ends + 1, f"{stage}: dives were flown again"


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("afloat", AFLOAT_DIVES)
def test_campaign_with_a_dive_afloat_and_resumed_is_identical(tmp_path: Path, afloat: str) -> None:
    with process("-m", __name__, str(tmp_path), afloat) as checks:
        ended = checks.finish(timeout_s=580.0)
    assert ended.status == 0, ended.stderr


def check_afloat(tmp_path: Path, afloat: str) -> None:
    """Kill a campaign, in which a dive stays afloat, at each stage from then on, and resume it."""
    run_campaign(tmp_path / "whole", afloat=afloat)
    expected = results(tmp_path / "whole")
    reached = (tmp_path / "whole.stages").read_text().splitlines()
    assert any("descent at full thrust" in name for name in reached)
    first = reached.index(f"{FLYING}end of {afloat}")
    stages = dict.fromkeys(reached[first:])
    kinds = SAID, "begin ", f"{FLYING}end of verification"
    killed = [name for name in stages if name.startswith(kinds)]
    assert len(killed) > 5
    for number, stage in enumerate(killed):
        out = tmp_path / str(number)
        assert fork_campaign(out, kill_at=stage, afloat=afloat) == -signal.SIGKILL, stage
        assert fork_campaign(out, afloat=afloat) == 0, stage
        assert results(out) == expected, stage


def test_resume_with_other_options_names_the_option(tmp_path: Path) -> None:
    folder_setup.prepare_folder(CampaignRequest(tmp_path, seed=7))
    with pytest.raises(InputError, match=r"--resume: .*campaign\.toml has seed = 7, not 8; give"):
        folder_setup.refuse_folder(CampaignRequest(tmp_path, seed=8, resume=True))
    folder_setup.prepare_folder(CampaignRequest(tmp_path, seed=7, jobs=3, resume=True))


def test_resume_with_other_versions_is_refused(tmp_path: Path) -> None:
    folder_setup.prepare_folder(CampaignRequest(tmp_path))
    file = tmp_path / "campaign.toml"
    file.write_text(file.read_text().replace("numpy = ", 'numpy = "0.1" # '))
    with pytest.raises(InputError, match="other versions"):
        folder_setup.prepare_folder(CampaignRequest(tmp_path, resume=True))


def test_resume_with_force_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--resume cannot be combined with --force"):
        folder_setup.refuse_folder(CampaignRequest(tmp_path, resume=True, force=True))


def test_dive_is_repeated_after_another_request_or_with_another_log(tmp_path: Path) -> None:
    log, asked = tmp_path / "trim.mcap", digest_request({"HDG_P": 1.0}, (), 1)
    log.write_text("log")
    records = DiveRecords(tmp_path)
    records.add("prototype/trim", asked, FlightResult(log, 1.0, 1.0, 1, 0, (), (), ""))
    again = DiveRecords(tmp_path)
    assert again.find("prototype/trim", log, asked) is not None
    assert again.find("prototype/trim", log, digest_request({"HDG_P": 1.1}, (), 1)) is None
    assert again.find("prototype/trim", log, digest_request({"HDG_P": 1.0}, (), 2)) is None
    log.write_text("lag")
    assert again.find("prototype/trim", log, asked) is None
    log.unlink()
    assert again.find("prototype/trim", log, asked) is None


@pytest.mark.parametrize("text", ["", "[1]", '{"a": {}}'])
def test_damaged_records_are_named(tmp_path: Path, text: str) -> None:
    (tmp_path / RECORDS_FILE).write_text(text)
    with pytest.raises(InputError, match=r"dives\.json: .*; remove it to fly all dives again"):
        DiveRecords(tmp_path)


if __name__ == "__main__":
    folder, *dive = sys.argv[1:]
    if dive:
        check_afloat(Path(folder), *dive)
    else:
        check_all_stages(Path(folder))
