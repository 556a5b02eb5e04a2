"""Steady ticks of a vehicle with its devices, each one compiled call.

The state stays in memory of compiled code from tick to tick: to convert it from and to records of
Python takes longer than a tick. For the same reason inputs and results are numbers in one array.
Importing this module loads the compiler.
"""

from typing import NamedTuple

from autopilot.control import estimator, steady
from autopilot.control.excitation import ExcitationOutput
from autopilot.control.sensor_health.types import Devices
from autopilot.control.setpoints import Setpoint
from autopilot.control.steady import DeviceRecords, SteadyState, Task
from autopilot.control.types import Motion, Trace
from mavlink_io import device_records
from mavlink_io.device_records import altimeter, battery, duct, dvl, gps_fix, leak
from mavlink_io.jit import Native, Numbers, entry_point, numeric
from mavlink_io.records import SensorFrame

KINDS = (SensorFrame, ExcitationOutput, *device_records.KINDS)
"""Records of the inputs, in the order of the array; the results follow them."""
STARTS = tuple(sum(len(kind._fields) for kind in KINDS[:n]) for n in range(len(KINDS) + 1))
"""Index in the array of the first number of each input, and of the results."""
SIGNAL, GPS, ALTIMETER, DVL, BATTERY, LEAK, DUCT, RESULTS = STARTS[1:]
RESULT_KINDS = Motion, Setpoint, Trace
"""Records of the results, in the order of the array."""
SIZE = RESULTS + sum(len(kind._fields) for kind in RESULT_KINDS)
"""Length of the array."""
_SETPOINT = RESULTS + len(Motion._fields)
_TRACE = _SETPOINT + len(Setpoint._fields)


class TickRun(NamedTuple):
    """Steady ticks in progress: what they change, and what stays the same."""

    state: SteadyState
    devices: Devices
    task: Task


@entry_point
def advance(flight: Native, config: Native, values: Numbers, new: int) -> bool:
    """Advance a flight by one tick if that is a steady one.

    Parameters
    ----------
    flight : Native
        ``TickRun``; it changes if the tick is a steady one.
    config : Native
        Parameters, from ``params.flat``.
    values : Numbers
        ``SIZE`` numbers. Inputs: sensor frame as received, test signal and newest device records.
        Receives the results: motion, set-points and signals after the tick.
    new : int
        Bits of the device records that have come in this tick.

    Returns
    -------
    bool
        Whether the tick is a steady one; if not, flight and results have not changed.
    """
    before = flight.value
    signal = ExcitationOutput(
        values[SIGNAL], values[SIGNAL + 1], values[SIGNAL + 2], values[SIGNAL + 3]
    )
    done, state, devices, trace = steady.tick_with_devices(
        before.state,
        before.devices,
        _records(values) if new != 0 else steady.NO_RECORDS,
        new,
        sensors(values),
        signal,
        before.task,
        config.value,
    )
    if not done:
        return False
    flight.value = TickRun(state, devices, before.task)
    motion = estimator.motion_of(state.estimate, state.time_us)
    for i in range(len(motion)):
        values[RESULTS + i] = motion[i]
    for i in range(len(state.setpoint)):
        values[_SETPOINT + i] = state.setpoint[i]
    for i in range(len(trace)):
        values[_TRACE + i] = trace[i]
    return True


@entry_point
def read(flight: Native) -> tuple[SteadyState, Devices]:
    """Return what the ticks have changed as records of Python."""
    return flight.value.state, flight.value.devices


@numeric
def sensors(v: Numbers) -> SensorFrame:
    """Return the sensor frame in the array."""
    return SensorFrame(
        int(v[0]),
        v[1],
        v[2],
        v[3],
        v[4],
        v[5],
        v[6],
        v[7],
        v[8],
        v[9],
        v[10],
        v[11],
        v[12],
        v[13],
        int(v[14]),
        int(v[15]),
    )


@numeric
def results(values: Numbers) -> tuple[Motion, Setpoint, Trace]:
    """Return the results in the array."""
    m, s, t = values[RESULTS:], values[_SETPOINT:], values[_TRACE:]
    motion = Motion(
        m[0],
        m[1],
        m[2],
        m[3],
        m[4],
        m[5],
        m[6],
        m[7],
        m[8],
        m[9],
        m[10],
        m[11],
        m[12],
        m[13],
        m[14],
        m[15],
        m[16],
        m[17],
        m[18],
        m[19],
    )
    trace = Trace(t[0], t[1], t[2], t[3], t[4], t[5], t[6], t[7], t[8])
    return motion, Setpoint(s[0], s[1], s[2], s[3]), trace


@numeric
def _records(v: Numbers) -> DeviceRecords:
    """Return the device records in the array."""
    return DeviceRecords(
        gps_fix(v[GPS:]),
        altimeter(v[ALTIMETER:]),
        dvl(v[DVL:]),
        battery(v[BATTERY:]),
        leak(v[LEAK:]),
        duct(v[DUCT:]),
    )
