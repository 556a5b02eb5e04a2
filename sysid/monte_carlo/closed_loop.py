"""The closed loop of vehicle and autopilot, many ticks in one compiled call."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from autopilot.control import excitation, steady
from autopilot.control.excitation import ExcitationOutput
from autopilot.control.steady import SteadyState, Task
from autopilot.control.types import US_PER_S, Excitation, Trace
from mavlink_io.jit import Native, entry_point, numeric
from mavlink_io.tick import TICK_S
from sysid.monte_carlo import dynamics, instruments
from sysid.monte_carlo.dynamics import DEPTH

Array = NDArray[np.float64]

TICK_US = round(TICK_S * US_PER_S)
"""Tick in microseconds."""
LOG_DECIMATION = 5
"""Ticks per logged sample: 10 Hz."""
COLUMNS = (
    "time_s",
    "roll_rad",
    "pitch_rad",
    "heading_rad",
    "p_radps",
    "q_radps",
    "r_radps",
    "depth_m",
    "depth_rate_mps",
    "rudder_rad",
    "elevator_rad",
    "thrust",
    "heading_setpoint_rad",
    "pitch_setpoint_rad",
    "depth_setpoint_m",
    "true_depth_m",
)
"""Columns of the simulated log."""
NO_SIGNAL = np.empty((0, len(ExcitationOutput._fields)))
"""Test signal without a test."""


@lru_cache(maxsize=64)
def signal_of(test: Excitation) -> Array:
    """Return the test signal of every tick since the start of a test, by rows.

    Columns are the fields of ``ExcitationOutput``. Tests that differ in their start only share it
    if the start is taken out: ``test._replace(started_us=0, heading_rad=0.0, depth_m=0.0)``.
    """
    ticks = range(int(test.duration_s / TICK_S) + 2)
    return np.array([excitation.sample(test, k * TICK_US / US_PER_S) for k in ticks])


@numeric
def log_sample(state: SteadyState, trace: Trace, true_depth_m: float) -> tuple[float, ...]:
    """Return the values of `COLUMNS` in one tick."""
    estimate, setpoint = state.estimate, state.setpoint
    return (
        state.time_us / US_PER_S,
        estimate.roll_rad,
        estimate.pitch_rad,
        estimate.heading_rad,
        estimate.p_radps,
        estimate.q_radps,
        estimate.r_radps,
        estimate.depth_m,
        estimate.depth_rate_mps,
        trace.rudder_rad,
        trace.elevator_rad,
        trace.thrust,
        setpoint.heading_rad,
        trace.pitch_setpoint_rad,
        setpoint.depth_m,
        true_depth_m,
    )


@entry_point
def run(
    body: Native,
    surroundings: Native,
    state: Array,
    rudder: Array,
    elevator: Array,
    observed: Array,
    fine: bool,
    pilot: SteadyState,
    trace: Trace,
    task: Task,
    config: Native,
    wrenches: Array,
    errors: Array,
    signal: Array,
    rows: Array,
) -> tuple[int, bool, SteadyState, Trace, int]:
    """Advance vehicle and autopilot until a tick is not a steady one, or the noise ends.

    Parameters
    ----------
    body, surroundings, state, rudder, elevator, observed, fine
        The fields of ``dynamics.SimulatedVehicleState``.
    pilot : SteadyState
        State of the autopilot.
    trace : Trace
        Signals of its last tick: the commands.
    task : Task
        Task of the autopilot.
    config : Native
        Its parameters, from ``params.flat``.
    wrenches : ndarray, shape (n, 6)
        Disturbance of the next ticks.
    errors : ndarray, shape (n, N_OBSERVED)
        Measurement errors of the next ticks.
    signal : ndarray
        Test signal, from ``signal_of``.
    rows : ndarray, shape (n, number of COLUMNS)
        Receives the samples of the log.

    Returns
    -------
    tuple
        Number of ticks of the vehicle; whether the autopilot has done the last of them too; its
        state and signals; and number of samples.
    """
    samples, vehicle, at_sea, parameters = 0, body.value, surroundings.value, config.value
    duct_rad = np.empty((2, dynamics.SUBSTEPS))
    for k in range(len(wrenches)):
        dynamics.move(
            vehicle,
            at_sea,
            state,
            rudder,
            elevator,
            observed,
            fine,
            duct_rad,
            (trace.rudder_rad, trace.elevator_rad, trace.thrust),
            wrenches[k],
        )
        now_us = pilot.time_us + TICK_US
        frame = instruments.frame(now_us, observed, errors[k], parameters)
        added = ExcitationOutput(0.0, 0.0, 0.0, 0.0)
        if task.testing:
            value = signal[(now_us - task.test_started_us) // TICK_US]
            added = ExcitationOutput(value[0], value[1], value[2], value[3])
        done, advanced, signals = steady.tick(pilot, frame, added, task, parameters)
        if not done:
            return k + 1, False, pilot, trace, samples
        pilot, trace = advanced, signals
        if now_us % (LOG_DECIMATION * TICK_US) == 0:
            values = log_sample(pilot, trace, observed[DEPTH])
            for i in range(len(values)):
                rows[samples, i] = values[i]
            samples += 1
    return len(wrenches), True, pilot, trace, samples
