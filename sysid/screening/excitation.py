"""Screening rules for the command of a test: does it excite the plane, and is it feedback only.

Symbols: u command of the surface, chi angle and x rate of its plane (in pitch also depth z), tau a
time shift. A controller without test signal gives::

    u(t) = k_1 chi(t - tau) + k_2 x(t - tau) + k_3 int chi ds (+ k_4 z + k_5 int z ds) + k_0

with a small tau >= 0, because it acts on what it has measured. An open-loop command is explained
best by *later* motion (tau < 0), which it causes. All signals are averaged over SMOOTHING_S.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sysid.data.runs import RATE_HZ, Run
from sysid.planes import PLANES, Plane
from sysid.screening.control_effect import control_effect, static_gain
from sysid.signal_processing import moving_mean

Array = NDArray[np.float64]

NO_EXCITATION = "no excitation"
"""Rule of a reason."""
MIN_DEFLECTION_DEG = 0.1
"""Largest deflection from the mean before the test below which a surface counts as held."""
MIN_DEFLECTION_RAD = math.radians(1.0)
"""Smallest deflection that may be a test in rad, taken for degrees."""
SWAPPED_RATIO, SWAPPED_DEG = 5.0, 1.0
"""Deflection of the other surface, over that of the tested one and absolute, at which the two
outputs are named as swapped."""
MIN_SIGNIFICANCE = 3.0
"""Effect of a surface on its plane, in standard deviations, below which a plane is not excited."""
SMOOTHING_S = 0.5
"""Averaging time, which reduces sensor noise."""
MAX_SHIFT_S, SHIFT_STEP_S = 1.0, 0.1
"""Largest time shift that is tried, and the step."""
MAX_FEEDBACK_LAG_S, MIN_LEAD_S = 0.6, 0.3
"""Largest lag of a controller, and smallest lead that counts as a response to the command."""
MIN_FEEDBACK_SHARE = 0.95
"""Share of the command's variance that feedback explains in closed-loop data."""
MAX_UNEXPLAINED_RATIO = 0.7
"""Largest ratio of the variances that feedback and response leave unexplained.

Simulated closed-loop data of four vehicles: 0.08 to 0.7; tests, with the loop open or closed: above
0.79.
"""
MAX_TONE_SHARE = 0.996
"""Share of the command's power in one tone from which on cause and effect are not distinguishable.
"""
LEVELS, LEVEL_WIDTH, MIN_LEVEL_SHARE = 5, 0.01, 0.9
"""Number and width (fraction of the range) of the levels of a step, doublet or 3-2-1-1, and the
least share of the command on them. Feedback of a noisy motion stays on no level: of 30 s of course
keeping the five fullest levels have 0.1 to 0.2."""
MIN_SPREAD_RAD = math.radians(0.02)
"""Standard deviation of the command below which nothing is compared."""


def no_deflection(run: Run) -> str:
    """Reject a run whose tested surface was held, or has no output."""
    if run.plane == Plane.PITCH and not run.has_elevator:
        return (
            f"{NO_EXCITATION}: no output has the function of an elevator (SERVOn_FUNCTION = 19,"
            " or PX4's CA_SV_CSk_TYPE); set it, or give the outputs of rudder, elevator and thrust"
            " with --servo-channels"
        )
    own_deg, other_deg = (_deflection_deg(run, plane) for plane in (run.plane, _other(run.plane)))
    if own_deg >= MIN_DEFLECTION_DEG:
        return ""
    surface, other = PLANES[run.plane].surface, PLANES[_other(run.plane)].surface
    reason = (
        f"{NO_EXCITATION}: the {surface} moved by {own_deg:.2f} deg, at least"
        f" {MIN_DEFLECTION_DEG:g}"
    )
    if other_deg >= max(SWAPPED_DEG, SWAPPED_RATIO * own_deg):
        reason += (
            f", and the {other} by {other_deg:.1f} deg: swapped planes or outputs, give the order"
            " with --servo-channels"
        )
    elif own_deg > MIN_DEFLECTION_RAD:
        reason += (
            f"; if these are rad, it moved by {math.degrees(own_deg):.1f} deg: name a CSV column"
            f" {surface}_rad"
        )
    return reason


