"""Dead reckoning, corrected by satellite fixes and by the Doppler log (DVL). Pure.

Every horizontal vector is one complex number, north + i east, so that a rotation is a
multiplication. Symbols::

    p   position from home (m)
    w   velocity through the water from thrust, pitch and heading (m/s); an input
    c   current: velocity of the water over ground (m/s)
    m   relative error of w; imaginary part: angle (rad), to starboard
    k   relative error of the Doppler log rotated by the heading; parts as m

Equations of motion and of measurement::

    p'            = w (1 + m) + c
    bottom track  = (w (1 + m) + c) (1 + k)
    water track   = w (1 + m) (1 + k)
    satellite fix = p, and its velocity w (1 + m) + c

The filter is a Kalman filter for circular complex variables (Schreier and Scharf 2010,
"Statistical Signal Processing of Complex-Valued Data", chapter 5). It assumes errors that are
equal in all directions, so that one covariance serves both axes. c keeps its direction while w m
and w k turn with the vehicle: a turn separates them.

Sideslip and speed loss in a turn are not modelled. With a Doppler log they are measured (``slip``)
and the filter gives the log less weight meanwhile; without one they add to the uncertainty.
"""

import math
from typing import NamedTuple

from autopilot.control.params import Config
from autopilot.control.sensor_health.sensor_checks import has_fix
from autopilot.control.types import US_PER_S, Home, NavCovariance, Navigation
from mavlink_io.frames import Quaternion, geodetic_to_offset, rotate
from mavlink_io.jit import numeric
from mavlink_io.records import Dvl, GpsFix

UPDATE_S = 0.2
"""Maximum time between two updates of the covariance without a measurement."""
POSITION_WALK_M2PS = 0.02**2
"""Growth of the position variance by effects that no state describes: waves and gusts."""
SHEAR_MPS2 = 0.02**2
"""Growth of the current's variance, (m/s)^2 per metre of depth change: the current varies with
depth."""
TURN_LOG = 0.003**2
"""Growth of the variance of k per radian of turn: compass deviation."""
SLIP_M, SLIP_S = 1.5, 1.0
"""Standard deviation of the unmodelled speed: metres times yaw rate (rad/s), seconds times
acceleration (m/s^2)."""
UNPOWERED_FACTOR = 3.0
"""Standard deviation of the speed over the speed, while the propeller is stopped."""
SLIP_FADES_S, SLIP_CORRELATION_S = 8.0, 5.0
"""Decay time and correlation time of the unmodelled speed."""
SLIP_SHARE, MIN_WATER_SPEED_MPS = 0.3, 0.2
"""Gain of the slip towards the residual of a Doppler log velocity, and minimum speed for that."""
DVL_TIMEOUT_US = 2 * US_PER_S
"""Maximum age of the last Doppler log velocity while the log counts as available."""
GNSS_CORRELATION_S, DVL_CORRELATION_S = 5.0, 1.0
"""Correlation time of measurement errors: all measurements within it count as one."""
DEFAULT_GNSS_SD_M, MIN_GNSS_SD_M = 2.5, 1.0
"""Standard deviation of a fix without ``eph``, and the minimum that is used."""
GNSS_VELOCITY_SD_MPS, DVL_SD_MPS = 0.05, 0.02
"""Standard deviation of a fix's velocity, and minimum of that of a Doppler log velocity."""
INNOVATION_GATE_SD = 5.0
"""A measurement with a larger innovation, in standard deviations, is rejected."""
MAX_CONSECUTIVE_REJECTIONS = 15
"""Number of consecutive rejections after which the next measurement is used."""
MAX_LATENCY_S = 1.0
"""Maximum latency that is compensated: a sensor with a larger one does not use vehicle time."""

Row = tuple[complex, complex, complex, complex]
"""Row H of the measurement matrix: derivatives by p, c, m and k."""
_POSITION_ROW: Row = (1.0 + 0j, 0j, 0j, 0j)


class MotionInput(NamedTuple):
    """Attitude and motion in one tick, without the position."""

    time_us: int
    attitude: Quaternion
    """Body to NED."""
    water_mps: complex
    """Velocity w through the water, from the thrust; north + i east."""
    powered: bool
    """Whether the propeller turns."""
    yaw_rate_radps: float
    depth_rate_mps: float


class NavSolution(NamedTuple):
    """Position and velocity over ground, and the state of the filter."""

    position_m: complex
    velocity_mps: complex
    memory: Navigation


