"""The figures of `python -m benchmarks`: how each is measured, and its target."""

from enum import StrEnum
from typing import NamedTuple


class Mode(StrEnum):
    """What else the machine does during the measurement."""

    IDLE = "idle"
    """Nothing that this program started."""
    BUSY = "busy"
    """One process per core that computes all the time."""


class Row(NamedTuple):
    """One figure; some have several cases, such as one per program."""

    name: str
    """Name for the option --rows and key in the results."""
    title: str
    unit: str
    method: str
    """How the figure is measured, for `docs/performance.md`."""
    limit: float | None = None
    """Target on an idle machine; None for a figure that is only reported."""
    busy_limit: float | None = None
    """Target on a busy machine."""
    is_minimum: bool = False
    """Whether the target is the lowest permitted number; otherwise it is the highest."""
    is_ratio: bool = False
    """Whether the target applies to the ratio to the reference instead of the value."""
    repetitions: int = 5
    """Default number of repetitions; the median counts."""

    def target(self, mode: Mode) -> float | None:
        """Return the target in a mode; None without one."""
        return self.limit if mode is Mode.IDLE else self.busy_limit


def _row(name: str, title: str, unit: str, method: str, **details: object) -> Row:
    """Return a row; without a target of its own the busy mode has that of the idle mode."""
    details.setdefault("busy_limit", details.get("limit"))
    return Row(name, title, unit, " ".join(method.split()), **details)  # type: ignore[arg-type]