def no_response(plane: Plane, runs: Sequence[Run]) -> str:
    """Return the reason if the tests of a plane move it no more than the sea does.

    Parameters
    ----------
    plane : Plane
        The plane.
    runs : sequence of Run
        Its runs.

    Returns
    -------
    str
        Reason; empty if the plane is excited, or if no run is long enough to decide.
    """
    effect = control_effect(runs, plane, plane)
    gain = static_gain(runs, plane)
    if effect is None or gain is None:
        return ""
    if max(abs(effect.significance), abs(gain.significance)) >= MIN_SIGNIFICANCE:
        return ""
    surface = PLANES[plane].surface
    measured = "which is constant"
    if math.isfinite(effect.sd):
        measured = f"effect {effect.value:.2g} +- {effect.sd:.2g} 1/s2 over the {plane} tests"
    return (
        f"{NO_EXCITATION}: the {surface} does not move the {plane} rate, {measured}; fly larger or"
        " longer tests, or check the outputs"
    )


def feedback_only(run: Run) -> str:
    """Reject a run whose command is feedback of the measured motion, without a test signal."""
    if _is_on_levels(run):
        return ""
    shares = _shares_by_shift(run)
    if shares is None:
        return ""
    shifts_s, explained = shares
    feedback = float(np.max(explained[(shifts_s > -1e-9) & (shifts_s < MAX_FEEDBACK_LAG_S + 1e-9)]))
    response = float(np.max(explained[shifts_s < -MIN_LEAD_S + 1e-9]))
    if feedback < MIN_FEEDBACK_SHARE or 1.0 - feedback > MAX_UNEXPLAINED_RATIO * (1.0 - response):
        return ""
    return (
        f"closed loop: {feedback:.0%} of the {PLANES[run.plane].surface} command is feedback of the"
        " motion, and no test signal is added; fly a test"
    )


def _other(plane: Plane) -> Plane:
    """Return the other plane."""
    return PLANES[plane].other


def _deflection_deg(run: Run, plane: Plane) -> float:
    """Return the largest deflection of a surface in the test from its mean before it, deg."""
    command = run.in_plane(plane).command_rad
    during = command[run.under_test]
    held = float(np.mean(command[run.approach])) if run.approach.any() else float(during[0])
    return math.degrees(float(np.max(np.abs(during - held))))


def _is_on_levels(run: Run) -> bool:
    """Return whether the command of the test steps between a few levels."""
    command = run.in_plane(run.plane).command_rad[run.under_test]
    counts, _ = np.histogram(command, int(1.0 / LEVEL_WIDTH))
    return bool(np.sort(counts)[-LEVELS:].sum() >= MIN_LEVEL_SHARE * command.size)


def _shares_by_shift(run: Run) -> tuple[Array, Array] | None:
    """Return time shifts (s) and the share of the command that the motion explains at each.

    None for a command that is constant, a single tone, or too short.
    """
    margin, width = int(MAX_SHIFT_S * RATE_HZ), int(SMOOTHING_S * RATE_HZ)
    first = max(int(np.searchsorted(run.time_s, 0.0)), margin)
    samples = np.arange(first, run.time_s.size - margin)
    if samples.size < 4 * margin:
        return None
    signals = run.in_plane(run.plane)
    command = moving_mean(signals.command_rad, width)[samples]
    command = command - np.mean(command)
    if np.std(command) < MIN_SPREAD_RAD or _tone_share(command) > MAX_TONE_SHARE:
        return None
    angle = moving_mean(signals.angle_rad, width)
    angle = angle - np.mean(angle[samples])
    columns = [angle, moving_mean(signals.rate_radps, width), np.cumsum(angle) / RATE_HZ]
    if PLANES[run.plane].has_depth:
        depth = moving_mean(run.depth_m, width)
        depth = depth - np.mean(depth[samples])
        columns += [depth, np.cumsum(depth) / RATE_HZ]
    steps = np.arange(-margin, margin + 1, int(SHIFT_STEP_S * RATE_HZ))
    explained = [_explained_share(command, columns, samples - step) for step in steps]
    return steps / RATE_HZ, np.array(explained)


def _explained_share(command: Array, columns: Sequence[Array], samples: NDArray[np.intp]) -> float:
    """Return the share of a command that columns at ``samples`` explain, by least squares."""
    terms = np.stack([*(column[samples] for column in columns), np.ones(samples.size)], axis=1)
    norms = np.linalg.norm(terms, axis=0)
    basis, _ = np.linalg.qr(terms[:, norms > 0.0] / norms[norms > 0.0])
    left = command - basis @ (basis.T @ command)
    return 1.0 - float(left @ left) / float(command @ command)


def _tone_share(command: Array) -> float:
    """Return the share of the power in the strongest tone (five bins of a Hann window)."""
    power = np.abs(np.fft.rfft(command * np.hanning(command.size))) ** 2
    peak = int(np.argmax(power))
    return float(np.sum(power[max(peak - 2, 0) : peak + 3]) / np.sum(power))
