"""Where the vehicle is over ground: dead reckoning, corrected by satellite fixes and by the Doppler
log. Pure.

A horizontal vector is one complex number, north + i east, so that turning is multiplying. Four of
them are estimated: the position, the current, how wrong the speed through the water is that the
thrust tells, and how wrong the Doppler log is with the heading it is turned by; the two errors are
fractions of the speed, their imaginary part is an angle. The filter is Kalman's for circular
complex variables (Schreier and Scharf 2010, "Statistical Signal Processing of Complex-Valued Data",
chapter 5): it holds where errors are alike in all directions, and then one covariance serves both
axes. The current stays where it is while the errors turn with the vehicle: so a turn tells them
apart.

With w the velocity through the water by the thrust, m its error, c the current and k the log's
error::

    position' = w (1 + m) + c         bottom track: (w (1 + m) + c) (1 + k)         water track: w
    (1 + m) (1 + k)

A turn's sideslip and lost speed are not modelled. Where a Doppler log tells them they move the
position and teach the filter little; where none does they count as error."""

import math
from typing import NamedTuple

from autopilot.control.params import Config
from autopilot.control.sensor_health.sensor_checks import has_fix
from autopilot.control.types import US_PER_S, Home, Inputs, NavCovariance, Navigation
from mavlink_io.frames import Quaternion, geodetic_to_offset, rotate
from mavlink_io.records import Dvl, GpsFix

UPDATE_S = 0.2
"""The covariance is brought up to date when something was measured, and else so often."""
POSITION_WALK_M2PS = 0.02**2
"""Growth of the position's variance by what is in none of the other errors: waves and gusts."""
SHEAR_MPS2 = 0.02**2
"""Growth of the current's variance, (m/s)^2 per metre of depth: the water below need not move as
that above."""
TURN_LOG = 0.003**2
"""Growth of the log's error's variance per radian of turn: the compass's deviation."""
SLIP_M, SLIP_S = 1.5, 1.0
"""Speed that is not where the model has it, per rate of turn and per acceleration."""
UNPOWERED_FACTOR = 3.0
"""Without the propeller all of the speed may be wrong, and for longer than a turn lasts."""
SLIP_FADES_S, SLIP_CORRELATION_S = 8.0, 5.0
SLIP_SHARE, MIN_WATER_SPEED_MPS = 0.3, 0.2
"""Of what a ping is off, how much is taken for slip, and the speed below which there is none."""
DVL_TIMEOUT_US = 2 * US_PER_S
GNSS_CORRELATION_S, DVL_CORRELATION_S = 5.0, 1.0
"""Errors of fixes, and of pings, closer together than this are alike: so many seconds of them are
worth one."""
DEFAULT_GNSS_SD_M, MIN_GNSS_SD_M, GNSS_VELOCITY_SD_MPS, DVL_SD_MPS = 2.5, 1.0, 0.05, 0.02
"""Of a fix whose receiver does not say, the best that is believed, of its velocity, and the best
ping believed."""
INNOVATION_GATE_SD = 5.0
"""What is further off than this is refused, unless it goes on."""
MAX_CONSECUTIVE_REJECTIONS = 15
MAX_LATENCY_S = 1.0
"""A device whose clock tells of more than this does not keep vehicle time."""

Row = tuple[complex, complex, complex, complex]
"""How a measurement depends on position, current, and the two errors."""
_PLACE: Row = (1.0, 0.0, 0.0, 0.0)


class MotionInput(NamedTuple):
    """What a tick knows of how the vehicle moves, but for where she is."""

    time_us: int
    attitude: Quaternion
    water_mps: complex
    """Velocity through the water, by the thrust."""
    driven: bool
    """The propeller turns."""
    turn_radps: float
    rise_mps: float


class NavSolution(NamedTuple):
    """Where she is, how she moves over ground, and the memory that goes with it."""

    position_m: complex
    velocity_mps: complex
    memory: Navigation


def initial_solution(config: Config) -> Navigation:
    """Knowing nothing but where north and east are counted from."""
    current, water, log = _max_variances(config)
    return Navigation(covariance=NavCovariance(0.0, current, water, log))


