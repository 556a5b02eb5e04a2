"""Speed of recorded dives: wall time from arming to disarming, in lockstep over UDP and TCP."""

from benchmarks.speed import closed_loop, ping_pong
from benchmarks.speed.results import Measurement, Reference
from benchmarks.speed.session import Session
from ground.client import flight
from ground.client.flight import FlightResult
from ground.simulation.processes import SimulatedVehicle, Simulation
from mavlink_io.errors import OperationError
from mavlink_io.tick import TICK_S

MISSION = "combined"
PING_PONG = "UDP ping-pong on one core"


def recorded_dive(session: Session, number: int) -> FlightResult:
    """Fly and record one dive; the number is its seed. Raises OperationError."""
    dive = flight.Dive.load(MISSION, session.folder / f"dive-{number}.mcap")
    simulated = SimulatedVehicle(Simulation(scenario="disturbed", seed=number))
    result = flight.fly_simulated(dive, simulated)
    if result.lost_frames:
        raise OperationError(f"{MISSION}, seed {number}: {result.lost_frames} frames lost")
    return result


def measure(session: Session) -> list[Measurement]:
    """Measure wall time of a tick and speed; the dives alternate with their references."""
    session.report("dive: one that fills the caches")
    recorded_dive(session, 0)
    ticks_us, speeds, floors_us, alone = [], [], [], []
    for number in range(1, session.repetitions("dive-tick") + 1):
        floors_us.append(ping_pong.round_trip_us())
        alone.append(closed_loop.speed())
        result = recorded_dive(session, number)
        speeds.append(result.vehicle_s / result.wall_s)
        ticks_us.append(1e6 * TICK_S / speeds[-1])
        session.report(
            f"dive {number}: {speeds[-1]:.0f} x real time, {ticks_us[-1]:.0f} us a tick;"
            f" ping-pong {floors_us[-1]:.1f} us"
        )
    return [
        Measurement("dive-tick", tuple(ticks_us), Reference(PING_PONG, tuple(floors_us))),
        Measurement("dive-speed", tuple(speeds), Reference("closed loop alone", tuple(alone))),
    ]
