"""A damaged ``model.json`` is refused with key, value and expectation, or can be worked with."""

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ground.campaign import identification
from mavlink_io.errors import CaribouError
from sitl.vehicle import config
from sysid.design import design_model
from sysid.estimation.map.problem import Prior
from sysid.models import json_record, model_export, model_file, noise, parameters, prediction
from sysid.models.model_file import IdentifiedModel, ModelError
from sysid.monte_carlo import samples
from sysid.planes import Plane

Change = Callable[[Any], None]
Keys = tuple[str | int, ...]
VALUES: list[Any] = [
    float("nan"),
    float("inf"),
    -float("inf"),
    *(sign * size for sign in (1.0, -1.0) for size in (1e-300, 1e-3, 1.0, 5.0, 1e3, 1e6, 1e12)),
    *(1e300, -1e300, 0, -1, 10**400, "2", None, True, [], {}),
]


def _prior_model() -> IdentifiedModel:
    """Return a model of method ``map`` with a covariance and a disturbance."""
    bare = config.load("caribou_nominal")
    prior = Prior(
        bare,
        dict.fromkeys(Plane, 0.01),
        np.zeros(len(parameters.NAMES)),
        parameters.prior_covariance(),
    )
    model = model_export.from_paper({}, prior, "caribou_nominal")
    covariance = 0.25 * prior.covariance
    rows = tuple(tuple(row) for row in covariance.tolist())
    names = ("static_gain_per_s", "b1_per_s2")
    known = model_file.ParameterCovariance(names, ((4.0, 0.1), (0.1, 0.01)))
    return msgspec.structs.replace(
        model,
        method="map",
        joint=msgspec.structs.replace(model.joint, covariance=rows, correlation=rows),
        noise=dict.fromkeys(Plane, design_model.DEFAULT_DISTURBANCE),
        design=dict.fromkeys(Plane, known),
    )


MODEL = _prior_model()


def _numbers(value: Any, keys: Keys = ()) -> list[Keys]:
    """Return the keys of all numbers of a table."""
    entries = (
        list(value.items())
        if isinstance(value, dict)
        else list(enumerate(value))
        if isinstance(value, list)
        else []
    )
    inner = [found for name, entry in entries for found in _numbers(entry, (*keys, name))]
    return inner or ([keys] if isinstance(value, float | int) else [])


def _plain(model: IdentifiedModel) -> dict[str, Any]:
    """Return a model as tables and lists."""
    table: dict[str, Any] = json.loads(json_record.encode(model))
    return table


def _entry(table: Any, keys: Keys) -> Any:
    """Return the table or list that holds an entry."""
    for key in keys[:-1]:
        table = table[key]
    return table


NUMBERS = [
    keys
    for keys in _numbers(_plain(MODEL))
    if keys != ("format",)
    and keys[:2] != ("vehicle", "file")
    and all(not isinstance(key, int) or key < 3 for key in keys)
]
"""Keys of all numbers, with the first few of each matrix; the vehicle file has its own checks."""
METHODS = st.sampled_from(["map", "paper"])


def _write(path: Path, change: Change, model: IdentifiedModel = MODEL) -> Path:
    """Write a model with a change."""
    table = _plain(model)
    change(table)
    path.write_text(json.dumps(table))
    return path


def _set(*keys: str | int, value: Any) -> Change:
    """Return a change of one entry."""

    def change(table: dict[str, Any]) -> None:
        _entry(table, keys)[keys[-1]] = value

    return change


def _remove(*keys: str | int) -> Change:
    """Return the removal of one entry."""

    def change(table: dict[str, Any]) -> None:
        del _entry(table, keys)[keys[-1]]

    return change


def _use(path: Path) -> None:
    """Call what reads a model before the long work of a command."""
    model = model_file.read(path)
    prediction.vehicles(model)
    design_model.from_model(model)
    for _ in design_model.sample_models(model, 3):
        pass
    for _ in design_model.sample_models(model, 3, drive_known=False):
        pass
    levels = {plane: noise.from_model(level) for plane, level in model.noise.items()}
    for plane, level in noise.at_depth(levels, 3.0).items():
        linear = design_model.from_model(model).planes
        noise.build(linear[plane == Plane.PITCH], level, 0.05, 20)
    if model.method == "map":
        samples.read(path)
    identification.format_text(model, path)