def initial_solution(config: Config) -> Navigation:
    """Return the state at the start: position 0 without error, maximum variance of the others."""
    current, speed, dvl = _max_variances(config)
    return Navigation(covariance=NavCovariance(0.0, current, speed, dvl))


@numeric
def predict(
    position_m: complex,
    old: Navigation,
    motion: MotionInput,
    config: Config,
    dt_s: float,
    located: bool,
) -> NavSolution:
    """Advance dead reckoning by one tick.

    Parameters
    ----------
    position_m : complex
        Position after the last tick, from home, or from the start while home is
        unknown.
    old : Navigation
        State of the filter after the last tick.
    motion : MotionInput
        Attitude and motion in this tick.
    config : Config
        Parameters NAV_*.
    dt_s : float
        Time since the last tick.
    located : bool
        Whether ``correct`` follows: it needs the covariance of this tick.

    Returns
    -------
    NavSolution
        Position, velocity over ground and new state of the filter.
    """
    water = motion.water_mps
    velocity = water * (1.0 + old.speed_error + old.slip) + old.current_mps
    position_m += velocity * dt_s
    span_s, distance_m = old.span_s + dt_s, old.distance_m + water * dt_s
    if not located and span_s < UPDATE_S:
        return NavSolution(position_m, velocity, old._replace(span_s=span_s, distance_m=distance_m))
    memory = _propagate_covariance(old, span_s, distance_m, motion, config)
    if not located:
        velocity = _velocity(memory, motion) + water * memory.slip
    return NavSolution(position_m, velocity, memory)


@numeric
def correct(
    solution: NavSolution,
    motion: MotionInput,
    fix: GpsFix,
    has_ping: bool,
    ping: Dvl,
    home: Home,
    config: Config,
) -> NavSolution:
    """Apply the satellite fix and the Doppler log velocity of a tick.

    Parameters
    ----------
    solution : NavSolution
        Result of ``predict``.
    motion : MotionInput
        Attitude and motion in this tick.
    fix : GpsFix
        Record of the satellite receiver; one without a position is not used.
    has_ping : bool
        Whether a Doppler log velocity has come.
    ping : Dvl
        Doppler log velocity.
    home : Home
        Home position.
    config : Config
        Parameters NAV_*.

    Returns
    -------
    NavSolution
        Position, velocity over ground and new state of the filter.
    """
    if has_ping:
        solution = _update_dvl(solution, motion, ping, config)
    if has_fix(fix) and home.known:
        solution = _update_gnss(solution, motion, fix, home)
    memory = solution.memory
    steady = _velocity(memory, motion) + motion.water_mps * memory.slip
    return NavSolution(solution.position_m, steady, memory)


@numeric
def sd_m(memory: Navigation) -> float:
    """Return the standard deviation of the position (m) along each axis."""
    return math.sqrt(max(0.0, memory.covariance.position))


def current_sd_mps(memory: Navigation) -> float:
    """Return the standard deviation of the current (m/s) along each axis."""
    return math.sqrt(max(0.0, memory.covariance.current))


@numeric
def velocity_sd_mps(memory: Navigation, speed_mps: float, time_us: int) -> float:
    """Return the standard deviation of the velocity over ground (m/s) along each axis.

    Parameters
    ----------
    memory : Navigation
        State of the filter.
    speed_mps : float
        Speed U through the water.
    time_us : int
        Vehicle time.

    Returns
    -------
    float
        Root of P_cc + U^2 P_mm + slip^2; with a Doppler log, of P_cc (water track only) +
        DVL_SD_MPS^2 + U^2 P_kk.
    """
    covariance = memory.covariance
    if _has_dvl(memory, time_us):
        current = 0.0 if memory.over_ground else covariance.current
        log = DVL_SD_MPS * DVL_SD_MPS + speed_mps * speed_mps * covariance.dvl
        return math.sqrt(max(0.0, current + log))
    slip = memory.slip_sd_mps * memory.slip_sd_mps
    return math.sqrt(max(0.0, covariance.current + speed_mps * speed_mps * covariance.speed + slip))


def shift_home(position_m: complex, old: Home, new: Home) -> complex:
    """Return a position relative to a new home; unchanged if there was no home before."""
    if not old.known:
        return position_m
    return position_m + complex(
        *geodetic_to_offset(old.lat_deg, old.lon_deg, new.lat_deg, new.lon_deg)
    )


