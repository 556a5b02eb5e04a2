"""The far end of Caribou's HIL line: the sensors and the tailcone of a vehicle that lies on a
bench, level and dry.

    python examples/tailcone.py /dev/ttyUSB0 115200

It needs pyserial and pymavlink, and nothing of Caribou. Put your own instruments into
``read_sensors`` and your own motors into ``drive``. What every field means, and what else a vehicle
may say, is in docs/hardware.md."""

import random
import sys
import time

import serial
from pymavlink.dialects.v20 import all as mavlink

SYSTEM, HEAD, DUCT = 1, mavlink.MAV_COMP_ID_USER1, mavlink.MAV_COMP_ID_SERVO1
RATE_HZ, FEEDBACK_EVERY, FIX_EVERY = 50, 5, 50
WATCHDOG_S = 1.0
TRAVEL_DEG = 15.0
ACCELEROMETER, GYRO, MAGNETOMETER, PRESSURE = 0x07, 0x38, 0x1C0, 0x1A00
NEUTRAL = (0.0, 0.0, 0.0)


def read_sensors():
    """Specific force (m/s2), rates (rad/s), field (gauss), forward-right-down; pressure (hPa),
    temperature (degC)."""
    readings = (0.0, 0.0, -9.81, 0.0, 0.0, 0.0, 0.19, -0.05, 0.48, 1013.25, 12.0)
    return [reading + random.gauss(0.0, 1e-3) for reading in readings]


def drive(rudder, elevator, thrust):
    """Turn the duct and the propeller; where the duct stands now, as fractions of its travel."""
    angles = f"rudder {TRAVEL_DEG * rudder:+.1f} deg, elevator {TRAVEL_DEG * elevator:+.1f} deg"
    print(f"{angles}, thrust {100.0 * thrust:+.0f} %", flush=True)
    return rudder, elevator


def orders(link, data):
    """Rudder, elevator and thrust of the newest HIL_ACTUATOR_CONTROLS, None where there is none."""
    heard = [m for m in link.parse_buffer(data) or () if m.get_type() == "HIL_ACTUATOR_CONTROLS"]
    if not heard:
        return None
    return tuple(
        max(-1.0, min(1.0, c)) if c == c else 0.0 for c in heard[-1].controls[:3]
    )  # not-a-number is no order


def run(port):
    """Speak at a steady pace, do what was heard last, and let go when nothing is heard any more."""
    head, duct = (
        mavlink.MAVLink(port, srcSystem=SYSTEM, srcComponent=component)
        for component in (HEAD, DUCT)
    )
    head.robust_parsing = True  # noise on the line is passed over
    in_force, position, heard_s = NEUTRAL, drive(*NEUTRAL), time.monotonic()
    began_s = next_s = time.monotonic()
    fresh = ACCELEROMETER | GYRO | MAGNETOMETER | PRESSURE
    for tick in range(sys.maxsize):
        time_us = round(1e6 * (time.monotonic() - began_s))
        ax, ay, az, p, q, r, mx, my, mz, hpa, degc = read_sensors()
        if tick % FIX_EVERY == 0:
            north, east = (
                random.gauss(423600000.0, 50.0),
                random.gauss(-710900000.0, 50.0),
            )  # degrees times 1e7
            head.hil_gps_send(
                time_us, 3, round(north), round(east), 0, 150, 300, 0, 0, 0, 0, 65535, 9
            )
        if tick % FEEDBACK_EVERY == 0:
            duct.actuator_output_status_send(time_us, 0b11, [*position, *[0.0] * 30])
        head.hil_sensor_send(time_us, ax, ay, az, p, q, r, mx, my, mz, hpa, 0.0, 0.0, degc, fresh)
        next_s += 1.0 / RATE_HZ
        time.sleep(max(0.0, next_s - time.monotonic()))
        told, now_s = orders(head, port.read(port.in_waiting)), time.monotonic()
        if told is not None:
            heard_s = now_s
        elif now_s - heard_s > WATCHDOG_S:
            told = NEUTRAL
        if told is not None and told != in_force:
            in_force, position = told, drive(*told)


if __name__ == "__main__":
    if len(sys.argv) != 3 or not sys.argv[2].isdecimal():
        sys.exit("usage: tailcone.py DEVICE BAUD")
    with serial.Serial(sys.argv[1], int(sys.argv[2]), timeout=0, exclusive=True) as line:
        run(line)
