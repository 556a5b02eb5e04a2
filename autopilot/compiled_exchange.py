"""The answer to a sensor sample as one compiled call, while the ticks are steady.

The call decodes HIL_SENSOR, runs a steady tick and encodes HIL_ACTUATOR_CONTROLS. Importing this
module loads the compiler.
"""

from typing import NamedTuple

from autopilot.control import core, steady_kernel
from autopilot.control.types import Trace
from mavlink_io import lockstep_frames
from mavlink_io.jit import Native, Numbers, entry_point
from mavlink_io.lockstep_frames import CONTROLS, SENSOR, FrameMemory
from mavlink_io.records import LOCKSTEP_FLAG

_TRACE = steady_kernel.SIZE - len(Trace._fields)
_RUDDER, _ELEVATOR, _THRUST = (
    _TRACE + Trace._fields.index(name) for name in ("rudder_rad", "elevator_rad", "thrust")
)
"""Indices in the array of a steady tick."""
_MODE = core.ARMED_MODE


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