@numeric
def _max_variances(config: Config) -> tuple[float, float, float]:
    """Return the variances of c, m and k before any measurement, which are also their maxima."""
    current, speed, log = (
        config.current_sd_mps,
        config.speed_error_pct / 100.0,
        config.log_error_pct / 100.0,
    )
    return current * current, speed * speed, log * log


@numeric
def _propagate_covariance(
    old: Navigation, span_s: float, distance_m: complex, motion: MotionInput, config: Config
) -> Navigation:
    """Propagate the covariance over the time since its last update.

    ``p <- p + a c + b m + d k`` (see ``_jacobian``) and, with F that transition matrix::

        P <- F P F^H + Q

    P holds E[x y*] of the states in the order p, c, m, k; the names below are its upper triangle.
    Q is diagonal: position walk and slip on p, walk and shear of the current on c, compass
    deviation on k. The variances of c and k grow to their maxima only.
    """
    pp, cc, mm, kk, pc, pm, pk, cm, ck, mk = old.covariance
    max_cc, _, max_kk = _max_variances(config)
    turn_rad = abs(motion.yaw_rate_radps) * span_s
    depth_change_m = abs(motion.depth_rate_mps) * span_s
    slip_sd = _slip_sd_mps(old, span_s, distance_m, motion)
    has_dvl = _has_dvl(old, motion.time_us)
    slip_walk = 0.0 if has_dvl else slip_sd * slip_sd * SLIP_CORRELATION_S
    a, b, d = _jacobian(old, span_s, distance_m, has_dvl)
    cross = (
        a * pc
        + b.conjugate() * pm
        + d.conjugate() * pk
        + a * (b.conjugate() * cm + d.conjugate() * ck)
    )
    cross += b * d.conjugate() * mk
    direct = a * a * cc + _square(b) * mm + _square(d) * kk
    covariance = NavCovariance(
        pp + direct + 2.0 * cross.real + (POSITION_WALK_M2PS + slip_walk) * span_s,
        max(
            cc,
            min(
                max_cc,
                cc
                + config.current_walk_mps * config.current_walk_mps / 60.0 * span_s
                + SHEAR_MPS2 * depth_change_m,
            ),
        ),
        mm,
        max(kk, min(max_kk, kk + TURN_LOG * turn_rad)),
        pc + a * cc + b * cm.conjugate() + d * ck.conjugate(),
        pm + a * cm + b * mm + d * mk.conjugate(),
        pk + a * ck + b * mk + d * kk,
        cm,
        ck,
        mk,
    )
    slip = old.slip if has_dvl else old.slip * (1.0 - span_s / SLIP_FADES_S)
    return old._replace(
        slip=slip, slip_sd_mps=slip_sd, covariance=covariance, span_s=0.0, distance_m=0j
    )


@numeric
def _square(value: complex) -> float:
    """Return the squared modulus."""
    modulus = abs(value)
    return modulus * modulus


@numeric
def _has_dvl(memory: Navigation, time_us: int) -> bool:
    """Return whether a Doppler log velocity was used within DVL_TIMEOUT_US."""
    return 0 <= memory.ping_us >= time_us - DVL_TIMEOUT_US


@numeric
def _jacobian(
    memory: Navigation, span_s: float, distance_m: complex, has_dvl: bool
) -> tuple[float, complex, complex]:
    """Return a, b and d: derivatives of the position change by c, m and k.

    With D = integral of w dt over the span T::

        no Doppler log   a = T   b = D   d = 0
        water track      a = T   b = 0   d = -D
        bottom track     a = 0   b = 0   d = -(D + c T)

    With a Doppler log the position change is the measured one, divided by 1 + k: m cancels.
    """
    if not has_dvl:
        return span_s, distance_m, 0j
    if not memory.over_ground:
        return span_s, 0j, -distance_m
    return 0.0, 0j, -(distance_m + memory.current_mps * span_s)


