"""The loops as python-control state spaces: for export, and as a check of the margins.

The block diagram is assembled here by python-control from the linear plane, the tailcone, the
filters of the commands and the gains, without the matrices of `loop_transfer`, so that its margins
are a second computation.
"""

import math
from typing import Any, NamedTuple

import control
import numpy as np
from numpy.typing import NDArray

from mavlink_io.errors import ErrorCode, OperationError
from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import GRID_RADPS, Gains, Lag, Margins
from sysid.control_analysis.margins import Planes
from sysid.models.linear_planes import LinearPlane, without_depth
from sysid.planes import Plane

Array = NDArray[np.float64]

PADE_ORDER = 6
"""Order of the Pade delay: below 1e-6 rad off at crossover."""
FINE_POINTS = 1500
"""Number of frequencies of the check, over the band of `GRID_RADPS`."""
MAX_DIFFERENCE = Margins(gm_db=0.1, pm_deg=0.5, max_sensitivity=0.01, crossover_radps=0.01)
"""Largest difference of two computations of a margin; of sensitivity and crossover as a share."""


class MarginsDisagreeError(OperationError):
    """Two computations of a stability margin differ."""

    code = ErrorCode.MARGINS_DISAGREE


class LoopSystem(NamedTuple):
    """A loop as a state space x' = A x + B u, y = C x + D u; the delay is a Pade approximation."""

    A: Array
    B: Array
    C: Array
    D: Array
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    delay_s: float
    """Delay (s) that the state space approximates."""


def open_loops(
    planes: Planes, lags: tuple[Lag, Lag], gains: Gains, order: int = PADE_ORDER
) -> dict[str, LoopSystem]:
    """Return the open loop L at each cut; the closed loop is L / (1 + L).

    Parameters
    ----------
    planes : Planes
        Linear planes, FRD axes.
    lags : tuple of Lag
        Tailcone of the yaw and of the pitch plane, with the delay of sampling.
    gains : Gains
        Parameters of the loops by name.
    order : int
        Order of the Pade delay.

    Returns
    -------
    dict
        One input and one output each, by cut: rudder, heading, elevator, depth, pitch.
    """
    yaw, pitch = (plant(plane, lag, gains, order) for plane, lag in zip(planes, lags, strict=True))
    heading, depth = _heading_controller(gains), _depth_controller(gains)
    error = control.summing_junction(inputs=["-psi"], output="heading_error")
    to_rudder, to_elevator = named(yaw, "rudder_command"), named(pitch, "elevator_command")
    attitude = named(plant(without_depth(planes[1]), lags[1], gains, order), "elevator")
    tracking = _pitch_controller(gains, "pitch_demand")
    free = _pitch_controller(gains, "pitch_reference")
    cuts = {
        "rudder": (-1.0, [named(yaw, "rudder"), heading, error], "rudder", "rudder_command"),
        "heading": (1.0, [to_rudder, heading], "heading_error", "psi"),
        "elevator": (
            -1.0,
            [named(pitch, "elevator"), tracking, depth],
            "elevator",
            "elevator_command",
        ),
        "depth": (-1.0, [to_elevator, free, depth], "pitch_reference", "pitch_demand"),
        "pitch": (-1.0, [attitude, free], "elevator", "elevator_command"),
    }
    return {
        name: loop(
            sign,
            control.interconnect(parts, inputs=[cut], outputs=[output], check_unused=False),
            lags[0 if name in ("rudder", "heading") else 1].delay_s,
        )
        for name, (sign, parts, cut, output) in cuts.items()
    }


def plants(planes: Planes, lags: tuple[Lag, Lag], gains: Gains) -> dict[str, LoopSystem]:
    """Return each plane from command to measured motion, with filters, delay and tailcone.

    Parameters
    ----------
    planes : Planes
        Linear planes, FRD axes.
    lags : tuple of Lag
        Tailcone of the yaw and of the pitch plane, with the delay of sampling.
    gains : Gains
        Parameters of the loops by name; those of actuator lead and peak filters are used.

    Returns
    -------
    dict
        By plane, "yaw" and "pitch"; angles in rad, depth in m.
    """
    return {
        name: record_of(named(plant(plane, lag, gains), command), lag.delay_s)
        for name, command, plane, lag in zip(
            ("yaw", "pitch"), ("rudder_command", "elevator_command"), planes, lags, strict=True
        )
    }


