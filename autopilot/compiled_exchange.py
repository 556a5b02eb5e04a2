"""The answers to sensor samples as a compiled loop, while the ticks are steady.

The loop receives HIL_SENSOR, with the messages of devices before it, runs a steady tick and sends
HIL_ACTUATOR_CONTROLS. Importing this module loads the compiler.
"""

from typing import Any, NamedTuple

from autopilot import compiled_devices
from autopilot.control import core, steady_kernel
from autopilot.control.excitation import ExcitationOutput
from autopilot.control.types import Trace
from mavlink_io import lockstep_frames, lockstep_socket
from mavlink_io.jit import Native, Numbers, entry_point
from mavlink_io.lockstep_frames import CONTROLS, SENSOR, START, FrameMemory
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


ROW = steady_kernel.SIZE + 2
"""Numbers of a tick in the rows of ``answer_many``: the array of ``steady_kernel``, then `NEW` and
`RELAY_END`."""
NEW, RELAY_END = steady_kernel.SIZE, steady_kernel.SIZE + 1
"""Indices in a row: bits of the new device records; end of the frames to relay, from those of the
first tick on."""


class Frames(NamedTuple):
    """Memory of the frames of a tick."""

    datagram: Any
    """The received octets."""
    frame: FrameMemory
    """One frame of them."""
    answer: FrameMemory
    relay: Any
    """Frames of devices to relay to ground."""


@entry_point
def answer(
    frames: Native,
    received: int,
    flight: Native,
    config: Native,
    values: Numbers,
    relay_end: int,
    time_us: int,
    sequence: int,
    sender: int,
) -> tuple[int, int, int]:
    """Answer a sensor sample, if the tick is a steady one.

    Parameters
    ----------
    frames : Native
        ``Frames`` with the received datagram, which does not change; the answer is written.
    received : int
        Number of octets received.
    flight, config, values
        As in ``steady_kernel.advance``.
    relay_end : int
        First free octet of the frames to relay.
    time_us : int
        Expected time stamp of the sample.
    sequence, sender : int
        Sequence number of the answer; 256 times the system id plus the component id.

    Returns
    -------
    tuple of int
        Length of the answer, bits of the new device records, and first free octet of the frames to
        relay. The length is 0 if the datagram is not the expected sample with what may come before
        it, or if the tick is not a steady one: then the flight has not changed.
    """
    memory = frames.value
    frame, octets = memory.frame, memory.datagram
    start, new, relay_end = compiled_devices.read(
        octets, received, frame, values, memory.relay, relay_end
    )
    size = lockstep_frames.frame_size(octets, start, received)
    if (
        new == compiled_devices.REFUSED
        or start + size != received
        or not lockstep_frames.open_frame(octets, start, size, SENSOR, frame)
        or lockstep_frames.time_us(frame) != time_us
    ):
        return 0, 0, relay_end
    lockstep_frames.read_sensors(frame, values)
    if not steady_kernel.advance(flight, config, values, new):
        return 0, 0, relay_end
    travel_rad = config.value.travel_rad
    controls = values[_RUDDER] / travel_rad, values[_ELEVATOR] / travel_rad, values[_THRUST], 0.0
    lockstep_frames.write_controls(memory.answer, time_us, LOCKSTEP_FLAG, controls, _MODE)
    length = lockstep_frames.seal(memory.answer, CONTROLS, sequence, sender)
    return length, new, relay_end


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
        Receives `ROW` numbers of each tick, one tick after the other.
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
        else 0.
    """
    end_s = lockstep_socket.clock_s(link.value) + duration_s
    datagram, reply = frames.value.datagram, frames.value.answer.octets[START:]
    done = received = relay_end = 0
    while done < ticks:
        received = lockstep_socket.receive(link.value, datagram, spin_s)
        if received <= 0:
            break
        if testing:
            for i in range(_SIGNALS):
                values[steady_kernel.SIGNAL + i] = signals[(first + done) * _SIGNALS + i]
        length, new, relay_end = answer(
            frames, received, flight, config, values, relay_end, time_us, sequence, sender
        )
        if length == 0:
            break
        lockstep_socket.send(link.value, reply, length)
        received = 0
        row = rows[done * ROW :]
        for i in range(steady_kernel.SIZE):
            row[i] = values[i]
        row[NEW], row[RELAY_END] = new, relay_end
        done += 1
        time_us += interval_us
        sequence = (sequence + 1) & 0xFF
        if lockstep_socket.clock_s(link.value) >= end_s:
            break
    return done, received
