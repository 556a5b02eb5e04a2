"""Writes one dive in each format, from the formats' own documents: nothing of the product's writes
or reads here.

tlog: QGroundControl's (8 bytes of UNIX microseconds, big-endian, then the frame). .bin: ArduPilot's
LogStructure.h. .ulg: docs.px4.io, "ULog File Format".
"""

import math
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from pymavlink.dialects.v20 import all as mavlink
from scipy.spatial.transform import Rotation

from tests.sysid import recording

RATE_HZ = 50
SECONDS = 40.0
TEST = (20.0, 30.0)
BOOTED_S = 100.0
"""Time since boot at which the logs begin."""


class Sample(NamedTuple):
    """Motion of the vehicle at one time.

    In the test the rudder is at a third of its travel and turns the vehicle at 3 deg/s.
    """

    time_s: float
    rudder: float
    elevator: float
    thrust: float
    pitch_rad: float
    yaw_rad: float
    yaw_rate_radps: float
    depth_m: float


def samples() -> Iterator[Sample]:
    for k in range(int(SECONDS * RATE_HZ)):
        t = k / RATE_HZ
        inside = TEST[0] <= t < TEST[1]
        turned = math.radians(3.0) * min(max(t - TEST[0], 0.0), TEST[1] - TEST[0])
        yaw = math.remainder(3.0 + turned, math.tau)
        rate = math.radians(3.0) if inside else 0.0
        yield Sample(
            BOOTED_S + t, 1 / 3 if inside else 0.0, 0.1, 0.58, -0.03, yaw, rate, 4.0 + 0.05 * t
        )


def pulse(fraction: float) -> int:
    return round(1500 + 400 * fraction)


def tlog(
    path: Path,
    commands: Callable[[Sample], object] | None = None,
    texts: bool = True,
    attitude: Callable[[Sample], object] | None = None,
    position: Callable[[Sample], object] | None = None,
    links: int = 1,
    clock: bool = True,
) -> Path:
    """Write the messages of the dive, as a ground station with a number of links receives them.

    With ``clock`` SYSTEM_TIME has the time of messages that may have none.

    ``commands`` makes the message with the commands, ``attitude`` that with the attitude and
    ``position`` that with the depth; the defaults are ACTUATOR_OUTPUT_STATUS, ATTITUDE and
    LOCAL_POSITION_NED.
    """
    senders = [mavlink.MAVLink(None, 1, 1) for _ in range(links)]
    for number, sender in enumerate(senders):
        sender.seq = 100 * number
    data = b""
    for entry in _messages(
        commands or _output_status,
        texts,
        attitude or _attitude,
        position or _local_position,
        clock=clock and attitude is not None,
    ):
        stamp = struct.pack(">Q", 1_700_000_000_000_000 + round(1e6 * entry[0]) + 250_000)
        data += b"".join(stamp + bytes(entry[1].pack(sender)) for sender in senders)
    path.write_bytes(data)
    return path


def entries() -> list[recording.Entry]:
    """Return the messages of the dive, without parameters, for a log of a recorder."""
    dive = _messages(_output_status, True, _attitude, _local_position, clock=False)
    return [entry for entry in dive if entry[1].msgname != "PARAM_VALUE"]


def _messages(
    commands: Callable[[Sample], object],
    texts: bool,
    attitude: Callable[[Sample], object],
    position: Callable[[Sample], object],
    *,
    clock: bool,
) -> Iterator[recording.Entry]:
    yield BOOTED_S, mavlink.MAVLink_param_value_message(b"ACT_TRAVEL_DEG", 12.0, 9, 1, 0)
    for k, s in enumerate(samples()):
        if clock:
            yield s.time_s, mavlink.MAVLink_system_time_message(0, round(1e3 * s.time_s))
        yield s.time_s, commands(s)
        yield s.time_s, attitude(s)
        if k % 5 == 0:
            yield s.time_s, position(s)
        if texts and math.isclose(s.time_s, BOOTED_S + TEST[0]):
            yield from recording.texts(
                s.time_s, "SystemID Starting: axis=12 wave=step magnitude=4.00", 7
            )
        if texts and math.isclose(s.time_s, BOOTED_S + TEST[1]):
            yield from recording.texts(s.time_s, "SystemID Finished", 8)


