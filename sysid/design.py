"""Gains from an identified model: the smallest answer to the sea that stability, damping and travel allow."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from sysid import analysis, depth_step, loops
from sysid.analysis import Analysis, Planes, analyse, damping
from sysid.loops import GRID_RADPS, Gains, Lag, Responses
from sysid.model import IdentifiedModel, NoiseModel, digest
from sysid.planes import pitch_plane, yaw_plane
from sysid.runs import Plane
from sysid.tables import TABLE_3_INITIAL, Coefficients

Array = NDArray[np.float64]

ASSUMED_SEA = NoiseModel(0.14, 3.0, 0.28, 0.15, 0.1, 0.05, 0.1, 0.005, 0.0)
"""Disturbance assumed where a model carries none: 0.3 deg/s rms of rate from the slow part and as much from waves."""


class DesignRefused(Exception):  # noqa: N818 - a refusal is an outcome of the work, not an error in the program
    """No gains meet the specification on this model; the message says which limit fails and by how much."""


class Spec(NamedTuple):
    """What a design must meet on its own model."""

    damping: float = 0.45
    gm_db: float = 7.0
    pm_deg: float = 45.0
    """At every cut. The sea's band touches the crossover, where margin is paid for in error: with 8 dB, 55 deg, Ms 1.6
    and damping 0.6 heading and depth meet the waves worse than under the initial gains."""
    ms: float = 2.0
    slowest_radps: float = 0.03
    """Every pole of the heading loop is at least this fast: no integrator is left unfinished after two minutes."""
    slowest_depth_radps: float = 0.04
    heading_step_deg: float = 20.0
    """Set-point step whose first rudder command stays within the travel."""
    travel_deg: float = 15.0
    turn_deg: float = 0.0
    """Change of heading whose tail counts as error beside the sea's. None where a lively vehicle turns too fast for
    the integrator to run meanwhile."""
    depth_overshoot: float = 0.10
    """Share of a 3 m step, flown with the autopilot's limits."""
    depth_left: float = math.inf
    """Share of it that is still to go after 45 s."""
    pitch_rms_growth: float = 1.25
    """How much more pitch the sea may cause than under the initial gains, in exchange for depth."""


class Response(NamedTuple):
    """Predicted answer to the identified disturbance, one standard deviation."""

    heading_deg: float
    pitch_deg: float
    depth_m: float
    rudder_deg: float
    elevator_deg: float


class Design(NamedTuple):
    gains: dict[str, float]
    reasons: dict[str, str]
    analysis: Analysis
    predicted: Response
    initial: Response
    """What the gains of Table 3's initial column would let through on the same model."""
    initial_analysis: Analysis
    spec: Spec
    model_sha256: str

    def write_params(self, path: str | Path) -> None:
        """Parameter file: ``NAME,VALUE  # reason``, headed by the model that the gains rest on."""
        lines = [f"# gains designed on model {self.model_sha256}"]
        lines += [f"{name},{value:.6g}  # {self.reasons[name]}" for name, value in self.gains.items()]
        Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")


class Loads(NamedTuple):
    """Constant loads that the integrators must carry."""

    level_pitch_rad: float
    """Pitch of level flight, nose up."""
    rudder_rad: float
    """Rudder bias, as large as it may be."""
    elevator_rad: float
    """What is unsure about the elevator's trim."""


class Plant(NamedTuple):
    """A model as the designer sees it: planes, tailcone lags with sampling, and the sea."""

    planes: Planes
    yaw_lag: Lag
    pitch_lag: Lag
    sea: dict[Plane, NoiseModel]
    yaw: Responses
    pitch: Responses


def plant(model: IdentifiedModel) -> Plant:
    coefficients = Coefficients(**{name: c.value for name, c in model.coefficients.items()})
    planes = Planes(
        yaw_plane(coefficients, model.speed_mps, model.vehicle.mass_kg),
        pitch_plane(coefficients, model.speed_mps, model.vehicle.mass_kg),
    )

    def lag(plane: Plane) -> Lag:
        delay = model.planes[plane].delay_s.value + loops.SAMPLING_S
        return Lag(delay, model.vehicle.natural_frequency_radps.value, model.vehicle.damping_ratio.value)

    yaw_lag, pitch_lag = lag("yaw"), lag("pitch")
    sea: dict[Plane, NoiseModel] = {p: model.noise.get(p, ASSUMED_SEA) for p in ("yaw", "pitch")}
    return Plant(
        planes, yaw_lag, pitch_lag, sea,
        loops.responses(planes.yaw, yaw_lag), loops.responses(planes.pitch, pitch_lag),
    )  # fmt: skip


