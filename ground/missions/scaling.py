"""Missions of another vehicle than Caribou: sizes, frequencies and durations scaled to it."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import msgspec
from msgspec.structs import replace

from ground.missions.script import MissionStep, Script
from ground.missions.signals import MAX_HZ, TestSignal

MIN_SIZE_DEG = 0.5
"""Smallest size of a test (deg)."""
MIN_STEP_S, MAX_STEP_S = 5.0, 120.0
"""Shortest and longest step (s); screening rejects tests of less than 3 s."""
MIN_PULSES_S = 7.0
"""Shortest doublet or 3-2-1-1 (s)."""
DESCENT_THRUST_PCT = 100.0
"""Thrust of the descent of a vehicle that does not leave the surface at the thrust of its legs."""


class AxisScaling(NamedTuple):
    """Scaling of the tests of one surface."""

    step_size: float
    """Factor on the size of steps."""
    sweep_size: float
    """Factor on the size of all other signals."""
    frequency: float
    """Factor on frequencies."""
    max_size_deg: float
    """Largest size (deg)."""
    loop_on: bool = False
    """Whether the tests keep the loop on."""


class MissionScaling(NamedTuple):
    """Scaling of a mission."""

    thrust_pct: float
    """Thrust that replaces the one of the mission (%)."""
    time: float
    """Factor on the durations of steps."""
    leg: float
    """Factor on the durations of legs, at least 1."""
    min_depth_m: float
    """Smallest depth of a leg (m)."""
    axes: Mapping[str, AxisScaling]
    """Scaling by surface: rudder and elevator."""


def scale_script(script: Script, scaling: MissionScaling) -> Script:
    """Return a mission for another vehicle.

    Parameters
    ----------
    script : Script
        Mission made for Caribou.
    scaling : MissionScaling
        Ratios of the vehicle to Caribou.

    Returns
    -------
    Script
        Mission with the same steps. Legs are never shorter, so that the vehicle settles. The test
        of both surfaces, or of the thrust, keeps its size.
    """
    return replace(script, step=tuple(_scale_step(step, scaling) for step in script.step))


def scale_tests(
    script: Script, factors: Mapping[int, float], max_deg: Mapping[str, float]
) -> Script:
    """Return a mission with the sizes of some tests changed.

    Parameters
    ----------
    script : Script
        Mission.
    factors : Mapping
        Factor on the size by number of the test, from 0.
    max_deg : Mapping
        Largest size by surface (deg).
    """
    numbers = iter(range(len(script.step)))

    def resize(step: MissionStep) -> MissionStep:
        """Return a step with its test resized."""
        if step.test is None:
            return step
        factor = factors.get(next(numbers), 1.0)
        if factor == 1.0 or step.test.magnitude_deg is None:
            return step
        size_deg = limited_deg(factor * step.test.magnitude_deg, max_deg[step.test.axis])
        return replace(step, test=replace(step.test, magnitude_deg=size_deg))

    return replace(script, step=tuple(map(resize, script.step)))


def lengthen_legs(script: Script, factor: float) -> Script:
    """Return a mission with legs of `factor` times the duration, in whole seconds."""

    def lengthen(step: MissionStep) -> MissionStep:
        """Return a step with a longer leg."""
        if step.duration_s is None:
            return step
        return replace(step, duration_s=float(round(factor * step.duration_s)))

    return replace(script, step=tuple(map(lengthen, script.step)))


def descend_at_full_thrust(script: Script) -> Script:
    """Return a mission that first dives to the depth of its first leg at full thrust.

    Parameters
    ----------
    script : Script
        Mission whose first step is a leg with a heading.

    Returns
    -------
    Script
        The same steps after one that ends when the depth is reached.
    """
    first = script.step[0]
    descent = MissionStep(
        depth_m=first.depth_m,
        heading_deg=first.heading_deg,
        thrust_pct=DESCENT_THRUST_PCT,
        duration_s=0.0,
        wait_depth=True,
    )
    return replace(script, step=(descent, *script.step))


def descends_at_full_thrust(script: Script) -> bool:
    """Return whether a mission is one of `descend_at_full_thrust`."""
    first = script.step[0]
    return bool(first.wait_depth) and first.thrust_pct == DESCENT_THRUST_PCT


def limited_deg(size_deg: float, max_deg: float) -> float:
    """Return a size between `MIN_SIZE_DEG` and `max_deg`, with its sign, to a tenth of a degree."""
    size = min(max(abs(size_deg), MIN_SIZE_DEG), int(10.0 * max_deg) / 10.0)
    return round(size if size_deg > 0.0 else -size, 1)


def encode(script: Script) -> str:
    """Return a mission as TOML, which `script.parse` reads."""
    lines = [f"name = {_literal(script.name)}", f"about = {_literal(script.about)}"]
    for step in script.step:
        lines += ["", "[[step]]", *(f"{key} = {_literal(value)}" for key, value in _keys(step))]
    return "\n".join(lines) + "\n"


def _scale_step(step: MissionStep, scaling: MissionScaling) -> MissionStep:
    """Return a step for another vehicle."""
    if step.test is not None:
        return replace(step, test=_scale_test(step.test, scaling))
    changes: dict[str, float] = {}
    if step.thrust_pct is not None:
        changes["thrust_pct"] = scaling.thrust_pct
    if step.depth_m is not None:
        changes["depth_m"] = round(max(step.depth_m, scaling.min_depth_m), 2)
    if step.duration_s is not None:
        changes["duration_s"] = float(round(scaling.leg * step.duration_s))
    return replace(step, **changes)


def _scale_test(test: TestSignal, scaling: MissionScaling) -> TestSignal:
    """Return a test for another vehicle."""
    axis = scaling.axes.get(test.axis)
    if axis is None or test.magnitude_deg is None:
        return test
    is_step = test.signal == "step"
    size = axis.step_size if is_step else axis.sweep_size
    return replace(
        test,
        loop_on=test.loop_on or axis.loop_on,
        magnitude_deg=limited_deg(size * test.magnitude_deg, axis.max_size_deg),
        duration_s=_duration_s(test, scaling.time, axis.frequency),
        f_start_hz=round(min(MAX_HZ, axis.frequency * test.f_start_hz), 3),
        f_stop_hz=round(min(MAX_HZ, axis.frequency * test.f_stop_hz), 3),
    )


def _duration_s(test: TestSignal, time: float, frequency: float) -> int:
    """Return the duration of a test, in whole seconds.

    A sweep of a faster vehicle keeps its duration: more periods give a smaller variance.
    """
    if test.signal == "step":
        return round(min(MAX_STEP_S, max(MIN_STEP_S, time * test.duration_s)))
    if test.signal in ("doublet", "3211"):
        return round(max(min(MIN_PULSES_S, test.duration_s), test.duration_s / frequency))
    return round(test.duration_s / min(1.0, frequency))


def _keys(table: msgspec.Struct) -> list[tuple[str, Any]]:
    """Return the keys of a table that differ from their defaults."""
    return [
        (field.name, value)
        for field in msgspec.structs.fields(table)
        if (value := getattr(table, field.name)) != field.default
    ]


def _literal(value: Any) -> str:
    """Return a TOML literal."""
    if isinstance(value, msgspec.Struct):
        return "{ " + ", ".join(f"{key} = {_literal(v)}" for key, v in _keys(value)) + " }"
    if isinstance(value, tuple):
        return "[" + ", ".join(map(_literal, value)) + "]"
    return msgspec.json.encode(value).decode()