@numeric
def _slip_sd_mps(old: Navigation, span_s: float, distance_m: complex, motion: MotionInput) -> float:
    """Return the standard deviation of the unmodelled speed: sideslip, acceleration, coasting.

    With T the span, D = integral of w dt, r the yaw rate, and the constants of this module, it is
    the largest of::

        sd (1 - T / SLIP_FADES_S)            the last one, decayed
        SLIP_M |r|                           sideslip in a turn
        SLIP_S 2 ||w| - |D| / T| / T         change of speed
        UNPOWERED_FACTOR |w|                 without thrust only
    """
    if span_s <= 0.0:
        return old.slip_sd_mps
    acceleration = 2.0 * abs(abs(motion.water_mps) - abs(distance_m) / span_s) / span_s
    decayed = old.slip_sd_mps * (1.0 - min(1.0, span_s / SLIP_FADES_S))
    coasting = 0.0 if motion.powered else UNPOWERED_FACTOR * abs(motion.water_mps)
    return max(decayed, SLIP_M * abs(motion.yaw_rate_radps), SLIP_S * acceleration, coasting)


@numeric
def _update_gnss(
    solution: NavSolution, motion: MotionInput, fix: GpsFix, home: Home
) -> NavSolution:
    """Update by a satellite fix: first by its position, then by its velocity.

    With z the measured position, v the velocity over ground, L the latency of the fix and
    H = d(prediction) / d(p, c, m, k)::

        position   e = z + v L - p               H = (1, 0, 0, 0)
        velocity   e = v_fix - (w (1 + m) + c)   H = (0, 1, w, 0)

    The first fix sets the position. After too many rejections the variance of p grows by |e|^2.
    """
    memory, now_us = solution.memory, motion.time_us
    latency_s = _latency_s(fix.time_us, now_us)
    north_m, east_m = geodetic_to_offset(fix.lat_deg, fix.lon_deg, home.lat_deg, home.lon_deg)
    measured = complex(north_m, east_m) + solution.velocity_mps * latency_s
    sd = DEFAULT_GNSS_SD_M if math.isnan(fix.eph_m) else max(MIN_GNSS_SD_M, fix.eph_m)
    if memory.fix_us < 0:
        covariance = memory.covariance._replace(
            position=sd * sd, position_current=0j, position_speed=0j, position_dvl=0j
        )
        memory = memory._replace(covariance=covariance, fix_us=now_us)
        return NavSolution(measured, solution.velocity_mps, memory)
    scale = _correlation_scale(GNSS_CORRELATION_S, now_us - memory.fix_us)
    error = measured - solution.position_m
    if _rejected(_POSITION_ROW, error, sd * sd, memory.covariance):
        if memory.fixes_rejected < MAX_CONSECUTIVE_REJECTIONS:
            memory = memory._replace(fixes_rejected=memory.fixes_rejected + 1)
            return solution._replace(memory=memory)
        variance = memory.covariance.position + _square(error)
        memory = memory._replace(covariance=memory.covariance._replace(position=variance))
    solution = _kalman_update(
        solution._replace(memory=memory), _POSITION_ROW, error, sd * sd * scale
    )
    velocity_error = complex(fix.velocity_north_mps, fix.velocity_east_mps) - _velocity(
        solution.memory, motion
    )
    slip_variance = memory.slip_sd_mps * memory.slip_sd_mps
    variance = (GNSS_VELOCITY_SD_MPS * GNSS_VELOCITY_SD_MPS + slip_variance) * scale
    row = (0j, 1.0 + 0j, motion.water_mps, 0j)
    solution = _kalman_update(solution, row, velocity_error, variance)
    return solution._replace(memory=solution.memory._replace(fix_us=now_us, fixes_rejected=0))