_DIVES = (
    _row(
        "dive-tick",
        "recorded dive in lockstep: wall time of a tick",
        "us",
        """The mission `combined` in the disturbed sea as `ground fly --sitl` flies it: simulator
        and autopilot are processes that exchange MAVLink over UDP, and every message is recorded
        over TCP. The value is wall time from arming to disarming divided by the number of ticks of
        20 ms. The floor is measured directly before each dive: two processes on one core exchange
        datagrams of 150 and 93 bytes, the sizes of a tick, and block while they wait; the median
        round trip counts.""",
        limit=5.0,
        busy_limit=8.0,
        is_ratio=True,
    ),
    _row(
        "dive-speed",
        "recorded dive in lockstep: speed",
        "x real time",
        """The same dives: vehicle time over wall time. The reference is the closed loop in one
        process without sockets (`tick-by-tick`), measured in the same run.""",
        limit=300.0,
        busy_limit=150.0,
        is_minimum=True,
    ),
)
_IN_PROCESS = (
    _row(
        "closed-loop",
        "closed loop in one process, four Runge-Kutta steps a tick",
        "x real time",
        """The loop of `ground simulate` and of the studies: tailcone, body, sensor noise and
        autopilot, many ticks in one compiled call. `sysid.monte_carlo.simulate.fly` flies
        `elevator_steps`, legs and tests 10 m deep, with four steps of 5 ms in every tick; the dive
        is counted from its first line to the finished log. The value is vehicle time over processor
        time on one core. The floor is the physics alone: the same number of Runge-Kutta steps of 5
        ms in one compiled call.""",
        limit=4000.0,
        is_minimum=True,
    ),
    _row(
        "closed-loop-20ms",
        "closed loop in one process, one step of 20 ms a tick",
        "x real time",
        """As `closed-loop`, with one Runge-Kutta step of 20 ms instead of four of 5 ms wherever the
        vehicle is clear of surface and floor. The floor is one such step a tick in one compiled
        call.""",
        limit=8000.0,
        is_minimum=True,
    ),
    _row(
        "tick-by-tick",
        "simulator step and autopilot tick, called in turn",
        "x real time",
        """The two functions of simulator and autopilot, with all sensors and their devices and with
        faults, environment and modes of any kind, without sockets, logs and processes: the armed
        vehicle flies `combined` in the disturbed sea. The value is vehicle time over processor time
        on one core. The floor is the physics alone, as for `closed-loop`.""",
    ),
    _row(
        "plain-tick",
        "autopilot tick in plain Python: share of one core at 50 Hz",
        "%",
        """The tick of `tick-by-tick` without numba (NUMBA_DISABLE_JIT=1), as on a vehicle's
        computer: processor time of the autopilot's tick over 20 ms. The reference is the same tick
        where numba is installed.""",
        limit=10.0,
    ),
    _row(
        "simulated-dive",
        "dive of 150 s in `ground simulate`: processor time",
        "s",
        """`sysid.monte_carlo.simulate.fly` on one straight leg, with a vehicle, sensor noise and
        disturbance from the prior of `caribou_nominal`; scaled to 150 s of vehicle time. The floor
        is the physics alone for the same time: Runge-Kutta steps of 5 ms in one compiled call.""",
        limit=0.04,
    ),
    _row(
        "physics-step",
        "Runge-Kutta step of the vehicle",
        "us",
        """One step of the six-degree-of-freedom model in deep still water, in a loop of 2000. The
        peer is the same model in C (`benchmarks/speed/physics.c`) compiled with `cc -O3`; before
        the measurement both must give the same states to rounding, in deep and in shallow water.
        Rounds of a few milliseconds alternate; the shortest of each counts.""",
        limit=1.0,
        is_ratio=True,
        repetitions=5,
    ),
)
_CAMPAIGNS = (
    _row(
        "campaign",
        "whole campaign, warm",
        "s",
        """Wall time of `ground campaign --seed 1`, from start to exit, report included, after one
        that filled the caches. The floor is the UDP exchange of `dive-tick` for every tick of the
        campaign, divided by the number of cores.""",
        limit=25.0,
        repetitions=3,
    ),
    _row(
        "fresh-clone",
        "first campaign in a fresh clone after installation",
        "s",
        """The same command in a new `git clone` of the last commit, with the installed packages of
        this environment. `python -m ground.compile_kernels`, which the installation runs, precedes
        it and is not included.""",
        limit=35.0,
        repetitions=3,
    ),
    _row(
        "refit",
        "refit of the six logs of a campaign: processor time",
        "s",
        """User and system time of `ground refit` on four logs with two held out, with validation
        and verdict, start of the program included. The reference reads the same logs with the
        package `mcap`, without decoding the messages.

        The other starts of a fit are searched one after the other. A search that comes near a
        known end stops there: eight starts take 53 steps and 0.53 s of a campaign's refit.
        Side by side they would not know each other's ends and take 137 steps and 1.4 s, at best
        0.7 s on each of two cores.""",
        limit=3.0,
        repetitions=5,
    ),
)
_MESSAGES = (
    _row(
        "hil-codec",
        "HIL messages of a tick, encoded and decoded",
        "us",
        """HIL_SENSOR and HIL_ACTUATOR_CONTROLS, each packed to bytes and parsed again. The peer is
        pymavlink's generated codec with the same values. Rounds alternate.""",
    ),
    _row(
        "recorder",
        "recorder, per message",
        "us",
        """Telemetry of a tick written to an MCAP file with time stamps, index and compression. The
        floor appends the same bytes to a file.""",
    ),
)
_STUDIES = (
    _row(
        "study-sysid",
        "`make benchmark-sysid`",
        "min",
        """Not run as a whole: two trials of each kind on each vehicle are run in one process. The
        processor time of the second is multiplied by the number of trials; what the first needs
        more is added once per core, because each process computes some data once. The sum is
        divided by the number of cores. The measurement takes about ten minutes.""",
        limit=30.0,
        repetitions=1,
    ),
    _row(
        "study-control",
        "`make benchmark-control`",
        "min",
        """As `study-sysid`; the campaign that the study begins with is measured as a whole.""",
        limit=30.0,
        repetitions=1,
    ),
)
_PROCESSES = (
    _row(
        "memory-sitl",
        "peak memory of `sitl`",
        "MB",
        """Largest resident size (VmHWM of /proc) in a dive `combined` in lockstep. The floor is a
        Python interpreter that has imported numpy.""",
        limit=120.0,
        repetitions=3,
    ),
    _row(
        "memory-autopilot",
        "peak memory of `autopilot`",
        "MB",
        """The same dives. The floor is a bare Python interpreter.""",
        repetitions=3,
    ),
    _row(
        "help",
        "`--help` of each program",
        "s",
        """Wall time of `python -m PROGRAM --help`. The floor is an interpreter that does nothing
        (`python -c pass`).""",
        limit=0.25,
        repetitions=9,
    ),
    _row(
        "vehicles-real-time",
        "several simulated vehicles at once, in real time: share of the possible speed",
        "%",
        """1, 2, 4 and 8 vehicles fly with `--speed 1` at the same time, with one ground station
        that records all of them. The value is their vehicle time over the wall time of a common
        window, as a share of what is possible:
        their number, or the number that the cores can carry, which
        is the number of cores over the processor time that one vehicle alone needs per vehicle
        second (simulator, autopilot and ground). On a busy machine it is only reported: the cores
        are full from the start.""",
        limit=85.0,
        busy_limit=None,
        is_minimum=True,
        repetitions=3,
    ),
    _row(
        "vehicles-max",
        "several simulated vehicles at once, as fast as possible: share of the possible speed",
        "%",
        """As `vehicles-real-time` with `--speed max`. Possible is the number of vehicles times the
        speed of one alone, until the cores are full. Where the vehicles outnumber the cores and can
        fill them, the figure is only reported.""",
        limit=85.0,
        busy_limit=None,
        is_minimum=True,
        repetitions=3,
    ),
)
ROWS: dict[str, Row] = {
    row.name: row
    for row in (*_DIVES, *_IN_PROCESS, *_CAMPAIGNS, *_MESSAGES, *_STUDIES, *_PROCESSES)
}
"""All rows by name, in the order of the table."""