def plant(plane: LinearPlane, lag: Lag, gains: Gains, order: int = PADE_ORDER) -> Any:
    """Return the series of peak filter, actuator lead, delay, tailcone and body.

    Parameters
    ----------
    plane : LinearPlane
        Linear plane, FRD axes.
    lag : Lag
        Tailcone with the delay of sampling.
    gains : Gains
        Parameters of the filters; empty for none.
    order : int
        Order of the Pade delay.

    Returns
    -------
    control.StateSpace
        Outputs r, psi in yaw; q, theta, depth and depth rate in pitch, or q, theta without depth.
    """
    outputs, names = np.eye(len(plane.B))[1:], list(plane.states[1:])
    if "depth" in plane.states:
        outputs, names = np.vstack([outputs, plane.A[3]]), [*names, "depth_rate"]
    body = control.ss(plane.A, plane.B[:, None], outputs, np.zeros((len(names), 1)))
    wn, zeta = lag.natural_frequency_radps, lag.damping_ratio
    duct = control.tf2ss(control.tf([wn**2], [1.0, 2.0 * zeta * wn, wn**2]))
    delay = control.tf2ss(control.tf(*control.pade(lag.delay_s, order)))
    parts = [delay, duct, body]
    peak, lead = loop_transfer.command_filters(
        Plane.PITCH if "theta" in plane.states else Plane.YAW, gains
    )
    if lead is not None:
        w, wl = lead.lag_radps, lead.lead_radps
        cancelled = [1.0 / w**2, 2.0 * lead.lag_damping / w, 1.0]
        faster = [1.0 / wl**2, 2.0 * lead.lead_damping / wl, 1.0]
        parts.insert(0, control.tf2ss(control.tf(cancelled, faster)))
    if peak is not None:
        w, narrow = peak.frequency_radps, 2.0 * peak.damping * peak.frequency_radps
        shape = control.tf([1.0, peak.gain * narrow, w * w], [1.0, narrow, w * w])
        parts.insert(0, control.tf2ss(shape))
    return control.ss(control.series(*parts), inputs=["command"], outputs=names)


def named(system: Any, command: str) -> Any:
    """Return a plant with this name of its input.

    Parameters
    ----------
    system : control.StateSpace
        Result of `plant`.
    command : str
        Name of the input.

    Returns
    -------
    control.StateSpace
        The same system.
    """
    return control.ss(system, inputs=[command], outputs=list(system.output_labels))


def _heading_controller(gains: Gains) -> Any:
    """Return u = P e + I int e - D r."""
    return _controller(
        gains["HDG_I"],
        {"heading_error": (1.0, gains["HDG_P"]), "r": (0.0, -gains["HDG_D"])},
        "rudder_command",
    )


def _pitch_controller(gains: Gains, reference: str) -> Any:
    """Return u = P e + I int e - D q, with e the reference minus theta."""
    p = gains["PTCH_P"]
    return _controller(
        gains["PTCH_I"],
        {reference: (1.0, p), "theta": (-1.0, -p), "q": (0.0, -gains["PTCH_D"])},
        "elevator_command",
    )


def _depth_controller(gains: Gains) -> Any:
    """Return the pitch demand P z + I int z + D z' for a set-point of zero, z the depth."""
    return _controller(
        gains["DPT_I"],
        {"depth": (1.0, gains["DPT_P"]), "depth_rate": (0.0, gains["DPT_D"])},
        "pitch_demand",
    )


def _controller(integral: float, inputs: dict[str, tuple[float, float]], output: str) -> Any:
    """Return I int (w . x) + d . x; ``inputs`` has w and d of each entry of x.

    Without integral gain there is no state, which would be a pole at zero that no output shows.
    """
    weights = np.array([list(inputs.values())])
    states = 1 if integral else 0
    return control.ss(
        np.zeros((states, states)),
        weights[:states, :, 0],
        np.full((1, states), integral),
        weights[:, :, 1],
        inputs=list(inputs),
        outputs=[output],
    )


