"""The tailcone's bench test: sinusoids over frequency and amplitude, one axis at a time, on a
vehicle that lies still.

The vehicle plays them herself, as the open-loop tests she flies at sea, so that a slow radio shifts
nothing. Her propeller stands still: she is armed in HOLD without thrust, and even her failsafes
find no thrust to surface with."""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from ground.client import flight
from ground.client.flight import FlightProgress
from ground.client.recorder import Recorder
from ground.client.vehicle import VehicleClient, VehicleClientError
from ground.errors import InputError, OperationError
from ground.missions.signals import AXES, SIGNALS
from ground.simulation.processes import SimulatedVehicle
from mavlink_io.clock import wall_s
from mavlink_io.dialect import constant
from mavlink_io.mission_items import MavCmd
from sysid.data import readers
from sysid.data.dataset import LogError
from sysid.estimation import bench_test
from sysid.estimation.bench_test import AxisBench, AxisName

AMPLITUDES_DEG = (5.0, 10.0, 20.0, 30.0)
"""Peak to peak; the paper fitted its model to 10 and gives limits for 10 and 30."""
FREQUENCIES_HZ = (0.05, 0.08, 0.12, 0.18, 0.25, 0.35, 0.5, 0.75, 1.0, 1.5)
TRANSIENT_S, MIN_TEST_S, CYCLES = 3.3, 7.0, 2.0
"""Of a test: before anything is measured, and how long and how many cycles are."""
MIN_HZ, MAX_HZ = 0.005, 4.0
"""What the longest test has room for, and what an encoder's ten reports a second still show."""
RATES_HZ = {"ACTUATOR_OUTPUT_STATUS": 50.0, "ATTITUDE": 10.0, "LOCAL_POSITION_NED": 5.0}
PARAMETERS = {
    "SID_DEPTH_MIN": -10.0,
    "SID_ALT_MIN": 0.0,
    "SID_TIME_MAX": 600.0,
    "FS_ALT_M": 0.0,
    "TRIM_RUD_DEG": 0.0,
    "TRIM_ELE_DEG": 0.0,
    "THR_CRUISE_PCT": 0.0,
}
"""What a test on land needs: limits that are not the sea's, the whole travel, and no thrust."""
TEST_END_TIMEOUT_S = 10.0
"""Vehicle seconds by which a test may end late before it counts as lost."""
LISTEN_S = 3.0
_SERVO = constant("MAV_COMP_ID_SERVO1")


class Sweep(NamedTuple):
    """One sinusoid on one axis."""

    axis: str
    amplitude_deg: float
    """Peak to peak."""
    frequency_hz: float

    @property
    def duration_s(self) -> float:
        return TRANSIENT_S + max(MIN_TEST_S, CYCLES / self.frequency_hz)


class Session(NamedTuple):
    """What to sweep, and where to keep what comes of it."""

    folder: Path
    axes: tuple[str, ...] = tuple(AXES)
    amplitudes_deg: tuple[float, ...] = AMPLITUDES_DEG
    frequencies_hz: tuple[float, ...] = FREQUENCIES_HZ

    @property
    def sweeps(self) -> list[Sweep]:
        return [
            Sweep(a, size, hz)
            for a in self.axes
            for size in self.amplitudes_deg
            for hz in self.frequencies_hz
        ]


def check(session: Session) -> None:
    """Raises BadInputError for sweeps that no duct can make or no log can show."""
    for axis in session.axes:
        if axis not in AXES:
            raise InputError(f"--axis {axis}: expected {' or '.join(AXES)}")
    for size in session.amplitudes_deg:
        if not 0.0 < size < 180.0:
            raise InputError(f"--amplitude {size:g}: expected degrees peak to peak, above 0")
    for hz in session.frequencies_hz:
        if not MIN_HZ <= hz <= MAX_HZ:
            raise InputError(f"--frequency {hz:g}: expected {MIN_HZ:g} to {MAX_HZ:g} Hz")
    if len(set(session.frequencies_hz)) < 2:
        raise InputError(
            "--frequency: expected at least two of them, or no lag can be told from a delay"
        )


def measure(
    session: Session,
    where: str | SimulatedVehicle,
    watch: Callable[[FlightProgress], None],
    key_file: Path | None = None,
) -> dict[AxisName, AxisBench]:
    """Run a session and say what it shows. Raises AddressError, BadInputError, FailedError."""

    path = session.folder / "bench.mcap"
    with flight.open_recorded_vehicle(where, path, key_file=key_file) as (vehicle, recorder):
        vehicle.connect()
        _check_travel(session, vehicle.parameter("ACT_TRAVEL_DEG"))
        with armed_without_thrust(vehicle) as before:
            recorder.attach_parameters(before | PARAMETERS)
            _sweep(session.sweeps, vehicle, recorder, watch)
    try:
        return bench_test.analyse(readers.read(path))
    except (bench_test.BenchError, LogError) as error:
        raise OperationError(str(error)) from None


def _check_travel(session: Session, travel_deg: float) -> None:
    largest = max(session.amplitudes_deg)
    if largest > 2.0 * travel_deg:
        raise InputError(
            f"--amplitude {largest:g}: this duct's travel is {2.0 * travel_deg:g} deg peak to peak"
        )


@contextmanager
def armed_without_thrust(vehicle: VehicleClient) -> Iterator[dict[str, float]]:
    """The vehicle armed without thrust, and afterwards disarmed and with the parameters that it
    had."""
    before = vehicle.parameters()
    if vehicle.armed:
        raise OperationError("the vehicle is armed; a bench test begins with a vehicle at rest")
    for name, rate_hz in RATES_HZ.items():
        vehicle.set_interval(name, rate_hz)
    try:
        for name, value in PARAMETERS.items():
            vehicle.set_parameter(name, value)
        vehicle.set_mode("HOLD")
        vehicle.arm()
        yield before
    finally:
        if vehicle.armed:
            vehicle.disarm(force=True)
        for name in PARAMETERS:
            vehicle.set_parameter(name, before[name])


