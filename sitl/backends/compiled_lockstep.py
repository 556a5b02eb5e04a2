"""Ticks of the lockstep in which only numbers change, as a compiled loop.

The loop receives the answer of the autopilot, advances the plant, and sends the next HIL_SENSOR.
Where a slower sensor or the true motion is due, Python puts their frames before it. The loop ends
before every other tick: with a fault, a drop weight, a disarmed vehicle, a lost datagram, or a
message that is no plain answer. The bytes on the link are those of ``HilClient``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import ceil, gcd
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io import jit, lockstep_frames, lockstep_socket
from mavlink_io.frames import flip, flip_quaternion
from mavlink_io.jit import Native, entry_point, kernel
from mavlink_io.lockstep_frames import CONTROLS, SENSOR, START, TRUTH, FrameMemory, frame_memory
from mavlink_io.lockstep_socket import compiled_socket
from mavlink_io.records import ARMED_FLAG
from mavlink_io.transport import MAX_DATAGRAM, spin_s
from sitl.backends.hil import HilClient
from sitl.backends.messages import COMPONENT, SYSTEM, TRUTH_PERIOD_US
from sitl.core import plant, state, tick, truth
from sitl.core.draws import BLOCK
from sitl.core.plant import DROP, ELEVATOR, RELEASE_ABOVE, RUDDER, THRUST, Plant, PlantState
from sitl.core.sensors import Sensors
from sitl.vehicle.vectors import Vector, Vector3

_SENDER = SYSTEM << 8 | COMPONENT


class Frames(NamedTuple):
    """Memory of the frames of a tick."""

    datagram: Any
    """The received octets."""
    answer: FrameMemory
    """The frame in them."""
    sensors: FrameMemory
    truth: FrameMemory


@entry_point
def exchange(
    frames: Native,
    vessel: Native,
    run: Native,
    numbers: Vector,
    used: NDArray[np.int64],
    values: Vector,
    tick_us: int,
    time_us: int,
    received: int,
    sequence: int,
) -> int:
    """Advance the plant by one tick with the controls of an answer, and encode its sensors.

    Parameters
    ----------
    frames : Native
        ``Frames`` with the received datagram; the sensors are written.
    vessel, run, numbers, used, values
        As in ``core.tick.advance``.
    tick_us : int
        Length of a tick.
    time_us : int
        Vehicle time that the answer belongs to.
    received : int
        Number of octets received.
    sequence : int
        Sequence number of the new frame.

    Returns
    -------
    int
        Length of the new frame; 0 if the datagram is not the answer of an armed vehicle that keeps
        its drop weight: then nothing has changed.
    """
    datagram, answer, sensors = frames.value.datagram, frames.value.answer, frames.value.sensors
    size = lockstep_frames.frame_size(datagram, 0, received)
    if (
        size != received
        or not lockstep_frames.open_frame(datagram, 0, size, CONTROLS, answer)
        or lockstep_frames.time_us(answer) != time_us
        or not lockstep_frames.mode(answer) & ARMED_FLAG
        or lockstep_frames.control(answer, DROP) > RELEASE_ABOVE
    ):
        return 0
    updated = tick.advance(
        vessel,
        run,
        numbers,
        used,
        values,
        time_us + tick_us,
        lockstep_frames.control(answer, RUDDER),
        lockstep_frames.control(answer, ELEVATOR),
        lockstep_frames.control(answer, THRUST),
    )
    readings = values[state.FIRST_READING : state.FIRST_READING + state.READINGS]
    lockstep_frames.write_sensors(sensors, time_us + tick_us, readings, updated)
    return lockstep_frames.seal(sensors, SENSOR, sequence, _SENDER)


class Exchanged(NamedTuple):
    """What ``exchange_many`` has done."""

    ticks: int
    """Number of ticks."""
    length: int
    """Length of the newest frame; 0 without a tick."""
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
    values: Vector,
    tick_us: int,
    time_us: int,
    sequence: int,
    ticks: int,
    spin_s: float,
) -> tuple[int, int, int]:
    """Exchange datagrams until a number of ticks is made, or ``exchange`` refuses one.

    Parameters
    ----------
    link : Native
        ``UdpSocket``.
    frames, vessel, run, numbers, used, values, tick_us, time_us, sequence
        As of ``exchange``.
    ticks : int
        Largest number of ticks. The frame of the last one of them is not sent.
    spin_s : float
        As of ``lockstep_socket.receive``.

    Returns
    -------
    tuple of int
        ``Exchanged``.
    """
    memory = frames.value
    datagram, sample = memory.datagram, memory.sensors.octets[START:]
    done = length = received = 0
    while done < ticks:
        received = lockstep_socket.receive(link.value, datagram, spin_s)
        if received <= 0:
            break
        sealed = exchange(
            frames, vessel, run, numbers, used, values, tick_us, time_us, received, sequence
        )
        if sealed == 0:
            break
        length, received = sealed, 0
        done += 1
        time_us += tick_us
        if done < ticks:
            lockstep_socket.send(link.value, sample, length)
            sequence = (sequence + 1) & 0xFF
    return done, length, received


@entry_point
def encode_truth(
    frames: Native,
    values: Vector,
    time_us: int,
    latitude_deg: float,
    longitude_deg: float,
    sequence: int,
) -> int:
    """Encode the true motion, as ``truth.to_frame`` and ``HilClient`` do.

    Parameters
    ----------
    frames : Native
        ``Frames``; the true motion is written.
    values : ndarray
        State of ``core.state``.
    time_us : int
        Vehicle time of the state.
    latitude_deg, longitude_deg : float
        Geographic position of the origin of NED.
    sequence : int
        Sequence number of the frame.

    Returns
    -------
    int
        Length of the frame.
    """
    body, motion, memory = values, values[state.FIRST_MOTION :], frames.value.truth
    lockstep_frames.write_truth(
        memory,
        time_us,
        flip_quaternion(body[3], body[4], body[5], body[6]),
        flip(body[10], body[11], body[12]),
        truth.frame_position(flip(body[0], body[1], body[2]), latitude_deg, longitude_deg),
        truth.frame_motion(
            _flipped(motion, state.VELOCITY),
            _flipped(motion, state.WATER_VELOCITY),
            _flipped(motion, state.FORCE),
        ),
    )
    return lockstep_frames.seal(memory, TRUTH, sequence, _SENDER)


@kernel
def _flipped(motion: Vector, first: int) -> Vector3:
    """Return a vector of the motion in FRD or NED axes."""
    return flip(motion[first], motion[first + 1], motion[first + 2])


@entry_point
def renumber_sensors(frames: Native, sequence: int) -> None:
    """Change the sequence number of the encoded sensors.

    Parameters
    ----------
    frames : Native
        ``Frames`` after ``exchange``.
    sequence : int
        Sequence number.
    """
    lockstep_frames.renumber(frames.value.sensors, SENSOR, sequence)


class MachineCode(NamedTuple):
    """Machine code of the functions above."""

    exchange_many: Callable[..., tuple[int, int, int]]
    encode_truth: Callable[..., int]
    renumber_sensors: Callable[[Native, int], None]


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
        self._frames = Frames(
            jit.octets(MAX_DATAGRAM),
            *(
                frame_memory(kind.length + lockstep_frames.OVERHEAD)
                for kind in (CONTROLS, SENSOR, TRUTH)
            ),
        )
        self._native = jit.native(self._frames)
        self._received = memoryview(self._frames.datagram)
        self._sample, self._truth = (
            memoryview(memory.octets)[START:]
            for memory in (self._frames.sensors, self._frames.truth)
        )
        self._compiled: tuple[Native, Native, MachineCode] | None = None

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
        link, draws, tick_us = self._link.endpoint, rng.draws, simulated.tick_us
        peer = link.peer()
        if peer is None:
            return None
        now, values, time_us = begun, begun.values.copy(), begun.time_us
        sensors, datagram = None, b""
        socket = compiled_socket(peer)
        code = self._code(socket.native, simulated, begun, rng)
        exchange_many = partial(
            code.exchange_many,
            *(socket.native, self._native, simulated.native, begun.run),
            *(*draws.table, values, tick_us),
        )
        slow_us = gcd(simulated.suite.devices_us, TRUTH_PERIOD_US)
        most = BLOCK // simulated.draws
        while (left := (until_us - 1 - time_us) // tick_us) > 0 and not self._stopped():
            ticks = min(left, most, ceil((slow_us - time_us % slow_us) / tick_us))
            draws.prepare(simulated.draws * ticks)
            done = Exchanged(*exchange_many(time_us, link.sequence, ticks, spin_s()))
            complete = done.ticks == ticks
            if done.ticks:
                time_us += done.ticks * tick_us
                sensors, datagram = None, bytes(self._sample[: done.length])
                link.take_sequence(done.ticks - complete)
            if complete:
                if time_us % slow_us == 0:
                    now = now._replace(time_us=time_us, values=values)
                    now, sensors = self._measure(simulated, now, rng)
                    datagram = self._encode_slow(code, simulated, now, sensors, done.length)
                link.take_sequence()
                link.transport.send(datagram)
            else:
                socket.return_rest(link, self._received, done.received)
                break
        if not datagram:
            return None
        now = now._replace(time_us=time_us, values=values)
        return now, sensors or self._measure(simulated, now, rng)[1], datagram

    def _measure(
        self, simulated: Plant, now: PlantState, rng: plant.RandomStreams
    ) -> tuple[PlantState, Sensors]:
        """Sample the slower sensors that are due."""
        return plant.measure(simulated, now, lockstep_frames.updated(self._frames.sensors), rng)

    def _encode_slow(
        self, code: MachineCode, simulated: Plant, now: PlantState, sensors: Sensors, length: int
    ) -> bytes:
        """Put the frames of true motion and slower sensors before the HIL_SENSOR of ``length``."""
        link, sea, frames = self._link.endpoint, simulated.sea, []
        if not now.time_us % TRUTH_PERIOD_US:
            end = code.encode_truth(
                self._native,
                now.values,
                now.time_us,
                sea.latitude_deg,
                sea.longitude_deg,
                link.take_sequence(),
            )
            frames.append(bytes(self._truth[:end]))
        if sensors.has_devices:
            frames += self._link.device_frames(sensors)
        code.renumber_sensors(self._native, link.sequence)
        return b"".join((*frames, self._sample[:length]))

    def _code(
        self, socket: Native, simulated: Plant, begun: PlantState, rng: plant.RandomStreams
    ) -> MachineCode:
        """Return the machine code for a run."""
        if self._compiled is None or self._compiled[:2] != (socket, begun.run):
            frames, values, sea = self._native, begun.values, simulated.sea
            arguments: tuple[Any, ...] = (
                *(socket, frames, simulated.native, begun.run, *rng.draws.table, values),
                *(0, 0, 0, 0, 0.0),
            )
            site = float(sea.latitude_deg), float(sea.longitude_deg)
            self._compiled = (
                socket,
                begun.run,
                MachineCode(
                    jit.machine_code(exchange_many, *arguments),
                    jit.machine_code(encode_truth, frames, values, 0, *site, 0),
                    jit.machine_code(renumber_sensors, frames, 0),
                ),
            )
        return self._compiled[2]