def _attitude(s: Sample) -> object:
    ms = round(1e3 * s.time_s)
    return mavlink.MAVLink_attitude_message(ms, 0.0, s.pitch_rad, s.yaw_rad, 0, 0, s.yaw_rate_radps)


def attitude_quaternion(s: Sample) -> object:
    ms, q = round(1e3 * s.time_s), _quaternion(s.pitch_rad, s.yaw_rad)
    return mavlink.MAVLink_attitude_quaternion_message(ms, *q, 0, 0, s.yaw_rate_radps)


def ahrs2(s: Sample) -> object:
    return mavlink.MAVLink_ahrs2_message(0.0, s.pitch_rad, s.yaw_rad, -s.depth_m, 0, 0)


def _local_position(s: Sample) -> object:
    ms = round(1e3 * s.time_s)
    return mavlink.MAVLink_local_position_ned_message(ms, 0, 0, s.depth_m, 1.3, 0, 0.05)


def global_position(s: Sample) -> object:
    ms, mm = round(1e3 * s.time_s), round(-1e3 * s.depth_m)
    return mavlink.MAVLink_global_position_int_message(ms, 0, 0, mm, mm, 130, 0, 5, 0)


BODY_VELOCITY_MPS = (1.2, -0.1, 0.05)
"""Velocity in FRD of the dives with a velocity."""
SPECIFIC_FORCE_MPS2 = (0.3, -0.2, -9.8)
"""Accelerometer of the dives with an acceleration, in FRD, without turning; turning adds the yaw
rate (rad/s) to x."""


def specific_force_mps2(yaw_rate_radps: float) -> tuple[float, float, float]:
    x, y, z = SPECIFIC_FORCE_MPS2
    return x + yaw_rate_radps, y, z


def velocity_ned_mps(s: Sample) -> tuple[float, float, float]:
    """Return the velocity in NED, turned by scipy from yaw, then pitch."""
    turned = Rotation.from_euler("ZY", [s.yaw_rad, s.pitch_rad]).apply(BODY_VELOCITY_MPS)
    return float(turned[0]), float(turned[1]), float(turned[2])


def moving_local_position(s: Sample) -> object:
    ms = round(1e3 * s.time_s)
    return mavlink.MAVLink_local_position_ned_message(ms, 0, 0, s.depth_m, *velocity_ned_mps(s))


def moving_global_position(s: Sample) -> object:
    ms, mm = round(1e3 * s.time_s), round(-1e3 * s.depth_m)
    cmps = (round(100 * v) for v in velocity_ned_mps(s))
    return mavlink.MAVLink_global_position_int_message(ms, 0, 0, mm, mm, *cmps, 0)


def moving_vfr_hud(s: Sample) -> object:
    return mavlink.MAVLink_vfr_hud_message(0.0, 1.2 + 0.01 * s.yaw_rad, 0, 58, -s.depth_m, -0.05)


def system_time(s: Sample) -> object:
    """Return a message without depth."""
    return mavlink.MAVLink_system_time_message(0, round(1e3 * s.time_s))


def vfr_hud(s: Sample) -> object:
    return mavlink.MAVLink_vfr_hud_message(0.0, 1.3, 0, 58, -s.depth_m, -0.05)


def _output_status(s: Sample) -> object:
    controls = [s.rudder, s.elevator, s.thrust, *[0.0] * 29]
    return mavlink.MAVLink_actuator_output_status_message(round(1e6 * s.time_s), 7, controls)


def servo_pulses(s: Sample) -> object:
    """Return SERVO_OUTPUT_RAW with reversed elevator on output 1, thrust on 2, rudder on 3."""
    us = (pulse(-s.elevator), pulse(s.thrust), pulse(s.rudder))
    return mavlink.MAVLink_servo_output_raw_message(round(1e6 * s.time_s), 0, *us, *[0] * 5)


