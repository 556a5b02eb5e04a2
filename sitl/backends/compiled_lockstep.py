"""Ticks of the lockstep in which only numbers change, each one compiled call.

The call decodes the answer of the autopilot, advances the plant, and encodes the next HIL_SENSOR.
Where a slower sensor or the true motion is due, their frames are put before it. The loop ends
before every other tick: with a fault, a drop weight, a disarmed vehicle, a lost datagram, or a
message that is no plain answer. The bytes on the link are those of ``HilClient``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import gcd
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io import jit, lockstep_frames
from mavlink_io.frames import flip, flip_quaternion
from mavlink_io.jit import Native, entry_point, kernel
from mavlink_io.lockstep_frames import CONTROLS, SENSOR, START, TRUTH, FrameMemory, frame_memory
from mavlink_io.records import ARMED_FLAG
from mavlink_io.transport import MAX_DATAGRAM
from sitl.backends.hil import HilClient
from sitl.backends.messages import COMPONENT, SYSTEM, TRUTH_PERIOD_US
from sitl.core import plant, state, tick, truth
from sitl.core.plant import DROP, ELEVATOR, RELEASE_ABOVE, RUDDER, THRUST, Plant, PlantState
from sitl.core.sensors import Sensors
from sitl.vehicle.vectors import Vector, Vector3

_SENDER = SYSTEM << 8 | COMPONENT


class Frames(NamedTuple):
    """Memory of the frames of a tick."""

    answer: FrameMemory
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
        ``Frames`` with the received answer; the sensors are written.
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
    answer, sensors = frames.value.answer, frames.value.sensors
    if not lockstep_frames.unseal(answer, received, CONTROLS):
        return 0
    if (
        lockstep_frames.time_us(answer) != time_us
        or not lockstep_frames.mode(answer) & ARMED_FLAG
        or lockstep_frames.control(answer, DROP) > RELEASE_ABOVE
    ):
        lockstep_frames.undo_unseal(answer, CONTROLS)
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

    exchange: Callable[..., int]
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
            frame_memory(MAX_DATAGRAM),
            *(frame_memory(kind.length + lockstep_frames.OVERHEAD) for kind in (SENSOR, TRUTH)),
        )
        self._native = jit.native(self._frames)
        self._received, self._sample, self._truth = (
            memoryview(memory.octets)[START:] for memory in self._frames
        )
        self._compiled: tuple[Native, MachineCode] | None = None

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
        now, values, tick_us = begun, begun.values.copy(), simulated.tick_us
        time_us, sensors, datagram = begun.time_us, None, b""
        code, link, draws = self._code(simulated, begun, rng), self._link, rng.draws
        exchange_answer = partial(
            code.exchange, self._native, simulated.native, begun.run, *draws.table, values, tick_us
        )
        slow_us = gcd(simulated.suite.devices_us, TRUTH_PERIOD_US)
        while time_us + tick_us < until_us and not self._stopped():
            received = link.receive_into(self._received)
            if not received:
                break
            draws.prepare(simulated.draws)
            length = exchange_answer(time_us, received, link.sequence)
            if not length:
                link.put_back(bytes(self._received[:received]))
                break
            time_us += tick_us
            if time_us % slow_us:
                sensors, datagram = None, bytes(self._sample[:length])
            else:
                now = now._replace(time_us=time_us, values=values)
                now, sensors = self._measure(simulated, now, rng)
                datagram = self._encode_slow(code, simulated, now, sensors, length)
            link.send_next(datagram)
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
        link, sea, frames = self._link, simulated.sea, []
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
            frames += link.device_frames(sensors)
        code.renumber_sensors(self._native, link.sequence)
        return b"".join((*frames, self._sample[:length]))

    def _code(self, simulated: Plant, begun: PlantState, rng: plant.RandomStreams) -> MachineCode:
        """Return the machine code for a run."""
        if self._compiled is None or self._compiled[0] is not begun.run:
            frames, values, sea = self._native, begun.values, simulated.sea
            arguments: tuple[Any, ...] = (
                *(frames, simulated.native, begun.run, *rng.draws.table, values),
                *(0, 0, 0, 0),
            )
            site = float(sea.latitude_deg), float(sea.longitude_deg)
            self._compiled = (
                begun.run,
                MachineCode(
                    jit.machine_code(exchange, *arguments),
                    jit.machine_code(encode_truth, frames, values, 0, *site, 0),
                    jit.machine_code(renumber_sensors, frames, 0),
                ),
            )
        return self._compiled[1]