def predict_and_update(
    position_m: complex,
    old: Navigation,
    motion: MotionInput,
    inputs: Inputs,
    home: Home,
    config: Config,
    dt_s: float,
) -> NavSolution:
    """The plot after a tick; ``place_m`` is counted from ``home``, or from the start where there is
    none yet."""
    water = motion.water_mps
    velocity = water * (1.0 + old.speed_error + old.slip) + old.current_mps
    position_m += velocity * dt_s
    span_s, distance_m = old.span_s + dt_s, old.distance_m + water * dt_s
    fix, ping = inputs.gps, inputs.dvl
    if fix is None and ping is None and span_s < UPDATE_S:
        return NavSolution(position_m, velocity, old._replace(span_s=span_s, distance_m=distance_m))
    plot = NavSolution(
        position_m, velocity, _propagate_covariance(old, span_s, distance_m, motion, config)
    )
    if ping is not None:
        plot = _update_dvl(plot, motion, ping, config)
    if fix is not None and has_fix(fix) and home.known:
        plot = _update_gnss(plot, motion, fix, home)
    return plot._replace(velocity_mps=_velocity(plot.memory, motion) + water * plot.memory.slip)


def sd_m(memory: Navigation) -> float:
    """One standard deviation of the position along each axis."""
    return math.sqrt(max(0.0, memory.covariance.position))


def current_sd_mps(memory: Navigation) -> float:
    """One standard deviation of the current along each axis."""
    return math.sqrt(max(0.0, memory.covariance.current))


def velocity_sd_mps(memory: Navigation, speed_mps: float, time_us: int) -> float:
    """One standard deviation of the velocity over ground along each axis, at a speed through the
    water."""
    covariance = memory.covariance
    if _has_dvl(memory, time_us):
        water = 0.0 if memory.over_ground else covariance.current
        return math.sqrt(max(0.0, water + DVL_SD_MPS**2 + speed_mps**2 * covariance.dvl))
    slip = memory.slip_sd_mps**2
    return math.sqrt(max(0.0, covariance.current + speed_mps**2 * covariance.speed + slip))


def shift_home(position_m: complex, old: Home, new: Home) -> complex:
    """The same place counted from a new home; without an old one she is where home was said to
    be."""
    if not old.known:
        return position_m
    return position_m + complex(
        *geodetic_to_offset(old.lat_deg, old.lon_deg, new.lat_deg, new.lon_deg)
    )


def _max_variances(config: Config) -> tuple[float, float, float]:
    """Variances of current and errors before anything was measured: they never grow beyond."""
    return (
        config.current_sd_mps**2,
        (config.speed_error_pct / 100.0) ** 2,
        (config.log_error_pct / 100.0) ** 2,
    )


def _propagate_covariance(
    old: Navigation, span_s: float, distance_m: complex, motion: MotionInput, config: Config
) -> Navigation:
    """Bring the covariance up to date after a stretch of dead reckoning."""
    pp, cc, mm, kk, pc, pm, pk, cm, ck, mk = old.covariance
    most_cc, _, most_kk = _max_variances(config)
    turn_rad, sink_m = abs(motion.turn_radps) * span_s, abs(motion.rise_mps) * span_s
    unsteady = _slip_sd_mps(old, span_s, distance_m, motion)
    heard = _has_dvl(old, motion.time_us)
    unseen = 0.0 if heard else unsteady * unsteady * SLIP_CORRELATION_S
    a, b, d = _jacobian(old, span_s, distance_m, heard)
    spread = (
        a * pc
        + b.conjugate() * pm
        + d.conjugate() * pk
        + a * (b.conjugate() * cm + d.conjugate() * ck)
    )
    spread += b * d.conjugate() * mk
    own = a * a * cc + abs(b) ** 2 * mm + abs(d) ** 2 * kk
    covariance = NavCovariance(
        pp + own + 2.0 * spread.real + (POSITION_WALK_M2PS + unseen) * span_s,
        max(
            cc, min(most_cc, cc + config.current_walk_mps**2 / 60.0 * span_s + SHEAR_MPS2 * sink_m)
        ),
        mm,
        max(kk, min(most_kk, kk + TURN_LOG * turn_rad)),
        pc + a * cc + b * cm.conjugate() + d * ck.conjugate(),
        pm + a * cm + b * mm + d * mk.conjugate(),
        pk + a * ck + b * mk + d * kk,
        cm,
        ck,
        mk,
    )
    slip = old.slip if heard else old.slip * (1.0 - span_s / SLIP_FADES_S)
    return old._replace(
        slip=slip, slip_sd_mps=unsteady, covariance=covariance, span_s=0.0, distance_m=0j
    )