_FMT = 0x80
_DATAFLASH: dict[str, tuple[int, str, str]] = {
    "PARM": (1, "QNff", "TimeUS,Name,Value,Default"),
    "ATT": (2, "QccccCCccB", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw,AEKF"),
    "RATE": (3, "Qffffff", "TimeUS,RDes,R,PDes,P,YDes,Y"),
    "RCOU": (4, "QHHHH", "TimeUS,C1,C2,C3,C4"),
    "CTUN": (5, "Qff", "TimeUS,DAlt,Alt"),
    "MSG": (6, "QZ", "TimeUS,Message"),
    "SIDS": (7, "QBfffffff", "TimeUS,Ax,Mag,FSt,FSp,TFin,TC,TR,TFout"),
    "MODE": (8, "QMBB", "TimeUS,Mode,ModeNum,Rsn"),
    "IMU": (9, "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
    "GYR": (10, "QBfff", "TimeUS,I,GyrX,GyrY,GyrZ"),
    "POS": (11, "QLLff", "TimeUS,Lat,Lng,Alt,RelHomeAlt"),
    "BARO": (12, "QBf", "TimeUS,I,Alt"),
    "XKF1": (13, "QBffff", "TimeUS,C,VN,VE,VD,PD"),
    "RCOU_OLD": (14, "QHHHH", "TimeUS,Chan1,Chan2,Chan3,Chan4"),
}
_DATAFLASH_2014: dict[str, tuple[int, str, str]] = {
    "PARM_2014": (20, "Nf", "Name,Value"),
    "MSG_2014": (21, "Z", "Message"),
    "ATT_2014": (22, "IccccCC", "TimeMS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw"),
    "IMU_2014": (23, "Iffffff", "TimeMS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
    "RCOU_2014": (24, "Ihhhh", "TimeMS,Chan1,Chan2,Chan3,Chan4"),
    "BARO_2014": (25, "Iffc", "TimeMS,Alt,Press,Temp"),
    "GPS_2014": (26, "BIHfI", "Status,TimeMS,Week,Spd,T"),
}
"""Messages of versions with milliseconds; in GPS, TimeMS is the time of the week and T that since
boot. GPS has more columns there."""
_RECORDS = _DATAFLASH | _DATAFLASH_2014
_DATAFLASH_CODES = {
    "Q": "Q",
    "N": "16s",
    "Z": "64s",
    "f": "f",
    "c": "h",
    "C": "H",
    "B": "B",
    "H": "H",
    "h": "h",
    "I": "I",
    "L": "i",
    "M": "B",
}


class DataflashVariant(NamedTuple):
    """Messages of the rates (empty for none), of the depth and of the outputs."""

    rates: str = "RATE"
    depth: str = "CTUN"
    outputs: str = "RCOU"


VARIANTS = {
    "ArduSub": DataflashVariant(),
    "ArduRover": DataflashVariant("IMU", "POS"),
    "ArduPlane": DataflashVariant("IMU", "BARO"),
    "estimator": DataflashVariant("GYR", "XKF1"),
    "old": DataflashVariant("IMU", "BARO", "RCOU_OLD"),
}
"""Messages that ArduPilot's vehicles log, and those of old logs."""


def _rates(variant: DataflashVariant, us: int, rate_radps: float) -> bytes:
    if not variant.rates:
        return b""
    if variant.rates == "RATE":
        return _record("RATE", us, 0.0, 0.0, 0.0, 0.0, 0.0, math.degrees(rate_radps))
    # The second instance measures something else and must not be read.
    first: tuple[float, ...] = (us, 0, 0.0, 0.0, rate_radps)
    second: tuple[float, ...] = (us, 1, 9.0, 9.0, 9.0)
    if variant.rates == "IMU":
        first, second = (*first, *specific_force_mps2(rate_radps)), (*second, 9.0, 9.0, 9.0)
    return _record(variant.rates, *first) + _record(variant.rates, *second)


def _depth(variant: DataflashVariant, us: int, s: Sample) -> bytes:
    depth_m = s.depth_m
    match variant.depth:
        case "CTUN":
            return _record("CTUN", us, -4.0, -depth_m)
        case "POS":
            return _record("POS", us, 0, 0, 100.0, -depth_m)
        case "BARO":
            return _record("BARO", us, 0, -depth_m) + _record("BARO", us, 1, 77.0)
        case _:
            estimate = _record("XKF1", us, 0, *velocity_ned_mps(s), depth_m)
            return estimate + _record("XKF1", us, 1, 7.0, 7.0, 7.0, 77.0)


Surfaces = Callable[[Sample], tuple[float, float]]
"""Returns outputs 1 and 2, as fractions of the travel."""


def rudder_and_elevator(s: Sample) -> tuple[float, float]:
    """Return the outputs of a vehicle with a rudder and an elevator."""
    return s.rudder, s.elevator


def dataflash(
    path: Path,
    ending: str = "SystemID Finished",
    sids: bool = True,
    parameters: dict[str, float] | None = None,
    variant: str = "ArduSub",
    every: int = 1,
    last_parameters: dict[str, float] | None = None,
    surfaces: Surfaces = rudder_and_elevator,
) -> Path:
    """Write a .bin; ``ending`` is the text that ends the test, or MODE for a change of mode.

    ``last_parameters`` are set after the dive. ``surfaces`` gives outputs 1 and 2.
    Of the regular messages one in ``every`` is logged, and each event just before the next.
    """
    messages = VARIANTS[variant]
    data = b"".join(_format(name) for name in _DATAFLASH)
    for name, value in (parameters or {"ACT_TRAVEL_DEG": 12.0}).items():
        data += _record("PARM", 0, name.encode(), value, value)
    for k, s in enumerate(samples()):
        us = round(1e6 * s.time_s)
        yaw, pitch = (
            round(math.degrees(s.yaw_rad) % 360.0 * 100),
            round(math.degrees(s.pitch_rad) * 100),
        )
        if k % every == (1 if every > 1 else 0):
            data += _record("ATT", us, 0, 0, 0, pitch, 9000, yaw, 0, 0, 3)
            data += _rates(messages, us, s.yaw_rate_radps)
            first, second = map(pulse, surfaces(s))
            data += _record(messages.outputs, us, first, second, pulse(s.thrust), 0)
        if k % max(5, every) == (1 if every > 1 else 0):
            data += _depth(messages, us, s)
        if sids and math.isclose(s.time_s, BOOTED_S + TEST[0]):
            data += _record("MSG", us, b"SystemID Starting: axis=12")
            data += _record("SIDS", us, 12, 1 / 3, 0.1, 1.0, 0.0, 0.0, 10.0, 0.0)
            data += _record("MODE", us + 2000, 25, 25, 1)
        if sids and math.isclose(s.time_s, BOOTED_S + TEST[1]):
            data += (
                _record("MODE", us, 0, 0, 1)
                if ending == "MODE"
                else _record("MSG", us, ending.encode())
            )
    for name, value in (last_parameters or {}).items():
        data += _record("PARM", us + 1000, name.encode(), value, value)
    path.write_bytes(data)
    return path


def dataflash_2014(path: Path) -> Path:
    """Write a .bin of a version with milliseconds, whose parameters and texts have no time.

    The last parameter is set at the end of the test.
    """
    data = b"".join(_format(name) for name in _DATAFLASH_2014)
    data += _record("PARM_2014", b"ACT_TRAVEL_DEG", 12.0)
    for k, s in enumerate(samples()):
        ms, pitch = round(1e3 * s.time_s), round(math.degrees(s.pitch_rad) * 100)
        yaw = round(math.degrees(s.yaw_rad) % 360.0 * 100)
        outputs = pulse(s.rudder), pulse(s.elevator), pulse(s.thrust), 0
        force = specific_force_mps2(s.yaw_rate_radps)
        data += _record("ATT_2014", ms, 0, 0, 0, pitch, 9000, yaw)
        data += _record("IMU_2014", ms, 0.0, 0.0, s.yaw_rate_radps, *force)
        data += _record("RCOU_2014", ms, *outputs)
        if k % 5 == 0:
            data += _record("BARO_2014", ms, -s.depth_m, 1e5, 1000)
            data += _record("GPS_2014", 3, 400_000_000 + ms, 1800, 1.3, ms)
        if math.isclose(s.time_s, BOOTED_S + TEST[0]):
            data += _record("MSG_2014", b"SystemID Starting: axis=12")
        if math.isclose(s.time_s, BOOTED_S + TEST[1]):
            data += _record("MSG_2014", b"SystemID Finished")
            data += _record("PARM_2014", b"INS_FILTER", 20.0)
    path.write_bytes(data)
    return path


def _format(name: str) -> bytes:
    number, codes, columns = _RECORDS[name]
    length = 3 + struct.calcsize("<" + "".join(_DATAFLASH_CODES[c] for c in codes))
    body = struct.pack(
        "<BB4s16s64s", number, length, name.split("_")[0].encode(), codes.encode(), columns.encode()
    )
    return bytes((0xA3, 0x95, _FMT)) + body


def _record(name: str, *values: object) -> bytes:
    number, codes, _ = _RECORDS[name]
    layout = "<" + "".join(_DATAFLASH_CODES[c] for c in codes)
    return bytes((0xA3, 0x95, number)) + struct.pack(layout, *values)


_ULOG: dict[str, tuple[int, str, str]] = {
    "vehicle_attitude": (0, "QQ4f", "uint64_t timestamp;uint64_t timestamp_sample;float[4] q;"),
    "vehicle_angular_velocity": (
        1,
        "QQ3f",
        "uint64_t timestamp;uint64_t timestamp_sample;float[3] xyz;",
    ),
    "vehicle_local_position": (
        2,
        "Qffff",
        "uint64_t timestamp;float z;float vx;float vy;float vz;",
    ),
    "actuator_outputs": (3, "Q16f", "uint64_t timestamp;float[16] output;"),
    "vehicle_attitude/old": (
        4,
        "Q7f",
        "uint64_t timestamp;float rollspeed;float pitchspeed;float yawspeed;float[4] q;",
    ),
    "sensor_combined": (
        5,
        "Q3f3f",
        "uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2;",
    ),
    "vehicle_air_data": (6, "Qf", "uint64_t timestamp;float baro_alt_meter;"),
    "vehicle_global_position": (7, "Qf", "uint64_t timestamp;float alt;"),
    "actuator_outputs_sim": (11, "Q16f", "uint64_t timestamp;float[16] output;"),
    "actuator_servos": (8, "Q8f", "uint64_t timestamp;float[8] control;"),
    "actuator_motors": (9, "Q12f", "uint64_t timestamp;float[12] control;"),
    "actuator_controls_0": (10, "Q8f", "uint64_t timestamp;float[8] control;"),
}
LATENCY_S = 0.012
"""Delay of a topic's time stamp after the time of its sample."""


class UlogVariant(NamedTuple):
    """Topics of attitude, rates, depth and outputs."""

    attitude: str = "vehicle_attitude"
    rates: str = "vehicle_angular_velocity"
    depth: str = "vehicle_local_position"
    outputs: tuple[str, ...] = ("actuator_outputs",)


ULOG_VARIANTS = {
    "1.10 to 1.13": UlogVariant(),
    "before 1.10": UlogVariant(
        "vehicle_attitude/old", "", "vehicle_local_position", ("actuator_controls_0",)
    ),
    "gyro and barometer": UlogVariant(rates="sensor_combined", depth="vehicle_air_data"),
    "from 1.14": UlogVariant(
        depth="vehicle_global_position", outputs=("actuator_servos", "actuator_motors")
    ),
    "simulated": UlogVariant(outputs=("actuator_outputs_sim",)),
}
"""Topics that versions of PX4 log."""


def _ulog_topics(
    variant: UlogVariant, s: Sample, k: int, pulse_of: Callable[[float], int], surfaces: Surfaces
) -> bytes:
    us, late = round(1e6 * s.time_s), round(1e6 * (s.time_s + LATENCY_S))
    quaternion = _quaternion(s.pitch_rad, s.yaw_rad)
    data = b""
    if variant.attitude.endswith("/old"):
        data += _topic(variant.attitude, us, 0.0, 0.0, s.yaw_rate_radps, *quaternion)
    else:
        data += _topic(variant.attitude, late, us, *quaternion)
    if variant.rates == "sensor_combined":
        force = specific_force_mps2(s.yaw_rate_radps)
        data += _topic(variant.rates, us, 0.0, 0.0, s.yaw_rate_radps, *force)
    elif variant.rates:
        data += _topic(variant.rates, late, us, 0.0, 0.0, s.yaw_rate_radps)
    data += b"".join(
        _outputs(name, us, s, pulse_of, surfaces) for name in reversed(variant.outputs)
    )
    if k % 5 == 0 and variant.depth == "vehicle_local_position":
        data += _topic(variant.depth, us, s.depth_m, *velocity_ned_mps(s))
    elif k % 5 == 0:
        data += _topic(variant.depth, us, -s.depth_m)
    return data


def _outputs(
    name: str, us: int, s: Sample, pulse_of: Callable[[float], int], surfaces: Surfaces
) -> bytes:
    fractions = (*surfaces(s), s.thrust)
    match name:
        case "actuator_outputs":
            return _topic(name, us, *(float(pulse_of(v)) for v in fractions), *[0.0] * 13)
        case "actuator_outputs_sim":
            return _topic(name, us, *fractions, *[0.0] * 13)
        case "actuator_servos":
            return _topic(name, us, *fractions[:2], *[math.nan] * 6)
        case "actuator_motors":
            return _topic(name, us, s.thrust, *[math.nan] * 11)
        case _:  # roll, pitch, yaw, thrust
            return _topic(name, us, 0.0, s.elevator, s.rudder, s.thrust, *[0.0] * 4)


def ulog(
    path: Path,
    texts: bool = True,
    variant: str = "1.10 to 1.13",
    parameters: dict[str, float] | None = None,
    pulse_of: Callable[[float], int] = pulse,
    last_parameters: dict[str, float] | None = None,
    surfaces: Surfaces = rudder_and_elevator,
    instance: int = 0,
    subscribe_again: bool = False,
) -> Path:
    """Write the dive as PX4 logs it; ``pulse_of`` makes the pulse of a fraction of the travel.

    ``last_parameters`` are set after the dive. With ``subscribe_again`` the topics have other
    numbers from the middle of the test on.
    """
    topics = ULOG_VARIANTS[variant]
    names = [n for n in (topics.attitude, topics.rates, topics.depth, *topics.outputs) if n]
    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", round(1e6 * BOOTED_S))
    data += _block("B", bytes(40))
    for name in names:
        data += _block("F", f"{name.partition('/')[0]}:{_ULOG[name][2]}".encode())
    for name, value in ({"ACT_TRAVEL_DEG": 12.0} | (parameters or {})).items():
        data += _parameter(name, value)
    data += _subscriptions(names, instance)
    first_number = 0
    for k, s in enumerate(samples()):
        us = round(1e6 * s.time_s)
        if subscribe_again and math.isclose(s.time_s, BOOTED_S + sum(TEST) / 2):
            first_number = 100
            data += _subscriptions(names, instance, first_number)
        data += _renumbered(_ulog_topics(topics, s, k, pulse_of, surfaces), first_number)
        if texts and math.isclose(s.time_s, BOOTED_S + TEST[0]):
            data += _block("L", struct.pack("<BQ", ord("6"), us) + b"SystemID Starting: axis=12")
        if texts and math.isclose(s.time_s, BOOTED_S + TEST[1]):
            data += _block("L", struct.pack("<BQ", ord("6"), us) + b"SystemID Finished")
    for name, value in (last_parameters or {}).items():
        data += _parameter(name, value)
    path.write_bytes(data)
    return path


def _subscriptions(names: list[str], instance: int, first_number: int = 0) -> bytes:
    numbers = {name: first_number + _ULOG[name][0] for name in names}
    return b"".join(
        _block("A", struct.pack("<BH", instance, number) + name.partition("/")[0].encode())
        for name, number in numbers.items()
    )


def _renumbered(samples: bytes, first_number: int) -> bytes:
    data, offset = bytearray(samples), 0
    while offset < len(data):
        (length,), (number,) = (struct.unpack_from("<H", data, offset + at) for at in (0, 3))
        struct.pack_into("<H", data, offset + 3, number + first_number)
        offset += 3 + length
    return bytes(data)


def _parameter(name: str, value: float) -> bytes:
    key = f"float {name}".encode()
    return _block("P", bytes((len(key),)) + key + struct.pack("<f", value))


def _block(kind: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(kind)) + body


def _topic(name: str, *values: float) -> bytes:
    number, layout, _ = _ULOG[name]
    return _block("D", struct.pack("<H", number) + struct.pack("<" + layout, *values))


def _quaternion(pitch: float, yaw: float) -> tuple[float, float, float, float]:
    cp, sp, cy, sy = math.cos(pitch / 2), math.sin(pitch / 2), math.cos(yaw / 2), math.sin(yaw / 2)
    return cp * cy, -sp * sy, sp * cy, cp * sy
