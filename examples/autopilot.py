"""Example of an autopilot of your own on the simulated sea: one depth and one heading.

    sitl --speed max --truth truth.mcap &
    python examples/autopilot.py --depth 3 --heading 90 --seconds 120

It needs pymavlink and no part of Caribou. Replace ``Controller`` by your own.
docs/hardware.md describes all fields of the messages.
"""

import argparse
import math
import socket

from pymavlink.dialects.v20 import all as mavlink

SYSTEM, COMPONENT = 1, mavlink.MAV_COMP_ID_AUTOPILOT1
ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED | mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
PRESSURE = 0x1A00  # HIL_SENSOR_UPDATED_*: the pressure is new
SURFACE_HPA, HPA_PER_METRE = 1013.25, 100.5
TRAVEL_RAD = math.radians(15.0)  # duct angle of a control of 1
THRUST = 0.58
DECLINATION_RAD = math.radians(-14.4)  # of the site of sitl: magnetic north lies west of north
DEPTH_GAIN, MAX_PITCH_RAD = 0.13, math.radians(20.0)  # pitch command per metre of depth error
PITCH_GAIN, PITCH_RATE_GAIN = 0.5, 1.0  # elevator per pitch error, and s per pitch rate
HEADING_GAIN, YAW_RATE_GAIN = 0.6, 1.0  # rudder per heading error, and s per yaw rate
INTEGRAL_GAIN_PER_S = 0.02  # of both loops: removes the effect of the duct's bias
CORRECTION_PER_S = 0.05  # of the integrated gyro, by accelerometer and compass


def wrap(angle):
    """Return an angle in -pi to pi."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def limit(value, size):
    """Return the value, limited to -size to size."""
    return max(-size, min(size, value))


class Attitude:
    """Complementary filter: the gyro is integrated, accelerometer and compass correct it slowly."""

    roll = pitch = heading = None

    def update(self, s, dt):
        """Use one HIL_SENSOR; angles in rad, forward-right-down axes."""
        roll = math.atan2(-s.yacc, -s.zacc)
        pitch = math.atan2(s.xacc, math.hypot(s.yacc, s.zacc))
        cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
        east = s.zmag * sr - s.ymag * cr
        north = s.xmag * cp + (s.ymag * sr + s.zmag * cr) * sp
        heading = wrap(math.atan2(east, north) + DECLINATION_RAD)
        if self.heading is None:
            self.roll, self.pitch, self.heading = roll, pitch, heading
        # Euler angle rates (Fossen 2011, eq. 2.39)
        cr, sr, cp = math.cos(self.roll), math.sin(self.roll), math.cos(self.pitch)
        yaw_rate = (s.ygyro * sr + s.zgyro * cr) / cp
        gain = CORRECTION_PER_S * dt
        self.roll += (s.xgyro + yaw_rate * math.sin(self.pitch)) * dt
        self.pitch += (s.ygyro * cr - s.zgyro * sr) * dt
        self.heading += yaw_rate * dt
        self.roll += gain * wrap(roll - self.roll)
        self.pitch += gain * (pitch - self.pitch)
        self.heading = wrap(self.heading + gain * wrap(heading - self.heading))


class Controller:
    """Depth over pitch, and heading; proportional with rate damping and a slow integral."""

    def __init__(self, depth, heading):
        self.depth_command, self.heading_command = depth, heading
        self.attitude, self.depth = Attitude(), 0.0
        self.elevator_integral = self.rudder_integral = 0.0

    def update(self, s, dt):
        """Return rudder, elevator and thrust (-1 to 1) for one HIL_SENSOR."""
        self.attitude.update(s, dt)
        if s.fields_updated & PRESSURE:
            self.depth = (s.abs_pressure - SURFACE_HPA) / HPA_PER_METRE
        # positive pitch is nose up: a vehicle that is too shallow has to pitch down
        depth_error = self.depth_command - self.depth
        pitch_command = limit(-DEPTH_GAIN * depth_error, MAX_PITCH_RAD)
        pitch_error = pitch_command - self.attitude.pitch
        heading_error = wrap(self.heading_command - self.attitude.heading)
        if abs(depth_error) < 1.0:
            self.elevator_integral -= 0.2 * INTEGRAL_GAIN_PER_S * depth_error * dt
        if abs(heading_error) < 0.3:
            self.rudder_integral += INTEGRAL_GAIN_PER_S * heading_error * dt
        elevator = PITCH_GAIN * pitch_error - PITCH_RATE_GAIN * s.ygyro + self.elevator_integral
        rudder = HEADING_GAIN * heading_error - YAW_RATE_GAIN * s.zgyro + self.rudder_integral
        return limit(rudder / TRAVEL_RAD, 1.0), limit(elevator / TRAVEL_RAD, 1.0), THRUST


def fly(controller, address, seconds):
    """Answer every HIL_SENSOR until the vehicle's clock has advanced by some seconds."""
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    link.bind(address)
    mav = mavlink.MAVLink(None, srcSystem=SYSTEM, srcComponent=COMPONENT)
    mav.robust_parsing = True
    start_us = last_us = answer = None
    while start_us is None or last_us - start_us < 1e6 * seconds:
        data, simulator = link.recvfrom(65535)
        for s in mav.parse_buffer(data) or ():
            if s.get_type() != "HIL_SENSOR":
                continue
            if s.time_usec != last_us:  # sitl repeats a sample whose answer was lost
                dt = 0.0 if last_us is None else 1e-6 * (s.time_usec - last_us)
                controls = [*controller.update(s, dt), *[0.0] * 13]
                answer = mavlink.MAVLink_hil_actuator_controls_message(
                    s.time_usec, controls, ARMED, 0
                )
                if start_us is None or s.time_usec // 10_000_000 != last_us // 10_000_000:
                    heading = math.degrees(controller.attitude.heading) % 360.0
                    time_s = 1e-6 * s.time_usec
                    print(
                        f"{time_s:4.0f} s  {controller.depth:5.2f} m  {heading:5.1f} deg",
                        flush=True,
                    )
                start_us, last_us = (s.time_usec if start_us is None else start_us), s.time_usec
            link.sendto(answer.pack(mav), simulator)


def main():
    """Read the command line and fly."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--depth", type=float, default=3.0, help="m")
    parser.add_argument("--heading", type=float, default=90.0, help="deg, clockwise from north")
    parser.add_argument("--seconds", type=float, default=120.0, help="time of the vehicle")
    parser.add_argument("--port", type=int, default=14560, help="UDP port to which sitl sends")
    options = parser.parse_args()
    controller = Controller(options.depth, math.radians(options.heading))
    fly(controller, ("127.0.0.1", options.port), options.seconds)


if __name__ == "__main__":
    main()