def redesign(model: IdentifiedModel, spec: Spec | None = None) -> Design:
    """Gains for the autopilot's loops from an identified model.

    Raises:
        DesignRefused: the model is not fit for it, or no gains meet the specification.
    """
    spec = spec or Spec()
    if not model.convergence.agreed:
        raise DesignRefused("the fit's starts disagree, so the model is not unique; record more tests and refit")
    vehicle = plant(model)
    gains = dict(TABLE_3_INITIAL)
    loads = constant_loads(model)
    gains |= heading_gains(vehicle, spec)
    gains |= depth_gains(vehicle, loads, spec)
    gains |= integrator_limits(loads, gains)
    initial = dict(TABLE_3_INITIAL)
    judged = judge(vehicle, gains)
    before, after = respond(vehicle, initial), respond(vehicle, gains)
    ordered = {name: gains[name] for name in TABLE_3_INITIAL}
    return Design(
        gains=ordered,
        reasons=_reasons(model, ordered, judged, before, after),
        analysis=judged,
        predicted=after,
        initial=before,
        initial_analysis=judge(vehicle, initial),
        spec=spec,
        model_sha256=digest(model),
    )


def judge(vehicle: Plant, gains: Gains) -> Analysis:
    """Poles and margins with each plane's own delay."""
    yaw = analyse(vehicle.planes, gains, vehicle.yaw_lag.delay_s, vehicle.yaw_lag)
    pitch = analyse(vehicle.planes, gains, vehicle.pitch_lag.delay_s, vehicle.pitch_lag)
    return Analysis(
        poles={**pitch.poles, "heading": yaw.poles["heading"]},
        margins={**pitch.margins, **{cut: yaw.margins[cut] for cut in ("rudder", "heading")}},
    )


def spectrum(sea: NoiseModel) -> Array:
    """Two-sided density of the disturbing angular acceleration on the grid, (rad/s^2)^2 per rad/s over 2 pi."""
    w, wave = GRID_RADPS, 2.0 * math.pi * sea.wave_frequency_hz
    slow = 2.0 * math.radians(sea.slow_accel_degps2) ** 2 * sea.slow_time_s / (1.0 + (w * sea.slow_time_s) ** 2)
    band = (wave**2 - w**2) ** 2 + (2.0 * sea.wave_damping * wave * w) ** 2
    return np.asarray(slow + 4.0 * sea.wave_damping * wave**3 * math.radians(sea.wave_accel_degps2) ** 2 / band)


def respond(vehicle: Plant, gains: Gains) -> Response:
    """Standard deviations in closed loop under the sea of the model (Parseval)."""
    heading, rudder = _heading_rms(vehicle, gains)
    pitch, depth, elevator = _depth_rms(vehicle, gains)
    return Response(math.degrees(heading), math.degrees(pitch), depth, math.degrees(rudder), math.degrees(elevator))


def _rms(transfer: NDArray[np.complex128], density: Array) -> float:
    return math.sqrt(float(np.trapezoid(np.abs(transfer) ** 2 * density, GRID_RADPS)) / math.pi)


def _heading_rms(vehicle: Plant, gains: Gains) -> tuple[float, float]:
    """(heading, rudder), rad."""
    s, density = 1j * GRID_RADPS, spectrum(vehicle.sea["yaw"])
    sensitivity = 1.0 / (1.0 + loops.heading_loops(vehicle.yaw, gains)["rudder"])
    r, psi = vehicle.yaw.moment[:, 1], vehicle.yaw.moment[:, 2]
    rudder = gains["HDG_D"] * r + (gains["HDG_P"] + gains["HDG_I"] / s) * psi
    return _rms(psi * sensitivity, density), _rms(rudder * sensitivity, density)