def _has_dvl(memory: Navigation, time_us: int) -> bool:
    """Whether the Doppler log was, lately."""
    return 0 <= memory.ping_us >= time_us - DVL_TIMEOUT_US


def _jacobian(
    memory: Navigation, span_s: float, distance_m: complex, heard: bool
) -> tuple[float, complex, complex]:
    """How the way of a stretch depends on the current, and on the errors of water and log.

    With the log heard the way is the log's, by slip, and the water's error is in none of it.
    """
    if not heard:
        return span_s, distance_m, 0j
    if not memory.over_ground:
        return span_s, 0j, -distance_m
    return 0.0, 0j, -(distance_m + memory.current_mps * span_s)


def _slip_sd_mps(old: Navigation, span_s: float, distance_m: complex, motion: MotionInput) -> float:
    """How much speed may not be where the model has it."""
    if span_s <= 0.0:
        return old.slip_sd_mps
    gained = 2.0 * abs(abs(motion.water_mps) - abs(distance_m) / span_s) / span_s
    fading = old.slip_sd_mps * (1.0 - min(1.0, span_s / SLIP_FADES_S))
    coasting = 0.0 if motion.driven else UNPOWERED_FACTOR * abs(motion.water_mps)
    return max(fading, SLIP_M * abs(motion.turn_radps), SLIP_S * gained, coasting)


def _update_gnss(plot: NavSolution, motion: MotionInput, fix: GpsFix, home: Home) -> NavSolution:
    """A fix tells the position, and by its velocity the current."""
    memory, now_us = plot.memory, motion.time_us
    late_s = _latency_s(fix.time_us, now_us)
    seen = complex(*geodetic_to_offset(fix.lat_deg, fix.lon_deg, home.lat_deg, home.lon_deg))
    seen += plot.velocity_mps * late_s
    sd = DEFAULT_GNSS_SD_M if math.isnan(fix.eph_m) else max(MIN_GNSS_SD_M, fix.eph_m)
    if memory.fix_us < 0:
        covariance = memory.covariance._replace(
            position=sd * sd, position_current=0j, position_speed=0j, position_dvl=0j
        )
        return plot._replace(
            position_m=seen, memory=memory._replace(covariance=covariance, fix_us=now_us)
        )
    alike = _correlation_scale(GNSS_CORRELATION_S, now_us - memory.fix_us)
    error = seen - plot.position_m
    if _rejected(_PLACE, error, sd * sd, memory.covariance):
        if memory.fixes_rejected < MAX_CONSECUTIVE_REJECTIONS:
            return plot._replace(memory=memory._replace(fixes_rejected=memory.fixes_rejected + 1))
        lost = memory.covariance.position + abs(error) ** 2
        memory = memory._replace(covariance=memory.covariance._replace(position=lost))
    plot = _kalman_update(plot._replace(memory=memory), _PLACE, error, sd * sd * alike)
    gained = complex(fix.velocity_north_mps, fix.velocity_east_mps) - _velocity(plot.memory, motion)
    variance = (GNSS_VELOCITY_SD_MPS**2 + memory.slip_sd_mps**2) * alike
    plot = _kalman_update(plot, (0.0, 1.0, motion.water_mps, 0.0), gained, variance)
    return plot._replace(memory=plot.memory._replace(fix_us=now_us, fixes_rejected=0))


