"""Checks of the backend options of the command line."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.backends import factory
from sitl.backends.factory import BackendError, BackendOptions
from sitl.backends.servo_outputs import OutputsError, controls_from_outputs, parse


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (BackendOptions("px5"), "--autopilot px5: expected caribou, px4, ardupilot"),
        (BackendOptions("px4", wait_for_arm=True), "--wait-for-arm: only with --autopilot caribou"),
        (BackendOptions("caribou", rate_hz=250), "--rate: only with --autopilot px4"),
        (BackendOptions("ardupilot", barometer="water"), "--hil-baro: only with --autopilot px4"),
        (
            BackendOptions("caribou", outputs="1,2,3"),
            "--outputs: only with --autopilot px4 or ardupilot",
        ),
        (BackendOptions("px4", rate_hz=1201), "--rate 1201: expected 50 to 1200 Hz"),
        (BackendOptions("px4", rate_hz=0), "--rate 0: expected"),
        (BackendOptions("px4", rate_hz=10), "--rate 10: expected"),
        (
            BackendOptions("px4", position="stars"),
            "--hil-position stars: expected sensors, gps, vision",
        ),
        (
            BackendOptions("px4", barometer="mercury"),
            "--hil-baro mercury: expected water or air_equivalent",
        ),
    ],
)
def test_check_options_error_names_valid_values(options: BackendOptions, message: str) -> None:
    with pytest.raises(BackendError, match=message):
        factory.check_options(options)


@pytest.mark.parametrize(
    "text",
    ["", "1,2", "1,2,3,4", "1,1,2", "1,-1,2", "0,1,2", "1,2,17", "a,b,c", "1,2,--3", "1.0,2,3"],
)
def test_parse_outputs_rejects_invalid_text(text: str) -> None:
    with pytest.raises(OutputsError, match="expected the outputs of rudder, elevator and thrust"):
        parse(text)


@given(st.permutations(range(16)), st.tuples(*[st.sampled_from([-1.0, 1.0])] * 3))
def test_controls_from_outputs_follow_assignment(
    places: list[int], signs: tuple[float, float, float]
) -> None:
    chosen = places[:3]
    text = ",".join(
        f"{'-' if sign < 0 else ''}{place + 1}" for place, sign in zip(chosen, signs, strict=True)
    )
    values = [0.01 * (place + 1) for place in range(16)]
    assert controls_from_outputs(parse(text), values) == tuple(
        sign * values[place] for place, sign in zip(chosen, signs, strict=True)
    )