def _depth_rms(vehicle: Plant, gains: Gains) -> tuple[float, float, float]:
    """(pitch, depth, elevator), rad, m, rad."""
    s, density = 1j * GRID_RADPS, spectrum(vehicle.sea["pitch"])
    sensitivity = 1.0 / (1.0 + loops.depth_loops(vehicle.pitch, gains)["elevator"])
    q, theta = vehicle.pitch.moment[:, 1], vehicle.pitch.moment[:, 2]
    forward = gains["PTCH_P"] + gains["PTCH_I"] / s
    elevator = gains["PTCH_D"] * q + forward * (theta - loops.depth_law(vehicle.pitch.moment, gains))
    # Every state answers to the moment and to the elevator's reply to it.
    reply = vehicle.pitch.moment - vehicle.pitch.command * (elevator * sensitivity)[:, None]
    return _rms(reply[:, 2], density), _rms(reply[:, 3], density), _rms(elevator * sensitivity, density)


class _Search(NamedTuple):
    """One optimisation: what moves, from where, what is to be small, and what limits it."""

    names: tuple[str, ...]
    starts: Sequence[Mapping[str, float]]
    objective: Callable[[Gains], float]
    shortfalls: Callable[[Gains], dict[str, float]]
    """By limit: by how much it is missed as a share of itself; positive is a miss."""


PENALTY = 30.0
"""Cost of missing a limit by its own size, in units of the objective, which is about one."""
SLACK = 1e-3
"""A limit missed by less than this share counts as met: the optimum lies on its limits."""


STEADY_FROM_S, STEADY_TO_S = 25.0, 85.0
"""After a change of set-point: when a heading or depth is called steady, and is read."""
LOAD_RAD = math.radians(0.5)
"""Constant rudder offset that a trim flight in a rough sea leaves behind."""
DEPTH_STEP_M = 1.0
"""Depth error at which pitch comes off its limit and the loop is linear."""


def leftover(closed: loops.ClosedLoop, state: int, final: float) -> float:
    """RMS distance of a step response from where it must end, over the time in which it is called steady."""
    response = loops.step_response(closed, state, STEADY_TO_S, 0.5)
    return float(np.sqrt(np.mean((response[int(STEADY_FROM_S / 0.5) :] - final) ** 2)))


def _heading_error(vehicle: Plant, gains: Gains, turn_rad: float) -> float:
    """What a log would show as steady heading error: the sea and the tails of a trim offset and of a turn, rad rms."""
    closed = loops.close_heading(vehicle.planes.yaw, vehicle.yaw_lag, gains)
    load = np.zeros(len(closed.A))
    load[:3] = vehicle.planes.yaw.B * LOAD_RAD
    tails = [leftover(closed._replace(reference=load), 2, 0.0)]
    if turn_rad:
        tails.append(leftover(closed, 2, 1.0) * turn_rad)
    return math.hypot(_heading_rms(vehicle, gains)[0], *tails)


def _depth_error(vehicle: Plant, gains: Gains) -> float:
    """The same for depth: the sea and the tail of a depth change, m rms."""
    closed = loops.close_depth(vehicle.planes.pitch, vehicle.pitch_lag, gains)
    return math.hypot(_depth_rms(vehicle, gains)[1], leftover(closed, 3, 1.0) * DEPTH_STEP_M)


HEADING_STARTS: Sequence[Mapping[str, float]] = (
    {"HDG_P": 0.70, "HDG_D": 1.6, "HDG_I": 0.025},
    {"HDG_P": 0.45, "HDG_D": 1.2, "HDG_I": 0.02},
)
DEPTH_STARTS: Sequence[Mapping[str, float]] = (
    {"PTCH_P": 0.74, "PTCH_D": 1.5, "DPT_P": 0.19, "DPT_D": 0.2, "DPT_I": 0.006},
    {"PTCH_P": 0.55, "PTCH_D": 1.2, "DPT_P": 0.12, "DPT_D": 0.1, "DPT_I": 0.004},
)
"""Where the searches begin: gains of Caribou's order."""