def _update_dvl(plot: NavSolution, motion: MotionInput, ping: Dvl, config: Config) -> NavSolution:
    """Bottom track tells the velocity over ground, water track that through the water."""
    memory, now_us = plot.memory, motion.time_us
    body = ping.velocity_x_mps, ping.velocity_y_mps, ping.velocity_z_mps
    north, east, _ = rotate(motion.attitude, body)
    turned = motion.turn_radps * _latency_s(ping.time_us, now_us)
    seen = complex(north, east) * complex(math.cos(turned), -math.sin(turned))
    water = motion.water_mps
    true = _velocity(memory, motion) if ping.over_ground else water * (1.0 + memory.speed_error)
    row: Row = (0.0, 1.0 if ping.over_ground else 0.0, water, true)
    variance = max(DVL_SD_MPS, ping.figure_of_merit_mps) ** 2 + memory.slip_sd_mps**2
    error = seen - true * (1.0 + memory.dvl_error)
    if _rejected(row, error, variance, memory.covariance):
        if memory.pings_rejected < MAX_CONSECUTIVE_REJECTIONS:
            return plot._replace(memory=memory._replace(pings_rejected=memory.pings_rejected + 1))
        current, speed_error, _ = _max_variances(config)
        astray = memory.covariance._replace(current=current + abs(error) ** 2, speed=speed_error)
        memory = memory._replace(covariance=astray)
    alike = _correlation_scale(DVL_CORRELATION_S, now_us - memory.ping_us)
    plot = _kalman_update(plot._replace(memory=memory), row, error, variance * alike)
    memory = plot.memory._replace(ping_us=now_us, pings_rejected=0, over_ground=ping.over_ground)
    if abs(water) < MIN_WATER_SPEED_MPS:
        return plot._replace(memory=memory)
    left = seen / (1.0 + memory.dvl_error) - water * (1.0 + memory.speed_error)
    left -= memory.current_mps if ping.over_ground else 0j
    slip = memory.slip + SLIP_SHARE * (left / water - memory.slip)
    return plot._replace(memory=memory._replace(slip=slip))


def _velocity(memory: Navigation, motion: MotionInput) -> complex:
    """Over ground, by what is known now, as it is in steady motion."""
    return motion.water_mps * (1.0 + memory.speed_error) + memory.current_mps


def _latency_s(time_us: int, now_us: int) -> float:
    late_s = (now_us - time_us) / US_PER_S
    return late_s if 0.0 <= late_s <= MAX_LATENCY_S else 0.0


def _correlation_scale(alike_s: float, since_us: int) -> float:
    """By how much less a measurement is worth for the one before it."""
    return max(1.0, alike_s * US_PER_S / max(1, since_us))


def _spread(row: Row, covariance: NavCovariance) -> tuple[Row, float]:
    """The covariance of the four with what a measurement sees of them, and the variance of that."""
    pp, cc, mm, kk, pc, pm, pk, cm, ck, mk = covariance
    hp, hc, hm, hk = row
    p, c, m, k = hp.conjugate(), hc.conjugate(), hm.conjugate(), hk.conjugate()
    column = (
        pp * p + pc * c + pm * m + pk * k,
        pc.conjugate() * p + cc * c + cm * m + ck * k,
        pm.conjugate() * p + cm.conjugate() * c + mm * m + mk * k,
        pk.conjugate() * p + ck.conjugate() * c + mk.conjugate() * m + kk * k,
    )
    return column, (hp * column[0] + hc * column[1] + hm * column[2] + hk * column[3]).real


def _rejected(row: Row, error: complex, variance: float, covariance: NavCovariance) -> bool:
    return abs(error) ** 2 > INNOVATION_GATE_SD**2 * (_spread(row, covariance)[1] + variance)


def _kalman_update(plot: NavSolution, row: Row, error: complex, variance: float) -> NavSolution:
    """Kalman's update by one measurement that is ``error`` off what was expected of it."""
    memory = plot.memory
    pp, cc, mm, kk, pc, pm, pk, cm, ck, mk = memory.covariance
    (p, c, m, k), seen = _spread(row, memory.covariance)
    worth = 1.0 / (seen + variance)
    step = error * worth
    wc, wm, wk = c.conjugate() * worth, m.conjugate() * worth, k.conjugate() * worth
    covariance = NavCovariance(
        pp - abs(p) ** 2 * worth,
        cc - abs(c) ** 2 * worth,
        mm - abs(m) ** 2 * worth,
        kk - abs(k) ** 2 * worth,
        pc - p * wc,
        pm - p * wm,
        pk - p * wk,
        cm - c * wm,
        ck - c * wk,
        mk - m * wk,
    )
    learned = memory._replace(
        current_mps=memory.current_mps + c * step,
        speed_error=memory.speed_error + m * step,
        dvl_error=memory.dvl_error + k * step,
        covariance=covariance,
    )
    return plot._replace(position_m=plot.position_m + p * step, memory=learned)