def _refusal(path: Path) -> str:
    """Use a model; return the message of the error after the name of the file, or an empty text."""
    try:
        _use(path)
    except CaribouError as error:
        _, separator, message = str(error).partition(f"{path}: ")
        return message if separator else f"no file is named: {error}"
    return ""


@settings(
    max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(method=METHODS, keys=st.sampled_from(NUMBERS), value=st.sampled_from(VALUES) | st.floats())
def test_any_changed_number_is_refused_or_usable(
    tmp_path: Path, method: model_file.Method, keys: Keys, value: Any
) -> None:
    model = msgspec.structs.replace(MODEL, method=method)
    path = _write(tmp_path / "model.json", _set(*keys, value=value), model)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        refusal = _refusal(path)
    name = next(key for key in reversed(keys) if isinstance(key, str))
    assert not refusal or "308 digits" in refusal or name in refusal


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(keys=st.sampled_from(NUMBERS))
def test_any_missing_number_is_refused_or_usable(tmp_path: Path, keys: Keys) -> None:
    path = _write(tmp_path / "model.json", _remove(*keys))
    refusal = _refusal(path)
    assert (
        not refusal or str(next(key for key in reversed(keys) if isinstance(key, str))) in refusal
    )


COVARIANCE = ("joint", "covariance")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (_set("speed_mps", value=0), r"speed_mps = 0: expected float >= 0\.01"),
        (_set("speed_mps", value=-1.5), r"speed_mps = -1\.5: expected float >= 0\.01"),
        (_set("speed_mps", value=1e9), r"speed_mps = 1000000000\.0: expected float <= 50"),
        (_set("thrust_fraction", value=5), r"thrust_fraction = 5: expected float <= 1"),
        (
            _set("planes", "yaw", "b1_per_s2", "value", value=-2),
            r"planes\.yaw\.b1_per_s2\.value = -2: expected 1e-06 to 10000",
        ),
        (
            _set("planes", "yaw", "b1_per_s2", "value", value=1e300),
            r"planes\.yaw\.b1_per_s2\.value = 1e\+300: expected",
        ),
        (
            _set("planes", "yaw", "delay_s", "value", value=50),
            r"planes\.yaw\.delay_s\.value = 50: expected 0 to 10",
        ),
        (
            _set("planes", "yaw", "b1_per_s2", "sd", value=-0.1),
            r"planes\.yaw\.b1_per_s2\.sd = -0\.1: expected float >= 0",
        ),
        (
            _set("vehicle", "natural_frequency_radps", "value", value=0),
            r"vehicle\.natural_frequency_radps\.value = 0: expected 0\.01 to 10000",
        ),
        (
            _set("vehicle", "natural_frequency_radps", "value", value=-8),
            r"vehicle\.natural_frequency_radps\.value = -8: expected",
        ),
        (_set("vehicle", "mass_kg", value=-1), r"vehicle\.mass_kg = -1: expected float > 0"),
        (
            _set("noise", "yaw", "slow_accel_degps2", value=-3),
            r"noise\.yaw\.slow_accel_degps2 = -3: expected float >= 0",
        ),
        (
            _set("noise", "yaw", "slow_time_s", value=0),
            r"noise\.yaw\.slow_time_s = 0: expected float >= 0\.01",
        ),
        (_set("joint", "z", 0, value=1e6), r"joint\.z\[0\] = 1000000\.0: expected float <= 50"),
        (_set("joint", "z", 0, value=20.0), r"joint\.z\[0\] = 20: expected -10 to 10"),
        (_remove("joint", "z", 0), r"joint\.z: has 36 entries; expected 37"),
        (_set("joint", "names", 1, value="Y_v"), r"joint\.names: 'Y_v' stands twice"),
        (
            _set(*COVARIANCE, 0, 1, value=0.2),
            r"joint\.covariance\[0\]\[1\] = 0\.2: expected 0, the value of \[1\]\[0\]",
        ),
        (
            _set(*COVARIANCE, 2, 2, value=-5),
            r"joint\.covariance\[2\]\[2\] = -5: expected a variance",
        ),
        (
            _set(*COVARIANCE, 0, 0, value=1e12),
            r"joint\.covariance\[0\]\[0\] = 1000000000000\.0: expected float <= 100",
        ),
        (_set(*COVARIANCE, 0, 0, value=1e-4), r"joint\.covariance: has a negative eigenvalue"),
        (_remove(*COVARIANCE, 0), r"joint\.covariance: has 36 entries; expected 37"),
        (_remove(*COVARIANCE, 3, 0), r"joint\.covariance\[3\]: has 36 entries; expected 37"),
        (
            _set("design", "yaw", "matrix", 0, 1, value=3.0),
            r"design\.yaw\.matrix\[0\]\[1\] = 3: expected 0\.1",
        ),
        (_remove("design", "yaw", "names", 0), r"design\.yaw\.matrix: has 2 entries; expected 1"),
        (
            _set("design", "yaw", "names", 0, value="b2"),
            r"design\.yaw\.names: 'b2' is unknown; expected static_gain_per_s, ",
        ),
        (_remove("planes", "pitch"), r"planes: missing key pitch"),
        (_remove("vehicle", "prior_biases_deg", "yaw"), r"prior_biases_deg: missing key yaw"),
        (_remove("coefficients", "Y_v"), r"coefficients: missing key Y_v"),
        (_set("coefficients", "Q_q", value=None), r"coefficients\.Q_q = None: expected object"),
        (
            _set("planes", "yaw", "b1_per_s2", "value", value=float("nan")),
            r"planes\.yaw\.b1_per_s2\.value = nan: expected a finite number",
        ),
        (
            _set("planes", "yaw", "b1_per_s2", "value", value="2"),
            r"planes\.yaw\.b1_per_s2\.value = '2': expected float, got str",
        ),
        (_remove("planes", "yaw", "delay_s"), r"planes\.yaw: object missing required field delay"),
    ],
)
def test_impossible_value_is_named(change: Change, said: str, tmp_path: Path) -> None:
    path = _write(tmp_path / "model.json", change)
    with pytest.raises(ModelError, match=said) as refusal:
        model_file.read(path)
    assert str(refusal.value).startswith(f"{path}: ")


