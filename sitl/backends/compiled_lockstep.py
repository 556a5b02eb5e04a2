"""Ticks of the lockstep in which only numbers change, as a compiled loop.

The loop receives the answer of the autopilot, advances the plant, and sends the next HIL_SENSOR,
with the frames of true motion and slower sensors before it. The loop ends before every other tick:
with a fault, a drop weight, a disarmed vehicle, a lost datagram, or a message that is no plain
answer. The bytes on the link are those of ``HilClient``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io import jit, lockstep_frames, lockstep_socket
from mavlink_io.frames import flip, flip_quaternion
from mavlink_io.jit import Native, entry_point, kernel
from mavlink_io.lockstep_frames import (
    CONTROLS,
    SENSOR,
    START,
    TRUTH,
    FrameMemory,
    MessageLayout,
    frame_memory,
)
from mavlink_io.lockstep_socket import compiled_socket
from mavlink_io.records import ARMED_FLAG
from mavlink_io.transport import MAX_DATAGRAM, spin_s
from sitl.backends import compiled_devices
from sitl.backends.compiled_devices import OWN, SENDERS
from sitl.backends.hil import HilClient
from sitl.backends.messages import TRUTH_PERIOD_US
from sitl.core import plant, state, tick, truth
from sitl.core.draws import BLOCK
from sitl.core.environment import Surroundings
from sitl.core.plant import DROP, ELEVATOR, RELEASE_ABOVE, RUDDER, THRUST, Plant, PlantState
from sitl.core.sensors import Sensors, devices
from sitl.core.tick import Fresh
from sitl.vehicle.vectors import Vector, Vector3

_NOTHING = Fresh(0, 0)


class LockstepFrames(NamedTuple):
    """Memory of the frames of a tick."""

    received: Any
    """The received octets."""
    answer: FrameMemory
    """The frame in them."""
    sensors: FrameMemory
    truth: FrameMemory
    """Frames that are copied into the datagram."""
    datagram: Any
    """The octets to send."""
    sequences: NDArray[np.int64]
    """Number of frames of each of ``compiled_devices.SENDERS``."""


@entry_point
def exchange(
    frames: Native,
    vessel: Native,
    run: Native,
    numbers: Vector,
    used: NDArray[np.int64],
    streams: Native,
    values: Vector,
    tick_us: int,
    time_us: int,
    received: int,
) -> tuple[int, Fresh]:
    """Advance the plant by one tick with the controls of an answer, and encode its sensors.

    Parameters
    ----------
    frames : Native
        ``LockstepFrames`` with the received octets; the datagram is written.
    vessel, run, numbers, used, streams, values
        As in ``core.tick.advance``.
    tick_us : int
        Length of a tick.
    time_us : int
        Vehicle time that the answer belongs to.
    received : int
        Number of octets received.

    Returns
    -------
    tuple of int and Fresh
        Length of the new datagram, and its new readings. The length is 0 if the received octets are
        not the answer of an armed vehicle that keeps its drop weight: then nothing has changed.
    """
    octets, answer = frames.value.received, frames.value.answer
    size = lockstep_frames.frame_size(octets, 0, received)
    if (
        size != received
        or not lockstep_frames.open_frame(octets, 0, size, CONTROLS, answer)
        or lockstep_frames.time_us(answer) != time_us
        or not lockstep_frames.mode(answer) & ARMED_FLAG
        or lockstep_frames.control(answer, DROP) > RELEASE_ABOVE
    ):
        return 0, _NOTHING
    fresh = tick.advance(
        vessel,
        run,
        numbers,
        used,
        streams,
        values,
        time_us + tick_us,
        lockstep_frames.control(answer, RUDDER),
        lockstep_frames.control(answer, ELEVATOR),
        lockstep_frames.control(answer, THRUST),
    )
    return _encode(frames.value, run, values, time_us + tick_us, fresh), fresh


class Exchanged(NamedTuple):
    """What ``exchange_many`` has done."""

    ticks: int
    """Number of ticks."""
    length: int
    """Length of the newest datagram; 0 without a tick."""
    fresh: Fresh
    """Its new readings."""
    received: int
    """Octets of a datagram that Python has to read; 0 if there is none."""


@entry_point
def exchange_many(
    link: Native,
    frames: Native,
    vessel: Native,
    run: Native,
    numbers: Vector,
    used: NDArray[np.int64],
    streams: Native,
    values: Vector,
    tick_us: int,
    time_us: int,
    ticks: int,
    spin_s: float,
) -> Exchanged:
    """Exchange datagrams until a number of ticks is made, or ``exchange`` refuses one.

    Parameters
    ----------
    link : Native
        ``UdpSocket``.
    frames, vessel, run, numbers, used, streams, values, tick_us, time_us
        As of ``exchange``.
    ticks : int
        Largest number of ticks.
    spin_s : float
        As of ``lockstep_socket.receive``.

    Returns
    -------
    Exchanged
        What was done; the newest datagram has been sent and not been answered.
    """
    memory = frames.value
    done = length = received = 0
    fresh = _NOTHING
    while done < ticks:
        received = lockstep_socket.receive(link.value, memory.received, spin_s)
        if received <= 0:
            break
        encoded, new = exchange(
            frames, vessel, run, numbers, used, streams, values, tick_us, time_us, received
        )
        if encoded == 0:
            break
        length, fresh, received = encoded, new, 0
        lockstep_socket.send(link.value, memory.datagram, length)
        done += 1
        time_us += tick_us
    return Exchanged(done, length, fresh, received)


@kernel
def _encode(frames: LockstepFrames, run: Native, values: Vector, time_us: int, fresh: Fresh) -> int:
    """Encode the datagram of a tick, HIL_SENSOR last; return its length."""
    end, fixed = 0, run.value
    if time_us % TRUTH_PERIOD_US == 0:
        _write_truth(frames.truth, fixed.sea, values, time_us)
        end = _append(frames, frames.truth, TRUTH, end)
    if fresh.devices != 0:
        part = state.parts(fixed.constants.layout, values).devices
        end = compiled_devices.encode(
            frames.datagram, end, fresh.devices, devices.parts(part).latest, frames.sequences
        )
    readings = values[state.FIRST_READING : state.FIRST_READING + state.READINGS]
    lockstep_frames.write_sensors(frames.sensors, time_us, readings, fresh.updated)
    return _append(frames, frames.sensors, SENSOR, end)


@kernel
def _append(frames: LockstepFrames, memory: FrameMemory, layout: MessageLayout, end: int) -> int:
    """Copy a payload into the datagram and seal the frame; return the first free octet after it."""
    octets = frames.datagram[end:]
    for i in range(lockstep_frames.HEAD, lockstep_frames.HEAD + layout.length):
        octets[i] = memory.octets[START + i]
    return compiled_devices.seal(frames.datagram, end, layout, OWN, frames.sequences)


@kernel
def _write_truth(memory: FrameMemory, sea: Surroundings, values: Vector, time_us: int) -> None:
    """Write the true motion, as ``truth.to_frame`` and ``HilClient`` do."""
    body, motion = values, values[state.FIRST_MOTION :]
    position_ned_m = flip(body[0], body[1], body[2])
    lockstep_frames.write_truth(
        memory,
        time_us,
        flip_quaternion(body[3], body[4], body[5], body[6]),
        flip(body[10], body[11], body[12]),
        truth.frame_position(position_ned_m, sea.latitude_deg, sea.longitude_deg),
        truth.frame_motion(
            _flipped(motion, state.VELOCITY),
            _flipped(motion, state.WATER_VELOCITY),
            _flipped(motion, state.FORCE),
        ),
    )


@kernel
def _flipped(motion: Vector, first: int) -> Vector3:
    """Return a vector of the motion in FRD or NED axes."""
    return flip(motion[first], motion[first + 1], motion[first + 2])


class CompiledLockstep:
    """Exchanges frames with the autopilot while only numbers change.

    Parameters
    ----------
    link : HilClient
        The link.
    stopped : callable
        Return whether the process has been asked to stop.
    """

    def __init__(self, link: HilClient, stopped: Callable[[], bool]) -> None:
        self._link, self._stopped = link, stopped
        self._senders = [link.sender(component) for component in SENDERS]
        answer, sensors, motion = (
            frame_memory(kind.length + lockstep_frames.OVERHEAD)
            for kind in (CONTROLS, SENSOR, TRUTH)
        )
        self._frames = LockstepFrames(
            received=jit.octets(MAX_DATAGRAM),
            answer=answer,
            sensors=sensors,
            truth=motion,
            datagram=jit.octets(MAX_DATAGRAM),
            sequences=np.zeros(len(SENDERS), np.int64),
        )
        self._native = jit.native(self._frames)
        self._received = memoryview(self._frames.received)
        self._datagram = memoryview(self._frames.datagram)
        self._compiled: tuple[Native, Native, Callable[..., tuple[Any, ...]]] | None = None

    def advance(
        self, simulated: Plant, begun: PlantState, rng: plant.RandomStreams, until_us: int
    ) -> tuple[PlantState, Sensors, bytes] | None:
        """Advance from a state whose sensors have been sent.

        Parameters
        ----------
        simulated : Plant
            The plant.
        begun : PlantState
            Present state, without a fault in force.
        rng : RandomStreams
            Random streams of the run; they advance.
        until_us : int
            Vehicle time of the first tick that Python has to take.

        Returns
        -------
        tuple of PlantState, Sensors and bytes, or None
            State after the last tick, its sensors, and the datagram with them, which has been sent
            and not been answered. None if there was no such tick.
        """
        draws, tick_us = rng.draws, simulated.tick_us
        peer = self._link.endpoint.peer()
        if peer is None:
            return None
        values, time_us = begun.values.copy(), begun.time_us
        socket = compiled_socket(peer)
        fixed = (
            *(socket.native, self._native, simulated.native, begun.run),
            *(*draws.table, rng.devices, values, tick_us),
        )
        exchange_many = self._code(socket.native, begun.run, fixed)
        most, fresh, length = BLOCK // simulated.draws, _NOTHING, 0
        self._begin_sequences()
        while (left := (until_us - 1 - time_us) // tick_us) > 0 and not self._stopped():
            ticks = min(left, most)
            draws.prepare(simulated.draws * ticks)
            done = Exchanged(*exchange_many(*fixed, time_us, ticks, spin_s()))
            if done.ticks:
                time_us += done.ticks * tick_us
                fresh, length = Fresh(*done.fresh), done.length
            if done.ticks < ticks:
                socket.return_rest(self._link.endpoint, self._received, done.received)
                break
        self._end_sequences()
        if not length:
            return None
        now = begun._replace(time_us=time_us, values=values)
        _, sensors = plant.measure(simulated, now, *fresh, rng)
        return now, sensors, bytes(self._datagram[:length])

    def _begin_sequences(self) -> None:
        """Continue the sequence numbers of the link."""
        for index, sender in enumerate(self._senders):
            self._frames.sequences[index] = sender.sequence

    def _end_sequences(self) -> None:
        """Count the frames of compiled code as sent."""
        for sent, sender in zip(self._frames.sequences.tolist(), self._senders, strict=True):
            sender.take_sequence(sent - sender.sequence)

    def _code(
        self, socket: Native, run: Native, fixed: tuple[Any, ...]
    ) -> Callable[..., tuple[Any, ...]]:
        """Return the machine code of ``exchange_many`` for a run."""
        if self._compiled is None or self._compiled[:2] != (socket, run):
            code = jit.machine_code(exchange_many, *fixed, 0, 0, 0.0)
            self._compiled = socket, run, code
        return self._compiled[2]