def loop(sign: float, system: Any, delay_s: float) -> LoopSystem:
    """Return a system with its output multiplied by a sign.

    Parameters
    ----------
    sign : float
        1 or -1.
    system : control.StateSpace
        System from the cut's input to its output.
    delay_s : float
        Delay in the system (s).

    Returns
    -------
    LoopSystem
        Open loop L.
    """
    record = record_of(system, delay_s)
    return record._replace(C=sign * record.C, D=sign * record.D)


def record_of(system: Any, delay_s: float) -> LoopSystem:
    """Return the matrices of a system.

    Parameters
    ----------
    system : control.StateSpace
        System.
    delay_s : float
        Delay in the system (s).

    Returns
    -------
    LoopSystem
        Matrices and names.
    """
    return LoopSystem(
        A=np.asarray(system.A),
        B=np.asarray(system.B),
        C=np.asarray(system.C),
        D=np.asarray(system.D),
        inputs=tuple(system.input_labels),
        outputs=tuple(system.output_labels),
        delay_s=delay_s,
    )


def margins(system: LoopSystem) -> Margins:
    """Return the margins of an open loop by python-control.

    Parameters
    ----------
    system : LoopSystem
        Open loop with one input and one output.

    Returns
    -------
    Margins
        Smallest gain margin up or down, smallest phase margin, sensitivity and crossover.
    """
    grid_radps = np.geomspace(GRID_RADPS[0], GRID_RADPS[-1], FINE_POINTS)
    response = control.frequency_response(control.ss(*system[:4]), grid_radps)
    frd = control.frd(np.asarray(response.complex), grid_radps, smooth=True)
    gm, pm, sm, _, crossovers, _ = control.stability_margins(frd, returnall=True)
    gains_db = np.abs(20.0 * np.log10(np.asarray(gm, dtype=float)))
    return Margins(
        gm_db=float(np.min(gains_db, initial=math.inf)),
        pm_deg=float(np.min(np.abs(pm), initial=math.inf)),
        max_sensitivity=1.0 / float(np.min(sm, initial=math.inf)),
        crossover_radps=float(np.max(crossovers)) if np.size(crossovers) else math.nan,
    )


class MarginsComparison(NamedTuple):
    """Margins of python-control, and where reported ones differ from them."""

    margins: dict[str, Margins]
    """Margins of python-control by cut."""
    differences: dict[str, str]
    """Differences beyond `MAX_DIFFERENCE` by cut, in words."""


def compare_margins(
    loops: dict[str, LoopSystem], reported: dict[str, Margins]
) -> MarginsComparison:
    """Compare reported margins with those of python-control.

    Parameters
    ----------
    loops : dict
        Open loops by cut, of `open_loops`.
    reported : dict
        Margins by cut.

    Returns
    -------
    MarginsComparison
        Second computation and differences. A loop close to instability has a narrow peak of
        sensitivity, which the coarser grid of `loop_transfer` may miss.
    """
    computed = {name: margins(loops[name]) for name in reported}
    differences = {
        name: text
        for name, second in computed.items()
        if (text := _difference(name, reported[name], second))
    }
    return MarginsComparison(computed, differences)


def _difference(cut: str, first: Margins, second: Margins) -> str:
    """Return the first margin that differs, in words; empty without one."""
    scales = Margins(1.0, 1.0, second.max_sensitivity, second.crossover_radps)
    for field, limit, scale in zip(Margins._fields, MAX_DIFFERENCE, scales, strict=True):
        a, b = getattr(first, field), getattr(second, field)
        same = a == b or (math.isnan(a) and math.isnan(b))
        if not (same or abs(a - b) <= limit * abs(scale)):
            return f"{field} at {cut}: {a:.4g}, python-control finds {b:.4g}"
    return ""


def check_margins(loops: dict[str, LoopSystem], reported: dict[str, Margins]) -> dict[str, Margins]:
    """Return the margins of python-control, which the reported ones must equal.

    Parameters
    ----------
    loops : dict
        Open loops by cut, of `open_loops`.
    reported : dict
        Margins by cut.

    Returns
    -------
    dict
        Margins of python-control by cut.

    Raises
    ------
    MarginsDisagreeError
        A margin differs by more than `MAX_DIFFERENCE`.
    """
    comparison = compare_margins(loops, reported)
    for text in comparison.differences.values():
        raise MarginsDisagreeError(f"{text}; report this as a fault of the software")
    return comparison.margins
