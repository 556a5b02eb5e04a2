"""Soak row: SIGKILL and SIGSTOP at random times in a dive under supervision."""

import os
import random
import signal
import tempfile
import time
import traceback
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path

from autopilot import param_file
from mavlink_io.logging.mcap_reader import McapMessage, McapReader
from mavlink_io.services.missions import MissionClient
from mavlink_io.services.params import ParamClient
from tests.helpers.exchange import run as exchange
from tests.processes.test_autopilot import GROUND, VEHICLE, Ground
from tests.processes.test_supervisor import MISSION, RESTART_S, Dive, children
from tests.soak.row import Batch, Row

MAX_LOST_S = 0.25
"""Requirement: longest part of a log that a killed process loses, s."""
ORPHAN_S = 2.0
"""Wall time after which no process of a killed supervisor may remain."""
VALUES = {"HDG_P": 0.7, "PTCH_P": 1.1}
"""Parameters that are set before the fault."""


def run(first: int, count: int) -> Batch:
    """Kill or stop one process per case."""
    batch = Batch()
    for case in range(first, first + count):
        with tempfile.TemporaryDirectory() as folder:
            try:
                _case(batch, random.Random(case), Path(folder))
            except Exception as error:
                place = traceback.extract_tb(error.__traceback__)[-1]
                batch.fail(case, f"{type(error).__name__}: {error} ({place.name}: {place.line})")
        batch.add("kills")
    return batch


def _case(batch: Batch, rng: random.Random, folder: Path) -> None:
    """Dive, set parameters, end a process at a random time, and check what is left."""
    dive = Dive(folder)
    supervisor_dies = rng.random() < 0.3
    fault = signal.SIGKILL if supervisor_dies else rng.choice((signal.SIGKILL, signal.SIGSTOP))
    with closing(dive.simulator), dive.start("--logs", str(folder / "logs")) as supervisor:
        dive.begin_mission()
        with closing(Ground(dive.port)) as ground:
            client = ParamClient(ground.endpoint.send, GROUND, VEHICLE)
            for name, value in VALUES.items():
                exchange(client.set(name, value), ground.endpoint)
        dive.fly(0.5 + rng.random())
        (child,) = children(supervisor.pid)
        os.kill(supervisor.pid if supervisor_dies else child, fault)
        killed_tick = dive.tick
        if supervisor_dies:
            supervisor.kill()
            _wait_for_end(child)
        else:
            restart_s = dive.time_to_answer_s()
            batch.add("max restart s", restart_s)
            assert restart_s < RESTART_S, f"restarted after {restart_s:.2f} s"
            with closing(Ground(dive.port)) as ground:
                missions = MissionClient(ground.endpoint.send, GROUND, VEHICLE)
                assert exchange(missions.download(), ground.endpoint) == MISSION
                client = ParamClient(ground.endpoint.send, GROUND, VEHICLE)
                for name, value in VALUES.items():
                    assert abs(exchange(client.get(name), ground.endpoint) - value) < 1e-6, name
    stored = param_file.load(folder / "parameters.param")
    assert all(abs(stored[name] - value) < 1e-6 for name, value in VALUES.items()), stored
    broken = list(folder.glob("*.broken*"))
    assert not broken, f"corrupt store {broken}"
    lost_s = killed_tick * 0.02 - _last_attitude_s(min((folder / "logs").glob("*.mcap")))
    batch.add("max log lost s", lost_s)
    assert lost_s <= MAX_LOST_S, f"{lost_s:.2f} s of the log are lost"


def _wait_for_end(child: int) -> None:
    """Wait until a process has ended."""
    deadline_s = time.monotonic() + ORPHAN_S
    while Path(f"/proc/{child}").exists():
        assert time.monotonic() < deadline_s, "an orphan is left"
        time.sleep(0.02)


def _last_attitude_s(path: Path) -> float:
    """Return the vehicle time of the last attitude in an unfinished log, s."""
    newest_ms = 0
    with path.open("rb") as file:
        for item in McapReader(file, lambda channel: channel.topic.endswith("/ATTITUDE")).items():
            if isinstance(item, McapMessage):
                newest_ms = max(newest_ms, int.from_bytes(bytes(item.data[:4]), "little"))
    return newest_ms / 1e3


def describe(counts: Mapping[str, float]) -> str:
    """Return the result."""
    return (
        f"{counts.get('kills', 0):.0f} ends, {counts.get('failures', 0):.0f} failures; restart at"
        f" most {counts.get('max restart s', 0):.2f} s, log lost at most"
        f" {counts.get('max log lost s', 0):.2f} s"
    )


ROW = Row(
    title="SIGKILL and SIGSTOP at random times",
    full_size=200,
    batch_size=1,
    run=run,
    describe=describe,
    holds=lambda counts: not counts.get("failures"),
    requirement="0 corrupt stores, <= 0.25 s of log lost, 0 orphans, mission and parameters kept",
)
