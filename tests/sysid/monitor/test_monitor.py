"""Monitoring: no alarm in flight as predicted, an early alarm with the right cause otherwise."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from sysid import monitor
from sysid.data.dataset import Log
from sysid.monitor import Monitor, sequential
from sysid.monitor.performance_spec import AVERAGED_S
from sysid.monitor.tracking_metrics import SETTLING_S
from sysid.monitor.windows import WindowCutter, sample
from tests.sysid.monitor import made

HOUR_S = 3600.0
BASELINE = made.baseline()


def windows(log: Log) -> list[monitor.MonitorWindow]:
    """Return the windows of a log."""
    return list(WindowCutter(BASELINE).take(sample(log, None, float(log.attitude.time_s[-1]))))


def test_monitor_flight_as_predicted_raises_no_alarm() -> None:
    report = monitor.monitor_log(made.flight(4.0 * HOUR_S, seed=1), BASELINE)
    assert report.steady_s > 3.9 * HOUR_S
    assert report.causes == ()
    assert report.detected_at_s is None
    for name, rms in report.rms.items():
        assert rms.measured == pytest.approx(rms.predicted, rel=0.1), name


def test_threshold_allowed_shift_keeps_false_alarm_rate() -> None:
    """Means at the allowed limit, where sums grow most; threshold for one alarm in 40 windows."""
    expected = BASELINE.predicted["rudder_deg"]
    rng, crossings, count, h = np.random.default_rng(3), 0, 40_000, np.log(40.0)
    allowed = sequential.MIN_SHIFT["rudder_deg"] + 2.0 * expected.mean_sd
    window = windows(made.flight(100.0, seed=1))[0]
    test = sequential.Sum()
    for departure in rng.normal(allowed, expected.mean_sd_20s, count):
        means = {**window.means, "rudder_deg": expected.mean + departure}
        test = sequential._update_sum(
            "rudder_deg", "higher", expected, test, window._replace(means=means)
        )
        if test.value > h:
            crossings, test = crossings + 1, sequential.Sum()
    assert 0 < crossings < count / 40


@pytest.mark.parametrize(
    ("moved", "cause"),
    [
        ({"rudder_deg": 3.0}, "rudder"),
        ({"rudder_deg": -3.0}, "rudder"),
        ({"elevator_deg": -2.0}, "elevator"),
        ({"pitch_deg": -1.0}, "ballast"),
        ({"pitch_deg": 1.0, "elevator_deg": 2.0}, "ballast"),
        ({"depth_m": -0.4}, "integrator"),
        ({"rudder_deg": 4.0, "heading_deg": 2.0}, "rudder"),
    ],
)
def test_monitor_shifted_mean_names_cause_in_two_minutes(
    moved: dict[str, float], cause: str
) -> None:
    report = monitor.monitor_log(made.flight(900.0, seed=2, shifts=moved, from_s=400.0), BASELINE)
    assert [likely.name for likely in report.causes] == [cause]
    assert report.detected_at_s is not None
    assert 400.0 < report.detected_at_s < 520.0
    assert report.refit_recommended == (cause != "integrator")


def test_monitor_larger_disturbance_needs_no_refit() -> None:
    report = monitor.monitor_log(made.flight(900.0, seed=2, noise_factor=2.5), BASELINE)
    assert [likely.name for likely in report.causes] == ["sea"]
    assert not report.refit_recommended


def test_monitor_slightly_larger_disturbance_is_no_alarm() -> None:
    assert (
        monitor.monitor_log(made.flight(2.0 * HOUR_S, seed=2, noise_factor=1.25), BASELINE).causes
        == ()
    )


@pytest.mark.parametrize("plane", ["heading", "pitch"])
def test_monitor_resonance_is_distinguished_from_disturbance(plane: str) -> None:
    log = made.flight(900.0, seed=2)
    t = log.attitude.time_s
    swing = np.radians(0.5) * np.sin(2.0 * t)
    column = {"heading": "yaw_rad", "pitch": "pitch_rad"}[plane]
    swinging = replace(log.attitude, **{column: getattr(log.attitude, column) + swing})
    report = monitor.monitor_log(replace(log, attitude=swinging), BASELINE)
    assert [likely.name for likely in report.causes] == [f"{plane} loop"]
    assert report.refit_recommended


@pytest.mark.parametrize("plane", ["heading", "pitch"])
def test_monitor_small_excess_near_crossover_is_no_loss_of_damping(plane: str) -> None:
    """Five times the rms near crossover, of a tenth of the variance: sensor noise, not damping."""
    name = f"{plane}_resonance_deg"
    quiet = BASELINE.predicted[name]
    rms = 0.08 / 5.0
    small = msgspec.structs.replace(quiet, rms=rms, mean_sd_20s=1e-4)
    baseline = msgspec.structs.replace(BASELINE, predicted={**BASELINE.predicted, name: small})
    report = monitor.monitor_log(made.flight(900.0, seed=2), baseline)
    assert report.rms[name].measured > 4.0 * rms
    assert [cause.name for cause in report.causes if cause.refit_recommended] == []


def test_monitor_surface_noise_is_not_disturbance() -> None:
    log = made.flight(900.0, seed=2)
    busy = replace(
        log.actuators,
        rudder_rad=np.radians(6.0) + 3.0 * (log.actuators.rudder_rad - np.radians(6.0)),
    )
    assert [c.name for c in monitor.monitor_log(replace(log, actuators=busy), BASELINE).causes] == [
        "rudder noise"
    ]


def test_monitor_piecewise_equals_whole_log() -> None:
    log = made.flight(700.0, seed=4, shifts={"rudder_deg": 3.0}, from_s=300.0)
    piecewise = Monitor(BASELINE)
    for until_s in np.arange(0.7, 701.0, 3.3):
        piecewise.take(log, min(float(until_s), 700.0))
    piecewise.take(log, 700.0)
    assert piecewise.report() == monitor.monitor_log(log, BASELINE)


def test_windows_settling_is_excluded() -> None:
    log = made.flight(400.0, seed=1)
    turned = log.setpoints.heading_rad - np.radians(2.0) * (log.setpoints.attitude_time_s > 150.0)
    cause = windows(replace(log, setpoints=replace(log.setpoints, heading_rad=turned)))
    after = [window.start_s for window in cause if window.stop_s > 150.0]
    assert min(after) == pytest.approx(150.0 + SETTLING_S, abs=0.5)
    assert all(window.stop_s - window.start_s == pytest.approx(AVERAGED_S) for window in cause)


def test_windows_identification_tests_are_excluded() -> None:
    log = made.flight(400.0, seed=1)
    told = made.event(100.0, "SystemID Starting: axis=10"), made.event(200.0, "SystemID Finished")
    cause = windows(replace(log, events=told))
    assert not [
        window
        for window in cause
        if window.stop_s > 100.0 and window.start_s < 200.0 + SETTLING_S - 0.5
    ]
    assert len([window for window in cause if window.start_s > 200.0]) >= 8


def test_windows_telemetry_gap_restarts_settling() -> None:
    log = made.flight(200.0, seed=1)
    received = (log.attitude.time_s < 100.0) | (log.attitude.time_s > 104.0)
    thin = log.attitude.__class__(*(values[received] for values in vars(log.attitude).values()))
    cause = windows(replace(log, attitude=thin))
    assert not [
        window
        for window in cause
        if window.stop_s > 101.5 and window.start_s < 104.0 + SETTLING_S - 0.5
    ]


def test_monitor_other_speed_is_ignored() -> None:
    log = made.flight(400.0, seed=1, shifts={"pitch_deg": 3.0})
    fast = replace(log.actuators, thrust=log.actuators.thrust * 1.3)
    assert monitor.monitor_log(replace(log, actuators=fast), BASELINE).windows == 0


def test_windows_near_surface_are_excluded() -> None:
    log = made.flight(400.0, seed=1)
    points = replace(log.setpoints, depth_m=np.full_like(log.setpoints.depth_m, 1.0))
    shallow = replace(log.depth, depth_m=log.depth.depth_m - 4.0)
    assert monitor.monitor_log(replace(log, setpoints=points, depth=shallow), BASELINE).windows == 0


def test_windows_transit_is_excluded() -> None:
    log = made.flight(400.0, seed=1)
    late = np.maximum(0.0, 4.5 - 0.03 * log.depth.time_s)
    cause = windows(replace(log, depth=replace(log.depth, depth_m=log.depth.depth_m - late)))
    assert cause[0].start_s > 4.0 / 0.03 + SETTLING_S - 5.0


@pytest.mark.parametrize(
    ("ratio", "text"),
    [
        (1.0, "as predicted"),
        (0.8, "as predicted"),
        (1.7, "larger than predicted, without an alarm: heading 1.7 times, depth 1.7 times and"),
        (0.5, "a calmer sea than in the tests: heading 0.5 times and depth 0.5 times the"),
    ],
)
def test_agreement_is_what_was_measured(ratio: float, text: str) -> None:
    rms = {
        name: sequential.RmsComparison(measured=ratio * 0.3, predicted=0.3)
        for name in ("heading_deg", "depth_m", "rudder_deg")
    }
    assert sequential.describe_agreement(rms, 5).startswith(text)
    assert sequential.describe_agreement({}, 0) == ""
