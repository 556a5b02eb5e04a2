"""What the command line may ask of whom."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.backends import factory
from sitl.backends.factory import BackendError, BackendOptions
from sitl.backends.servo_outputs import OutputsError, controls_from_outputs, parse


@pytest.mark.parametrize(
    ("asked", "complaint"),
    [
        (BackendOptions("px5"), "--autopilot px5: expected caribou, px4, ardupilot"),
        (BackendOptions("px4", wait_for_arm=True), "--wait-for-arm: only with --autopilot caribou"),
        (BackendOptions("caribou", rate_hz=250), "--rate: only with --autopilot px4"),
        (BackendOptions("ardupilot", barometer="water"), "--hil-baro: only with --autopilot px4"),
        (
            BackendOptions("caribou", outputs="1,2,3"),
            "--outputs: only with --autopilot px4 or ardupilot",
        ),
        (BackendOptions("px4", rate_hz=300), "--rate 300: expected steps of whole microseconds"),
        (BackendOptions("px4", rate_hz=0), "--rate 0: expected"),
        (BackendOptions("px4", rate_hz=10), "--rate 10: expected"),
        (
            BackendOptions("px4", barometer="mercury"),
            "--hil-baro mercury: expected water or air_equivalent",
        ),
    ],
)
def test_what_cannot_be_had_is_named_with_what_can(asked: BackendOptions, complaint: str) -> None:
    with pytest.raises(BackendError, match=complaint):
        factory.check_options(asked)


@pytest.mark.parametrize(
    "text",
    ["", "1,2", "1,2,3,4", "1,1,2", "1,-1,2", "0,1,2", "1,2,17", "a,b,c", "1,2,--3", "1.0,2,3"],
)
def test_outputs_that_are_not_three_different_ones_are_refused(text: str) -> None:
    with pytest.raises(OutputsError, match="expected the outputs of rudder, elevator and thrust"):
        parse(text)


@given(st.permutations(range(16)), st.tuples(*[st.sampled_from([-1.0, 1.0])] * 3))
def test_each_output_goes_where_it_is_sent(
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