def heading_gains(
    vehicle: Plant, spec: Spec, starts: Sequence[Mapping[str, float]] = HEADING_STARTS
) -> dict[str, float]:
    """Gains of the heading loop. Raises DesignRefused."""
    reference, turn_rad = _heading_rms(vehicle, TABLE_3_INITIAL)[0], math.radians(spec.turn_deg)

    def shortfalls(gains: Gains) -> dict[str, float]:
        cuts = loops.heading_loops(vehicle.yaw, gains)
        closed = loops.close_heading(vehicle.planes.yaw, vehicle.yaw_lag, gains)
        missed = _loop_shortfalls(cuts["rudder"], "rudder", spec.gm_db, spec.pm_deg, spec.ms)
        missed |= _loop_shortfalls(cuts["heading"], "heading", spec.gm_db, spec.pm_deg, spec.ms)
        missed |= _pole_shortfalls(closed, "heading", spec.damping, spec.slowest_radps)
        missed["rudder of a heading step, deg"] = gains["HDG_P"] * spec.heading_step_deg / spec.travel_deg - 1.0
        return missed

    search = _Search(tuple(starts[0]), starts, lambda g: _heading_error(vehicle, g, turn_rad) / reference, shortfalls)
    return _solve(search, spec)


def depth_gains(
    vehicle: Plant, loads: Loads, spec: Spec, starts: Sequence[Mapping[str, float]] = DEPTH_STARTS
) -> dict[str, float]:
    """Gains of the pitch and depth loops. Raises DesignRefused."""
    pitch_0, depth_0, _ = _depth_rms(vehicle, TABLE_3_INITIAL)

    def shortfalls(gains: Gains) -> dict[str, float]:
        cuts = loops.depth_loops(vehicle.pitch, gains)
        closed = loops.close_depth(vehicle.planes.pitch, vehicle.pitch_lag, gains)
        missed: dict[str, float] = {}
        for name in ("elevator", "depth"):
            missed |= _loop_shortfalls(cuts[name], name, spec.gm_db, spec.pm_deg, spec.ms)
        missed |= _pole_shortfalls(closed, "depth", spec.damping, spec.slowest_depth_radps)
        limited = {**gains, **integrator_limits(loads, gains)}
        step = depth_step.answer(vehicle.planes.pitch, vehicle.pitch_lag, limited, loads.level_pitch_rad)
        missed["overshoot of a depth step"] = step.overshoot / spec.depth_overshoot - 1.0
        missed["rest of a depth step"] = step.left / spec.depth_left - 1.0
        missed["pitch activity"] = _depth_rms(vehicle, gains)[0] / pitch_0 / spec.pitch_rms_growth - 1.0
        return missed

    search = _Search(tuple(starts[0]), starts, lambda g: _depth_error(vehicle, g) / depth_0, shortfalls)
    return _solve(search, spec)


def _loop_shortfalls(
    loop: NDArray[np.complex128], name: str, gm_db: float, pm_deg: float, ms: float
) -> dict[str, float]:
    found = loops.margins(loop)
    return {
        f"gain margin at the {name}": 1.0 - found.gm_db / gm_db,
        f"phase margin at the {name}": 1.0 - found.pm_deg / pm_deg,
        f"sensitivity at the {name}": found.ms / ms - 1.0,
    }


def _pole_shortfalls(closed: loops.ClosedLoop, name: str, least_damping: float, least_radps: float) -> dict[str, float]:
    inside = tuple(complex(p) for p in loops.poles(closed) if abs(p) < analysis.BAND_RADPS)
    slowest = -max(p.real for p in inside)
    return {
        f"damping of the {name} loop": 1.0 - damping(inside) / least_damping,
        f"slowest pole of the {name} loop": 1.0 - slowest / least_radps,
    }


