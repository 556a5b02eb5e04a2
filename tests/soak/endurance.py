"""Soak row: dives one after the other in one run of autopilot and simulator, up to 24 h."""

import socket
import sys
import tempfile
import time
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path

from autopilot.control import modes
from mavlink_io.mission_items import MavCmd, MissionItem
from mavlink_io.request import ExchangeError
from mavlink_io.services.missions import MissionClient
from tests.helpers.exchange import run as exchange
from tests.helpers.subprocesses import Process, autopilot, free_port, on_one_core, process
from tests.processes.test_autopilot import ARMED, GROUND, VEHICLE, Ground
from tests.soak.row import Batch, Row

HOURS = 24
"""Required vehicle time of one run, h."""
LEG_S, DEPTH_M = 280.0, 5.0
"""Duration and depth of each of the four legs of a dive: a square."""
WARM_UP_DIVES = 3
"""Dives after which memory and handles are measured first: caches are full, logs were rotated."""
MAX_GROWTH_MB = 4.0
"""Growth of the resident memory that counts as flat: noise of the allocator."""
ARM, SET_MODE = 400, 176
ATTEMPTS = 100
"""Number of times that arming is asked for."""


class Usage:
    """Memory and file handles of a process, from its first measurement on."""

    def __init__(self, child: Process) -> None:
        self._child = child
        self._first = self._last = self._read()
        self.growth_mb = self.more_handles = 0.0

    def __str__(self) -> str:
        memory_mb, handles = self._last
        return f"{memory_mb:.1f} MB, {handles} handles"

    def measure(self) -> None:
        """Keep the largest growth."""
        now = self._last = self._read()
        self.growth_mb = max(self.growth_mb, now[0] - self._first[0])
        self.more_handles = max(self.more_handles, now[1] - self._first[1])

    def _read(self) -> tuple[float, int]:
        """Return resident memory (MB) and number of open files."""
        folder = Path(f"/proc/{self._child.pid}")
        (line,) = (x for x in (folder / "status").read_text().splitlines() if "VmRSS" in x)
        return float(line.split()[1]) / 1e3, len(list((folder / "fd").iterdir()))


class Shore(Ground):
    """A ground station that starts dives and receives all telemetry."""

    time_s = 0.0
    """Vehicle time of the newest attitude."""

    def begin(self) -> None:
        """Upload the mission and start it."""
        upload = MissionClient(self.endpoint.send, GROUND, VEHICLE).upload(square())
        exchange(upload, self.endpoint)
        assert self.command(SET_MODE, 1.0, modes.MISSION.number) == 0, "mode refused"
        for _ in range(ATTEMPTS):  # refused until the first samples have come
            if self.command(ARM, 1.0) == 0:
                return
            time.sleep(0.1)
        raise AssertionError("arming refused")

    def wait_for_end(self) -> None:
        """Receive until the vehicle is disarmed."""
        seen_armed = False
        while True:
            frames = self.frames()
            assert frames, "no telemetry"
            for frame in frames:
                if frame.name == "ATTITUDE":
                    self.time_s = int.from_bytes(frame.payload[:4], "little") / 1e3
                elif frame.name == "HEARTBEAT" and frame.component == VEHICLE.component:
                    armed = bool(frame.decode().base_mode & ARMED)
                    if seen_armed and not armed:
                        return
                    seen_armed |= armed


def square() -> tuple[MissionItem, ...]:
    """Return the items of a dive: four legs, then the surface."""
    items = [
        MissionItem(0, 2, MavCmd.DO_CHANGE_SPEED, p1=1.0, p2=-2.0, p3=-1.0),
        MissionItem(1, 2, MavCmd.DO_CHANGE_ALTITUDE, p1=-DEPTH_M, p2=3.0),
    ]
    for leg in range(4):
        items.append(MissionItem(len(items), 2, MavCmd.CONDITION_YAW, p1=90.0 * leg))
        items.append(MissionItem(len(items), 2, MavCmd.NAV_DELAY, p1=LEG_S))
    return tuple(items)


def run(first: int, count: int) -> Batch:
    """Dive for a number of hours of vehicle time in one run."""
    batch = Batch()
    port, hil = free_port(socket.SOCK_STREAM), free_port()
    with tempfile.TemporaryDirectory() as folder:
        parameters, logs = Path(folder) / "parameters.param", Path(folder) / "logs"
        # the simulated battery lasts for a few hours, and a mission for the rest of it is refused
        parameters.write_text("FS_BATT_PCT,0\nFS_BATT_V,0\nBAT_CRUISE_H,0\n")
        options = ("--params", str(parameters), "--logs", str(logs))
        link = f"127.0.0.1:{hil}"
        with (
            autopilot(f"udpin:{link}", f"tcpin:127.0.0.1:{port}", options=options) as child,
            process(
                "-m", "sitl", "--hil", f"udpout:{link}", "--speed", "max", "--wait-for-arm"
            ) as sea,
            on_one_core(child, sea),
            closing(Shore(port)) as shore,
        ):
            try:
                _dive(batch, shore, {"autopilot": child, "sitl": sea}, logs, 3600.0 * count)
            except (AssertionError, ExchangeError) as error:
                batch.fail(first, f"after {shore.time_s:.0f} s: {error}")
    return batch


def _dive(
    batch: Batch, shore: Shore, programs: dict[str, Process], logs: Path, duration_s: float
) -> None:
    """Dive again and again, and measure both programs after each dive."""
    usages: dict[str, Usage] = {}
    dives = 0
    while shore.time_s < duration_s:
        shore.begin()
        shore.wait_for_end()
        dives += 1
        for path in sorted(logs.glob("*.mcap"))[:-1]:
            path.unlink()
        if dives == min(WARM_UP_DIVES, 1 + int(duration_s // 7200.0)):
            usages = {name: Usage(child) for name, child in programs.items()}
        for usage in usages.values():
            usage.measure()
        shown = ", ".join(f"{name} {usage}" for name, usage in usages.items())
        print(f"endurance: dive {dives}, {shore.time_s / 3600.0:.2f} h; {shown}", file=sys.stderr)
    batch.add("dives", dives)
    batch.add("max hours in one run", shore.time_s / 3600.0)
    for name, usage in usages.items():
        batch.add(f"max growth MB {name}", usage.growth_mb)
        batch.add(f"max more handles {name}", usage.more_handles)


def describe(counts: Mapping[str, float]) -> str:
    """Return the result."""
    parts = [
        f"{name} +{counts.get(f'max growth MB {name}', 0.0):.1f} MB,"
        f" +{counts.get(f'max more handles {name}', 0.0):.0f} handles"
        for name in ("autopilot", "sitl")
    ]
    hours = counts.get("max hours in one run", 0.0)
    return f"{counts.get('dives', 0):.0f} dives, {hours:.1f} h in one run; {'; '.join(parts)}"


def holds(counts: Mapping[str, float]) -> bool:
    """Return whether memory and handles are flat."""
    names = ("autopilot", "sitl")
    return (
        not counts.get("failures")
        and all(counts.get(f"max growth MB {name}", 0.0) <= MAX_GROWTH_MB for name in names)
        and not any(counts.get(f"max more handles {name}") for name in names)
    )


ROW = Row(
    title="hours of vehicle time in one run",
    full_size=HOURS,
    batch_size=HOURS,
    run=run,
    describe=describe,
    holds=holds,
    requirement=f"memory within {MAX_GROWTH_MB:.0f} MB and file handles flat after the first dives",
)