def _sweep(
    sweeps: list[Sweep],
    vehicle: VehicleClient,
    recorder: Recorder,
    watch: Callable[[FlightProgress], None],
) -> None:
    listen_until(vehicle, recorder, recorder.vehicle_s + LISTEN_S)
    if not recorder.heard(_SERVO, "ACTUATOR_OUTPUT_STATUS"):
        raise OperationError(
            "nothing measures the duct's angle: fit an encoder that sends ACTUATOR_OUTPUT_STATUS as"
            " SERVO1"
        )
    began_s, vehicle_began_s = wall_s(), recorder.vehicle_s
    for number, sweep in enumerate(sweeps):
        watch(
            FlightProgress(
                number,
                len(sweeps),
                recorder.vehicle_s - vehicle_began_s,
                wall_s() - began_s,
                0.0,
                0.0,
            )
        )
        _play(sweep, vehicle, recorder)


def _play(sweep: Sweep, vehicle: VehicleClient, recorder: Recorder) -> None:
    """One test from its start to the vehicle's word that it is finished."""
    told, late_s = len(vehicle.texts), recorder.vehicle_s + sweep.duration_s + TEST_END_TIMEOUT_S
    hz = sweep.frequency_hz
    axis, chirp = AXES[sweep.axis], SIGNALS["chirp"]
    vehicle.command(
        MavCmd.USER_1, axis, 0.5 * sweep.amplitude_deg, hz, hz, sweep.duration_s, chirp, 0.0
    )
    while not any(text.text == "SystemID Finished" for text in vehicle.texts[told:]):
        for text in vehicle.texts[told:]:
            if text.text.startswith("SystemID Stopped"):
                raise OperationError(f"{sweep.axis} at {hz:g} Hz: {text.text}")
        if recorder.vehicle_s > late_s:
            raise VehicleClientError(
                f"{sweep.axis} at {hz:g} Hz: the vehicle did not say that the test is finished"
            )
        vehicle.pump(0.02)


def listen_until(vehicle: VehicleClient, recorder: Recorder, vehicle_s: float) -> None:
    """Listen until the vehicle's clock says so."""
    while recorder.vehicle_s < vehicle_s:
        vehicle.pump(0.02)


def as_json(found: Mapping[AxisName, AxisBench]) -> dict[str, Any]:
    """The result with degrees where people read them."""
    return {name: _axis_json(axis) for name, axis in found.items()}


def _axis_json(axis: AxisBench) -> dict[str, Any]:
    model = axis.model
    return {
        "model": {
            "gain": _pair(model.gain),
            "natural_frequency_radps": _pair(model.natural_frequency_radps),
            "damping_ratio": _pair(model.damping_ratio),
            "delay_s": _pair(model.delay_s),
            "rate_degps": _pair(model.rate_radps, math.degrees(1.0)),
            "backlash_deg": _pair(model.backlash_rad, math.degrees(1.0)),
            "bias_deg": _pair(model.bias_rad, math.degrees(1.0)),
            "bias_moved_deg": math.degrees(model.bias_moved_rad),
            "residual_deg": math.degrees(model.residual_rad),
        },
        "limits": [
            limit._asdict()
            | {
                "triangle_hz": _pair(limit.triangle_hz),
                "sine_hz": _pair(limit.sine_hz),
            }
            for limit in axis.limits
        ],
        "points": [point._asdict() for point in axis.points],
    }


def _pair(estimate: Any, scale: float = 1.0) -> dict[str, float | None]:
    sd = None if estimate.sd is None else estimate.sd * scale
    return {"value": estimate.value * scale, "sd": sd}


PAPER = {
    "gain": 1.0,
    "natural_frequency_radps": 3.0,
    "damping_ratio": 0.6,
    "delay_s": 0.3,
    "rate_degps": 15.0,
}
"""1/(s^2/9 + 4s/10 + 1) with 0.3 s of delay, at no more than 15 deg/s."""


def format_text(result: Mapping[str, Any], folder: Path) -> str:
    """The result as a person reads it."""
    lines = []
    for name, axis in result.items():
        lines += [f"{name:24s}     fitted +- sd            the paper"]
        for key, found in axis["model"].items():
            paper = f"{PAPER[key]:10.3f}" if key in PAPER else " " * 9 + "-"
            if isinstance(found, dict):
                sd = "not shown by the data" if found["sd"] is None else f"{found['sd']:.4f}"
                lines.append(f"  {key:24s} {found['value']:9.4f} +- {sd:10s} {paper}")
            else:
                lines.append(f"  {key:24s} {found:9.4f}")
        lines += ["  rate limit at            triangle Hz   sine Hz   -3 dB Hz    the paper Hz"]
        lines += [_format_limit(limit) for limit in axis["limits"]]
        lines += [""]
    return "\n".join([*lines, f"{folder}: bench.mcap, bench.json, figure4.png"])


def _format_limit(limit: Mapping[str, Any]) -> str:
    half, paper = (
        f"{value:8.3f}" if value is not None else "       -"
        for value in (limit["half_power_hz"], limit["paper_hz"])
    )
    return (
        f"  {limit['amplitude_deg']:6.1f} deg peak to peak {limit['triangle_hz']['value']:9.3f} "
        f"{limit['sine_hz']['value']:9.3f} {half:>10s} {paper:>12s}"
    )