@pytest.mark.parametrize("method", ["map", "paper", "output-error", "filter-error"])
def test_model_of_each_method_is_read(method: model_file.Method, tmp_path: Path) -> None:
    model = msgspec.structs.replace(MODEL, method=method)
    model_file.write(model, tmp_path / "model.json")
    assert model_file.read(tmp_path / "model.json") == model


def test_distant_z_of_a_linear_method_is_read(tmp_path: Path) -> None:
    """Output error of one plane has stepped 20 standard deviations to the nearest vehicle."""
    model = msgspec.structs.replace(MODEL, method="output-error")
    path = _write(tmp_path / "model.json", _set("joint", "z", 0, value=-20.0), model)
    assert model_file.read(path).joint.z[0] == -20.0


def test_model_of_yaw_alone_and_without_covariance_is_read(tmp_path: Path) -> None:
    """Tests of the rudder alone give noise and a covariance for yaw; the paper's method neither."""
    for model in (
        msgspec.structs.replace(
            MODEL,
            noise={Plane.YAW: MODEL.noise[Plane.YAW]},
            design={Plane.YAW: MODEL.design[Plane.YAW]},
        ),
        msgspec.structs.replace(
            MODEL,
            noise={},
            design={},
            joint=msgspec.structs.replace(
                MODEL.joint,
                covariance=tuple((0.0,) * 37 for _ in range(37)),
                correlation=tuple((0.0,) * 37 for _ in range(37)),
            ),
        ),
    ):
        model_file.write(model, tmp_path / "model.json")
        assert model_file.read(tmp_path / "model.json") == model


def test_covariance_is_checked_to_rounding(tmp_path: Path) -> None:
    rows = np.array(MODEL.joint.covariance)
    rows[0, 10] *= 1.0 + 1e-9
    change = _set(*COVARIANCE, value=rows.tolist())
    assert model_file.read(_write(tmp_path / "model.json", change)).joint.z == MODEL.joint.z
