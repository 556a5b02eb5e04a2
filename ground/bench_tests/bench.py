"""Bench test of the tailcone: sine sweeps over frequency and amplitude, one axis at a time.

The autopilot generates the signals, as in open-loop tests at sea, so the delay of the link has no
effect. The vehicle is armed in mode HOLD without thrust, and the cruise thrust is set to zero, so
that no failsafe can start the propeller.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from ground.client import flight
from ground.client.flight import FlightProgress
from ground.client.recorder import Recorder
from ground.client.vehicle import CommandRefusedError, VehicleClient, VehicleClientError
from ground.missions.signals import AXES, SIGNALS
from ground.simulation.processes import SimulatedVehicle
from mavlink_io.clock import wall_s
from mavlink_io.codec import Frame
from mavlink_io.dialect import constant
from mavlink_io.errors import InputError, OperationError
from mavlink_io.mission_items import MavCmd
from sysid.data import readers
from sysid.data.dataset import LogError
from sysid.data.events import StopReason, TestAxis, TestWave
from sysid.data.segments import TestInterval, intervals_of_tests
from sysid.estimation import bench_test
from sysid.estimation.bench_test import AxisBench
from sysid.models.bench_priors import AxisName

AMPLITUDES_DEG = (5.0, 10.0, 20.0, 30.0)
"""Amplitudes, peak to peak. The paper fitted its model at 10 deg and gives limits at 10 and 30."""
FREQUENCIES_HZ = (0.05, 0.08, 0.12, 0.18, 0.25, 0.35, 0.5, 0.75, 1.0, 1.5)
TRANSIENT_S, MIN_TEST_S, CYCLES = 3.3, 7.0, 2.0
"""Time before the measurement; minimum time and minimum number of cycles of the measurement."""
MIN_HZ, MAX_HZ = 0.005, 4.0
"""Frequency limits: the longest test (600 s) and the 10 Hz reports of an encoder."""
RATES_HZ = {"ACTUATOR_OUTPUT_STATUS": 50.0, "ATTITUDE": 10.0, "LOCAL_POSITION_NED": 5.0}
"""Message rates during the test."""
PARAMETERS = {
    "SID_DEPTH_MIN": -10.0,
    "SID_ALT_MIN": 0.0,
    "SID_TIME_MAX": 600.0,
    "FS_ALT_M": 0.0,
    "FS_TIME_S": 0.0,
    "TRIM_RUD_DEG": 0.0,
    "TRIM_ELE_DEG": 0.0,
    "THR_CRUISE_PCT": 0.0,
}
"""Parameters of a test on land: no limits of depth, altitude and time, whole travel, no thrust."""
LISTEN_S = 3.0
"""Vehicle time in which the first report of an encoder must arrive."""
_SERVO, _COMMAND_ACK = constant("MAV_COMP_ID_SERVO1"), constant("MAVLINK_MSG_ID_COMMAND_ACK")


class Sweep(NamedTuple):
    """One sine on one axis."""

    axis: str
    amplitude_deg: float
    """Peak to peak."""
    frequency_hz: float

    @property
    def duration_s(self) -> float:
        """Duration of the test."""
        return TRANSIENT_S + max(MIN_TEST_S, CYCLES / self.frequency_hz)


class Session(NamedTuple):
    """Axes, amplitudes and frequencies of a bench test, and the folder for its results."""

    folder: Path
    axes: tuple[str, ...] = tuple(AXES)
    amplitudes_deg: tuple[float, ...] = AMPLITUDES_DEG
    frequencies_hz: tuple[float, ...] = FREQUENCIES_HZ

    @property
    def sweeps(self) -> list[Sweep]:
        """All sines in the order of the test."""
        return [
            Sweep(a, size, hz)
            for a in self.axes
            for size in self.amplitudes_deg
            for hz in self.frequencies_hz
        ]


def check(session: Session) -> None:
    """Raise InputError if an axis, amplitude or frequency is invalid."""
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
        raise InputError("--frequency: expected at least two, to distinguish lag and delay")


def measure(
    session: Session,
    target: str | SimulatedVehicle,
    watch: Callable[[FlightProgress], None],
    key_file: Path | None = None,
    system: int | None = None,
    on_remark: Callable[[str], None] | None = None,
) -> dict[AxisName, AxisBench]:
    """Run a bench test and return the identified actuator of each axis.

    Parameters
    ----------
    session : Session
        Sines to run.
    target : str or SimulatedVehicle
        Address of a vehicle, or a simulated vehicle.
    watch : Callable
        Called with the progress before each sine.
    key_file : Path, optional
        Key with which the link is signed.
    system : int, optional
        System id of the vehicle, where several are on the link.
    on_remark : Callable, optional
        Receives what is awaited before the test: the vehicle, or its sensors.

    Raises
    ------
    AddressError, InputError, OperationError
        The vehicle was not found or refused, has no encoder, or the data allow no fit.
    """
    path = session.folder / "bench.mcap"
    with flight.open_recorded_vehicle(
        target, path, key_file=key_file, system=system, on_remark=on_remark
    ) as (
        vehicle,
        recorder,
    ):
        vehicle.connect()
        _check_travel(session, vehicle.parameter("ACT_TRAVEL_DEG"))
        with armed_without_thrust(vehicle) as before:
            recorder.attach_parameters(before | PARAMETERS)
            tests = _sweep(session.sweeps, vehicle, recorder, watch)
    try:
        log = readers.read(path)
        marked = [test for test in intervals_of_tests(log) if not test.stop_reason]
        return bench_test.analyse(log, marked if len(marked) == len(tests) else tests)
    except LogError as error:
        raise bench_test.BenchError(str(error)) from None


def _check_travel(session: Session, travel_deg: float) -> None:
    """Raise InputError if an amplitude exceeds the travel of the duct."""
    largest = max(session.amplitudes_deg)
    if largest > 2.0 * travel_deg:
        raise InputError(
            f"--amplitude {largest:g}: this duct's travel is {2.0 * travel_deg:g} deg peak to peak"
        )


@contextmanager
def armed_without_thrust(vehicle: VehicleClient) -> Iterator[dict[str, float]]:
    """Arm the vehicle without thrust; disarm it and restore its parameters at the end.

    Yields the parameters before the test. Raises OperationError, VehicleClientError.
    """
    before = vehicle.parameters()
    if vehicle.armed:
        raise OperationError("the vehicle is armed; a bench test begins with a vehicle at rest")
    if missing := [name for name in PARAMETERS if name not in before]:
        raise OperationError(
            f"the vehicle has no parameter {missing[0]}; this test needs the Caribou autopilot"
        )
    for name, rate_hz in RATES_HZ.items():
        vehicle.set_interval(name, rate_hz)
    try:
        for name, value in PARAMETERS.items():
            vehicle.set_parameter(name, value)
        vehicle.set_mode("HOLD")
        vehicle.arm()
        yield before
    finally:
        _restore(vehicle, before)


def _restore(vehicle: VehicleClient, before: Mapping[str, float]) -> None:
    """Disarm, and restore each parameter. Raises OperationError with those that remain changed."""
    try:
        if vehicle.armed:
            vehicle.disarm(force=True)
    finally:
        failed: list[str] = []
        reason = ""
        for name in PARAMETERS:
            try:
                vehicle.set_parameter(name, before[name])
            except VehicleClientError as error:
                failed.append(f"{name} = {before[name]:g}")
                reason = reason or str(error)
        if failed:
            raise OperationError(
                f"{reason}; not restored: {', '.join(failed)}: set them before the next dive"
            )


def _sweep(
    sweeps: list[Sweep],
    vehicle: VehicleClient,
    recorder: Recorder,
    watch: Callable[[FlightProgress], None],
) -> list[TestInterval]:
    """Run the sines. Raises OperationError if no encoder reports, or a test is stopped."""
    listen_until(vehicle, recorder, recorder.vehicle_s + LISTEN_S)
    if not recorder.has_received(_SERVO, "ACTUATOR_OUTPUT_STATUS"):
        raise OperationError(
            "the angle of the duct is not measured: fit an encoder that sends"
            " ACTUATOR_OUTPUT_STATUS as SERVO1"
        )
    tests = []
    start_s, vehicle_start_s = wall_s(), recorder.vehicle_s
    for number, sweep in enumerate(sweeps):
        watch(
            FlightProgress(
                item=number,
                items=len(sweeps),
                vehicle_s=recorder.vehicle_s - vehicle_start_s,
                wall_s=wall_s() - start_s,
                depth_m=0.0,
                heading_deg=0.0,
            )
        )
        tests.append(_run_sweep(sweep, vehicle, recorder))
    return tests


def _run_sweep(sweep: Sweep, vehicle: VehicleClient, recorder: Recorder) -> TestInterval:
    """Run one sine; return its time range by the acknowledgements of its start and its end.

    On a busy machine these can be received late.
    """
    acknowledged_s: list[float] = []

    def on_frame(frame: Frame) -> None:
        if frame.message_id == _COMMAND_ACK and frame.decode().command == MavCmd.USER_1:
            acknowledged_s.append(recorder.vehicle_s)

    axis, hz, magnitude_deg = AXES[sweep.axis], sweep.frequency_hz, 0.5 * sweep.amplitude_deg
    signal = magnitude_deg, hz, hz, sweep.duration_s, SIGNALS["chirp"], 0.0
    vehicle.on_frame = on_frame
    try:
        vehicle.command(MavCmd.USER_1, axis, *signal)
    except CommandRefusedError as refusal:
        raise OperationError(f"{sweep.axis} at {hz:g} Hz: {refusal}") from None
    finally:
        vehicle.on_frame = None
    start_s = acknowledged_s[0]
    return TestInterval(
        start_s=start_s,
        stop_s=min(acknowledged_s[-1], start_s + sweep.duration_s),
        axis=TestAxis(axis),
        wave=TestWave.CHIRP,
        magnitude_deg=magnitude_deg,
        stop_reason=StopReason.COMPLETE,
    )


def listen_until(vehicle: VehicleClient, recorder: Recorder, vehicle_s: float) -> None:
    """Receive until a vehicle time."""
    while recorder.vehicle_s < vehicle_s:
        vehicle.pump(0.02)


def as_json(axes: Mapping[AxisName, AxisBench]) -> dict[str, Any]:
    """Return the result by axis as plain numbers, angles in degrees."""
    return {name: _axis_json(axis) for name, axis in axes.items()}


def _axis_json(axis: AxisBench) -> dict[str, Any]:
    """Return model, limits and frequency response of one axis as plain numbers."""
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
            "bias_change_deg": math.degrees(model.bias_change_rad),
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
    """Return an estimate and its standard deviation, both multiplied by `scale`."""
    sd = None if estimate.sd is None else estimate.sd * scale
    return {"value": estimate.value * scale, "sd": sd}


PAPER = {
    "gain": 1.0,
    "natural_frequency_radps": 3.0,
    "damping_ratio": 0.6,
    "delay_s": 0.3,
    "rate_degps": 15.0,
}
"""Actuator of the paper: 1/(s^2/9 + 4s/10 + 1) with a delay of 0.3 s, at most 15 deg/s."""

MAX_RELATIVE_SD = 0.5
"""Standard deviation, as a fraction of the value, above which an estimate is undetermined."""
_POSITIVE = ("gain", "natural_frequency_radps", "damping_ratio", "rate_degps")
"""Numbers that no actuator has near zero; the others may be zero within their uncertainty."""


def format_text(result: Mapping[str, Any], folder: Path) -> str:
    """Return the result as a table."""
    lines = []
    for name, axis in result.items():
        lines += [f"{name:24s}     fitted +- sd            the paper"]
        for key, value in axis["model"].items():
            paper = f"{PAPER[key]:10.3f}" if key in PAPER else " " * 9 + "-"
            if isinstance(value, dict):
                sd = "not shown by the data" if value["sd"] is None else f"{value['sd']:.4f}"
                note = "  undetermined" if _is_undetermined(key, value) else ""
                lines.append(f"  {key:24s} {value['value']:9.4f} +- {sd:10s} {paper}{note}")
            else:
                lines.append(f"  {key:24s} {value:9.4f}")
        if axis["model"]["rate_degps"]["sd"] is None:
            lines += ["  rate limit: not shown by the data; it takes a larger --amplitude"]
        else:
            lines += ["  rate limit at            triangle Hz   sine Hz   -3 dB Hz    the paper Hz"]
            lines += [_format_limit(limit) for limit in axis["limits"]]
        if undetermined := [k for k, v in axis["model"].items() if _is_undetermined(k, v)]:
            lines += [
                f"  undetermined: {', '.join(undetermined)}; repeat with larger --amplitude, with"
                f" --frequency up to {MAX_HZ:g} Hz, and with faster reports of the encoder"
            ]
        lines += [""]
    return "\n".join([*lines, f"{folder}: bench.mcap, bench.json, figure4.png"])


def _is_undetermined(key: str, value: Any) -> bool:
    """Return whether an estimate of the model is too uncertain to be used."""
    if key not in _POSITIVE or value["sd"] is None:
        return False
    return bool(value["sd"] > MAX_RELATIVE_SD * abs(value["value"]))


def _format_limit(limit: Mapping[str, Any]) -> str:
    """Return the row of one amplitude in the table of limits."""
    half, paper = (
        f"{value:8.3f}" if value is not None else "       -"
        for value in (limit["half_power_hz"], limit["paper_hz"])
    )
    return (
        f"  {limit['amplitude_deg']:6.1f} deg peak to peak {limit['triangle_hz']['value']:9.3f} "
        f"{limit['sine_hz']['value']:9.3f} {half:>10s} {paper:>12s}"
    )
