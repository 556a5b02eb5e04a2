"""Example of a tailcone computer: the vehicle's end of Caribou's HIL link.

    python examples/tailcone.py /dev/ttyUSB0 115200

It simulates the sensors of a vehicle at rest on the bench, level and dry. It needs pyserial and
pymavlink, and no part of Caribou. Replace ``read_sensors`` and ``drive`` by your own sensors and
motors. docs/hardware.md describes all fields and the other messages that a vehicle may send.
"""

import random
import sys
import time

import serial
from pymavlink.dialects.v20 import all as mavlink

SYSTEM, COMPUTER, DUCT = 1, mavlink.MAV_COMP_ID_USER1, mavlink.MAV_COMP_ID_SERVO1
RATE_HZ = 50  # sensor samples per second
FEEDBACK_EVERY, FIX_EVERY = 5, 50  # ticks between duct angles, and between GNSS fixes
WATCHDOG_S = 1.0  # time without actuator messages after which the actuators return to neutral
TRAVEL_DEG = 15.0  # duct angle of a control of 1
ACCELEROMETER, GYRO, MAGNETOMETER, PRESSURE = 0x07, 0x38, 0x1C0, 0x1A00  # HIL_SENSOR_UPDATED_*
NEUTRAL = (0.0, 0.0, 0.0)


def read_sensors():
    """Return the readings of the inertial and pressure sensors.

    Specific force (m/s2), angular rates (rad/s) and magnetic field (gauss) in forward-right-down
    axes, pressure (hPa) and temperature (degC).
    """
    readings = (0.0, 0.0, -9.81, 0.0, 0.0, 0.0, 0.19, -0.05, 0.48, 1013.25, 12.0)
    return [reading + random.gauss(0.0, 1e-3) for reading in readings]


def drive(rudder, elevator, thrust):
    """Apply controls in [-1, 1]; return the measured duct angles as fractions of the travel."""
    angles = f"rudder {TRAVEL_DEG * rudder:+.1f} deg, elevator {TRAVEL_DEG * elevator:+.1f} deg"
    print(f"{angles}, thrust {100.0 * thrust:+.0f} %", flush=True)
    return rudder, elevator


def newest_controls(link, data):
    """Return rudder, elevator and thrust of the last HIL_ACTUATOR_CONTROLS in the data, or None."""
    received = [m for m in link.parse_buffer(data) or () if m.get_type() == "HIL_ACTUATOR_CONTROLS"]
    if not received:
        return None
    # NaN means no command.
    return tuple(max(-1.0, min(1.0, c)) if c == c else 0.0 for c in received[-1].controls[:3])


def run(port):
    """Send sensors at a constant rate and apply the last controls.

    The actuators stop when no controls arrive.
    """
    computer, duct = (
        mavlink.MAVLink(port, srcSystem=SYSTEM, srcComponent=component)
        for component in (COMPUTER, DUCT)
    )
    computer.robust_parsing = True  # skip noise on the line
    applied, position, received_s = NEUTRAL, drive(*NEUTRAL), time.monotonic()
    start_s = next_s = time.monotonic()
    updated = ACCELEROMETER | GYRO | MAGNETOMETER | PRESSURE
    for tick in range(sys.maxsize):
        time_us = round(1e6 * (time.monotonic() - start_s))
        ax, ay, az, p, q, r, mx, my, mz, hpa, degc = read_sensors()
        if tick % FIX_EVERY == 0:
            lat_e7 = random.gauss(423600000.0, 50.0)  # degrees times 1e7
            lon_e7 = random.gauss(-710900000.0, 50.0)
            computer.hil_gps_send(
                time_us, 3, round(lat_e7), round(lon_e7), 0, 150, 300, 0, 0, 0, 0, 65535, 9
            )
        if tick % FEEDBACK_EVERY == 0:
            duct.actuator_output_status_send(time_us, 0b11, [*position, *[0.0] * 30])
        computer.hil_sensor_send(
            time_us, ax, ay, az, p, q, r, mx, my, mz, hpa, 0.0, 0.0, degc, updated
        )
        next_s += 1.0 / RATE_HZ
        time.sleep(max(0.0, next_s - time.monotonic()))
        controls, now_s = newest_controls(computer, port.read(port.in_waiting)), time.monotonic()
        if controls is not None:
            received_s = now_s
        elif now_s - received_s > WATCHDOG_S:
            controls = NEUTRAL
        if controls is not None and controls != applied:
            applied, position = controls, drive(*controls)


if __name__ == "__main__":
    if len(sys.argv) != 3 or not sys.argv[2].isdecimal():
        sys.exit("usage: tailcone.py DEVICE BAUD")
    with serial.Serial(sys.argv[1], int(sys.argv[2]), timeout=0, exclusive=True) as line:
        run(line)