@numeric
def _update_dvl(
    solution: NavSolution, motion: MotionInput, ping: Dvl, config: Config
) -> NavSolution:
    """Update by a Doppler log velocity, bottom track or water track.

    With v the measured velocity, rotated to north-east and back over its latency L by exp(-i r L),
    r the yaw rate, and u = w (1 + m) + c for the bottom or w (1 + m) for the water::

        e = v - u (1 + k)       H = (0, 1 or 0, w, u)

    After the update the slip s takes a part of the residual::

        s <- s + SLIP_SHARE ((v / (1 + k) - u) / w - s)

    After too many rejections the variances of c and m are reset.
    """
    memory, now_us = solution.memory, motion.time_us
    body = ping.velocity_x_mps, ping.velocity_y_mps, ping.velocity_z_mps
    north, east, _ = rotate(motion.attitude, body)
    turned_rad = motion.yaw_rate_radps * _latency_s(ping.time_us, now_us)
    measured = complex(north, east) * complex(math.cos(turned_rad), -math.sin(turned_rad))
    water = motion.water_mps
    predicted = (
        _velocity(memory, motion) if ping.over_ground else water * (1.0 + memory.speed_error)
    )
    row = (0j, complex(1.0 if ping.over_ground else 0.0, 0.0), water, predicted)
    sd_mps = max(DVL_SD_MPS, ping.figure_of_merit_mps)
    variance = sd_mps * sd_mps + memory.slip_sd_mps * memory.slip_sd_mps
    error = measured - predicted * (1.0 + memory.dvl_error)
    if _rejected(row, error, variance, memory.covariance):
        if memory.pings_rejected < MAX_CONSECUTIVE_REJECTIONS:
            memory = memory._replace(pings_rejected=memory.pings_rejected + 1)
            return solution._replace(memory=memory)
        current, speed_error, _ = _max_variances(config)
        reset = memory.covariance._replace(current=current + _square(error), speed=speed_error)
        memory = memory._replace(covariance=reset)
    scale = _correlation_scale(DVL_CORRELATION_S, now_us - memory.ping_us)
    solution = _kalman_update(solution._replace(memory=memory), row, error, variance * scale)
    memory = solution.memory._replace(
        ping_us=now_us, pings_rejected=0, over_ground=ping.over_ground
    )
    if abs(water) < MIN_WATER_SPEED_MPS:
        return solution._replace(memory=memory)
    residual = measured / (1.0 + memory.dvl_error) - water * (1.0 + memory.speed_error)
    residual -= memory.current_mps if ping.over_ground else 0j
    slip = memory.slip + SLIP_SHARE * (residual / water - memory.slip)
    return solution._replace(memory=memory._replace(slip=slip))


@numeric
def _velocity(memory: Navigation, motion: MotionInput) -> complex:
    """Return the velocity over ground in steady motion: w (1 + m) + c."""
    return motion.water_mps * (1.0 + memory.speed_error) + memory.current_mps


@numeric
def _latency_s(time_us: int, now_us: int) -> float:
    """Return the age of a measurement; 0 if it is not plausible."""
    latency_s = (now_us - time_us) / US_PER_S
    return latency_s if 0.0 <= latency_s <= MAX_LATENCY_S else 0.0


@numeric
def _correlation_scale(correlation_s: float, since_us: int) -> float:
    """Return the factor of the variance for the correlation with the last measurement."""
    return max(1.0, correlation_s * US_PER_S / max(1, since_us))


@numeric
def _cross_covariance(row: Row, covariance: NavCovariance) -> tuple[Row, float]:
    """Return P H^H and H P H^H."""
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


@numeric
def _rejected(row: Row, error: complex, variance: float, covariance: NavCovariance) -> bool:
    """Return whether an innovation is outside the gate: |e|^2 > gate^2 (H P H^H + R)."""
    _, predicted_variance = _cross_covariance(row, covariance)
    gate = INNOVATION_GATE_SD * INNOVATION_GATE_SD
    return _square(error) > gate * (predicted_variance + variance)


@numeric
def _kalman_update(solution: NavSolution, row: Row, error: complex, variance: float) -> NavSolution:
    """Apply the Kalman update by one measurement with innovation e = ``error``, R = ``variance``.

    ::

        S = H P H^H + R    K = P H^H / S    x <- x + K e    P <- P - (P H^H) (P H^H)^H / S

    Schreier and Scharf 2010, chapter 5. p, c, m, k below are the elements of P H^H.
    """
    memory = solution.memory
    pp, cc, mm, kk, pc, pm, pk, cm, ck, mk = memory.covariance
    (p, c, m, k), predicted_variance = _cross_covariance(row, memory.covariance)
    inverse = 1.0 / (predicted_variance + variance)
    step = error * inverse
    wc, wm, wk = c.conjugate() * inverse, m.conjugate() * inverse, k.conjugate() * inverse
    covariance = NavCovariance(
        pp - _square(p) * inverse,
        cc - _square(c) * inverse,
        mm - _square(m) * inverse,
        kk - _square(k) * inverse,
        pc - p * wc,
        pm - p * wm,
        pk - p * wk,
        cm - c * wm,
        ck - c * wk,
        mk - m * wk,
    )
    updated = memory._replace(
        current_mps=memory.current_mps + c * step,
        speed_error=memory.speed_error + m * step,
        dvl_error=memory.dvl_error + k * step,
        covariance=covariance,
    )
    return solution._replace(position_m=solution.position_m + p * step, memory=updated)
