"""The answers to sensor samples as a compiled loop, while the ticks are steady.

The loop receives HIL_SENSOR, runs a steady tick and sends HIL_ACTUATOR_CONTROLS. Importing this
module loads the compiler.
"""

from typing import NamedTuple

from autopilot.control import core, steady_kernel
from autopilot.control.excitation import ExcitationOutput
from autopilot.control.types import Trace
from mavlink_io import lockstep_frames, lockstep_socket
from mavlink_io.jit import Native, Numbers, entry_point
from mavlink_io.lockstep_frames import CONTROLS, SENSOR, START, TRUTH, FrameMemory
from mavlink_io.records import LOCKSTEP_FLAG

_TRACE = steady_kernel.SIZE - len(Trace._fields)
_RUDDER, _ELEVATOR, _THRUST = (
    _TRACE + Trace._fields.index(name) for name in ("rudder_rad", "elevator_rad", "thrust")
)
"""Indices in the array of a steady tick."""
_MODE = core.ARMED_MODE
MAX_TICKS = 64
"""Largest number of ticks of one call of ``answer_many``."""
_SIGNALS = len(ExcitationOutput._fields)


class Frames(NamedTuple):
    """Memory of the frames of a tick."""

    sample: FrameMemory
    answer: FrameMemory


@entry_point
def answer(
    frames: Native,
    received: int,
    flight: Native,
    config: Native,
    values: Numbers,
    time_us: int,
    sequence: int,
    sender: int,
) -> int:
    """Answer a sensor sample, if the tick is a steady one.

    Parameters
    ----------
    frames : Native
        ``Frames`` with the received sample; the answer is written.
    received : int
        Number of octets received.
    flight, config, values
        As in ``steady_kernel.advance``.
    time_us : int
        Expected time stamp of the sample.
    sequence, sender : int
        Sequence number of the answer; 256 times the system id plus the component id.

    Returns
    -------
    int
        Length of the answer; 0 if the datagram is not the expected sample alone, or if the tick is
        not a steady one: then flight and datagram have not changed.
    """
    memory = frames.value
    if not lockstep_frames.unseal(memory.sample, received, SENSOR):
        return 0
    done = lockstep_frames.time_us(memory.sample) == time_us
    if done:
        lockstep_frames.read_sensors(memory.sample, values)
        done = steady_kernel.advance(flight, config, values, 0)
    if not done:
        lockstep_frames.undo_unseal(memory.sample, SENSOR)
        return 0
    travel_rad = config.value.travel_rad
    controls = values[_RUDDER] / travel_rad, values[_ELEVATOR] / travel_rad, values[_THRUST], 0.0
    lockstep_frames.write_controls(memory.answer, time_us, LOCKSTEP_FLAG, controls, _MODE)
    return lockstep_frames.seal(memory.answer, CONTROLS, sequence, sender)


@entry_point
def answer_many(
    link: Native,
    frames: Native,
    flight: Native,
    config: Native,
    values: Numbers,
    signals: Numbers,
    rows: Numbers,
    testing: bool,
    first: int,
    time_us: int,
    interval_us: int,
    sequence: int,
    sender: int,
    ticks: int,
    duration_s: float,
    spin_s: float,
) -> tuple[int, int]:
    """Receive samples and answer them, until a limit is reached or a datagram is not answered.

    Parameters
    ----------
    link : Native
        ``UdpSocket``.
    frames, flight, config, values, sequence, sender
        As of ``answer``.
    signals : Numbers
        Test signals, one ``ExcitationOutput`` after the other.
    rows : Numbers
        Receives ``values`` after each tick, one tick after the other.
    testing : bool
        Whether a test is running; if not, ``signals`` are not used.
    first : int
        Index of the signal of the first tick.
    time_us, interval_us : int
        Expected time stamp of the first sample, and time between two samples.
    ticks : int
        Largest number of ticks, at most `MAX_TICKS`.
    duration_s : float
        Wall time after which no further sample is waited for.
    spin_s : float
        As of ``lockstep_socket.receive``.

    Returns
    -------
    tuple of int
        Number of ticks; result of ``lockstep_socket.receive`` for a datagram that was not answered,
        else 0. Frames of the true motion before a sample are ignored.
    """
    end_s = lockstep_socket.clock_s(link.value) + duration_s
    sample, reply = frames.value.sample, frames.value.answer.octets[START:]
    done = received = 0
    while done < ticks:
        received = lockstep_socket.receive(link.value, sample.octets[START:], spin_s)
        if received <= 0:
            break
        received = lockstep_frames.drop_first(sample, received, TRUTH)
        if testing:
            for i in range(_SIGNALS):
                values[steady_kernel.SIGNAL + i] = signals[(first + done) * _SIGNALS + i]
        length = answer(frames, received, flight, config, values, time_us, sequence, sender)
        if length == 0:
            break
        lockstep_socket.send(link.value, reply, length)
        received = 0
        for i in range(steady_kernel.SIZE):
            rows[done * steady_kernel.SIZE + i] = values[i]
        done += 1
        time_us += interval_us
        sequence = (sequence + 1) & 0xFF
        if lockstep_socket.clock_s(link.value) >= end_s:
            break
    return done, received