def _solve(search: _Search, spec: Spec) -> dict[str, float]:
    """Nelder-Mead on the logarithms of the gains, from each start, restarted once where it ended."""

    def gains_at(logs: Array) -> dict[str, float]:
        return {**TABLE_3_INITIAL, **dict(zip(search.names, np.exp(logs).tolist(), strict=True))}

    def cost(logs: Array) -> float:
        gains = gains_at(logs)
        missed = sum(max(0.0, miss) for miss in search.shortfalls(gains).values())
        return search.objective(gains) + PENALTY * missed

    ends = []
    for start in search.starts:
        logs = np.log([start[name] for name in search.names])
        for _ in range(2):
            found = minimize(cost, logs, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-4, "maxfev": 500})
            logs = found.x
        ends.append((float(found.fun), logs))
    best = gains_at(min(ends, key=lambda end: end[0])[1])
    worst, miss = max(search.shortfalls(best).items(), key=lambda item: item[1])
    if miss > SLACK:
        raise DesignRefused(
            f"no gains meet the specification: the best found miss the {worst} by {100 * miss:.1f} % of its limit; "
            f"relax the specification {spec._asdict()} or reduce the delay"
        )
    return {name: best[name] for name in search.names}


BEYOND_BIAS_RAD = math.radians(1.0)
"""Room of the heading integrator beyond the measured rudder bias."""
LEVEL_PITCH_ROOM = 1.25
"""Depth integrator over the pitch that level flight needs: ballast changes by a fourth of the net buoyancy or so."""


def constant_loads(model: IdentifiedModel) -> Loads:
    """What a model says of them, and what is unsure about it (3 sd)."""
    yaw, pitch = model.planes["yaw"].actuator_bias_deg, model.planes["pitch"].actuator_bias_deg
    return Loads(
        level_pitch_rad=math.radians(model.vehicle.level_pitch_deg),
        rudder_rad=math.radians(abs(yaw.value) + 3.0 * (yaw.sd or 0.0)),
        elevator_rad=math.radians(3.0 * (pitch.sd or 0.0)),
    )


def integrator_limits(loads: Loads, gains: Gains) -> dict[str, float]:
    """Room for the constant loads.

    The heading integrator could carry the whole rudder bias if TRIM_RUD_DEG were lost; the depth integrator carries the
    pitch of level flight, and TRIM_ELE_DEG the elevator.
    """
    room = LEVEL_PITCH_ROOM * abs(loads.level_pitch_rad) + loads.elevator_rad / gains["PTCH_P"]
    return {
        "HDG_IMAX": min(0.25, BEYOND_BIAS_RAD + loads.rudder_rad),
        "PTCH_IMAX": 0.0,
        "DPT_IMAX": min(0.25, room),
    }


def _reasons(
    model: IdentifiedModel, gains: Gains, judged: Analysis, before: Response, after: Response
) -> dict[str, str]:
    def cut(name: str) -> str:
        m = judged.margins[name]
        return f"GM {m.gm_db:.1f} dB, PM {m.pm_deg:.0f} deg, Ms {m.ms:.2f} at the {name}"

    bias, level = model.planes["yaw"].actuator_bias_deg.value, model.vehicle.level_pitch_deg
    texts = {
        "HDG_P": f"heading {before.heading_deg:.2f} -> {after.heading_deg:.2f} deg rms predicted; {cut('rudder')}",
        "HDG_D": f"damping {damping(judged.poles['heading']):.2f}",
        "HDG_I": f"slowest pole {_slowest(judged, 'heading'):.3f} rad/s",
        "HDG_IMAX": f"the rudder bias of {bias:.1f} deg, its uncertainty and 1 deg, should the trim be lost",
        "PTCH_P": f"pitch {before.pitch_deg:.2f} -> {after.pitch_deg:.2f} deg rms predicted; {cut('elevator')}",
        "PTCH_D": f"damping {damping(judged.poles['depth']):.2f}",
        "PTCH_I": "the depth integrator carries the constant load",
        "PTCH_IMAX": "no pitch integrator",
        "DPT_P": f"depth {100 * before.depth_m:.1f} -> {100 * after.depth_m:.1f} cm rms predicted; {cut('depth')}",
        "DPT_D": "lead for the depth loop from the estimated depth rate",
        "DPT_I": f"slowest pole {_slowest(judged, 'depth'):.3f} rad/s",
        "DPT_IMAX": f"the level-flight pitch of {level:.1f} deg and a fourth, and the elevator trim's uncertainty",
    }
    return {name: texts[name] for name in gains}


def _slowest(judged: Analysis, loop: str) -> float:
    return max(pole.real for pole in judged.poles[loop])
