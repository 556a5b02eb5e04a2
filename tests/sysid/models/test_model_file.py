"""Format of ``model.json``: published schema, writing and reading, and errors for other formats."""

import codecs
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from sitl.vehicle import config as vehicle_files
from sitl.vehicle.config import SHIPPED, VehicleConfig, VehicleFileError
from sysid.models import model_file as models
from sysid.models import prediction
from sysid.models.model_file import IdentifiedModel, ModelError, schema
from sysid.prior_knowledge import prior_knowledge

PUBLISHED = Path(__file__).parents[3] / "docs" / "model.schema.json"
DESCRIBED = PUBLISHED.with_name("model.md")
ROOT = PUBLISHED.parents[1]
VEHICLE_FILES = [
    ROOT / "docs" / "my_vehicle.toml",
    *sorted((ROOT / "benchmarks" / "campaigns" / "vehicles").glob("*.toml")),
]


def _with_vehicle(model: IdentifiedModel, **changes: Any) -> IdentifiedModel:
    vehicle = msgspec.structs.replace(model.vehicle, **changes)
    return msgspec.structs.replace(model, vehicle=vehicle)


def test_published_schema_equals_records() -> None:
    command = "python -m sysid.models.model_file > docs/model.schema.json"
    assert PUBLISHED.read_bytes() == schema(), f"the records have changed; run {command}"


def test_every_field_is_described() -> None:
    text = DESCRIBED.read_text(encoding="utf-8")
    of_vehicle_files = msgspec.json.schema(VehicleConfig)["$defs"]
    fields = {
        name
        for record_name, record in json.loads(schema())["$defs"].items()
        if record_name not in of_vehicle_files
        for name in record.get("properties", {})
    }
    assert {name for name in fields if f"`{name}`" not in text} == set()


def test_model_written_and_read_is_equal(model: IdentifiedModel, tmp_path: Path) -> None:
    models.write(model, tmp_path / "model.json")
    assert models.read(tmp_path / "model.json") == model


def test_model_with_byte_order_mark_is_read(model: IdentifiedModel, tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    models.write(model, path)
    path.write_bytes(codecs.BOM_UTF8 + path.read_bytes())
    assert models.read(path) == model


@pytest.mark.parametrize("name", [*SHIPPED, *VEHICLE_FILES], ids=lambda name: Path(name).stem)
def test_model_contains_its_vehicle_file(
    name: str | Path, model: IdentifiedModel, tmp_path: Path
) -> None:
    config = vehicle_files.load(name)
    models.write(_with_vehicle(model, prior=Path(name).name, file=config), tmp_path / "model.json")
    read = models.read(tmp_path / "model.json")
    assert prediction.prior_vehicle(read) == config


def test_model_with_an_unknown_instrument_is_refused(
    model: IdentifiedModel, tmp_path: Path
) -> None:
    config = vehicle_files.load("remus100")
    instruments = msgspec.structs.replace(config.instruments, imu="nonsense")
    file = msgspec.structs.replace(config, instruments=instruments)
    models.write(_with_vehicle(model, file=file), tmp_path / "model.json")
    expected = (
        r"model\.json: vehicle\.file: instruments\.imu = 'nonsense': unknown; known here: mti"
    )
    with pytest.raises(VehicleFileError, match=expected):
        models.read(tmp_path / "model.json")


def test_model_is_a_prior_where_its_vehicle_file_is_missing(
    model: IdentifiedModel, tmp_path: Path
) -> None:
    config = vehicle_files.load(VEHICLE_FILES[0])
    models.write(_with_vehicle(model, prior="mine.toml", file=config), tmp_path / "model.json")
    knowledge = prior_knowledge(tmp_path / "model.json")
    assert (knowledge.config, knowledge.name) == (config, "mine.toml")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda vehicle: vehicle.pop("file"), "vehicle: object missing required field file"),
        (lambda vehicle: vehicle.update(file=None), "vehicle.file = None: expected object"),
    ],
)
def test_model_without_its_vehicle_file_is_refused(
    model: IdentifiedModel, tmp_path: Path, change: Callable[[Any], None], reason: str
) -> None:
    path = tmp_path / "model.json"
    models.write(model, path)
    content = json.loads(path.read_text())
    change(content["vehicle"])
    path.write_text(json.dumps(content))
    with pytest.raises(ModelError, match=f"model.json: {reason}.*, or refit its logs"):
        models.read(path)


def test_impossible_vehicle_file_in_a_model_is_refused(
    model: IdentifiedModel, tmp_path: Path
) -> None:
    path, config = tmp_path / "model.json", vehicle_files.load("caribou_nominal")
    light = msgspec.structs.replace(config.ballast, net_buoyancy_n=-1e5)
    sunk = msgspec.structs.replace(config, ballast=light)
    models.write(_with_vehicle(model, file=sunk), path)
    with pytest.raises(VehicleFileError, match=r"model\.json: vehicle\.file: ballast\.net_buoy"):
        models.read(path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            '{"format": 2, "method": "map", "planes": {}, "verdict": null}',
            "format = 2; this version reads format 5: refit the logs",
        ),
        ('{"format": 99, "planes": {}}', "format = 99"),
        ("{}", "no 'format' key"),
        ('{"planes": {"format": 5}}', "no 'format' key"),
        ('{"format": 1, "model": {"planes": {}}}', "not a model file .no 'planes' key."),
        ('{"format": 1, "tick_s": 0.02, "heading": {}}', "not a model file .no 'planes' key."),
        ('{"format": 5, "planes": {}}', "missing required field"),
        ("not json", "malformed"),
    ],
)
def test_invalid_model_file_rejected_in_one_line(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    path.write_text(text)
    with pytest.raises(ModelError, match=said) as refusal:
        models.read(path)
    assert str(refusal.value).startswith(str(path))
    assert "\n" not in str(refusal.value)


def test_design_covariance_diagonal_equals_sds(model: IdentifiedModel) -> None:
    for plane, found in model.design.items():
        for i, name in enumerate(found.names):
            sd = getattr(model.planes[plane], name).sd
            assert found.matrix[i][i] ** 0.5 == pytest.approx(sd, rel=1e-9), (plane, name)


def test_unknown_key_is_named_in_error(model: IdentifiedModel, tmp_path: Path) -> None:
    plain = msgspec.to_builtins(model) | {"colour": "blue"}
    (tmp_path / "model.json").write_text(json.dumps(plain))
    with pytest.raises(ModelError, match="colour"):
        models.read(tmp_path / "model.json")
