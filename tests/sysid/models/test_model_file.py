"""Format of ``model.json``: published schema, writing and reading, and errors for other formats."""

import json
from pathlib import Path

import msgspec
import pytest

from sysid.models import model_file as models
from sysid.models.model_file import IdentifiedModel, ModelError, schema

PUBLISHED = Path(__file__).parents[3] / "docs" / "model.schema.json"
DESCRIBED = PUBLISHED.with_name("model.md")


def test_published_schema_equals_records() -> None:
    command = "python -m sysid.models.model_file > docs/model.schema.json"
    assert PUBLISHED.read_bytes() == schema(), f"the records have changed; run {command}"


def test_every_field_is_described() -> None:
    text = DESCRIBED.read_text(encoding="utf-8")
    fields = {
        name
        for record in json.loads(schema())["$defs"].values()
        for name in record.get("properties", {})
    }
    assert {name for name in fields if f"`{name}`" not in text} == set()


def test_model_written_and_read_is_equal(model: IdentifiedModel, tmp_path: Path) -> None:
    models.write(model, tmp_path / "model.json")
    assert models.read(tmp_path / "model.json") == model


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            '{"format": 2, "method": "map", "verdict": null}',
            "format = 2; this version reads format 5: refit the logs",
        ),
        ('{"format": 99}', "format = 99"),
        ("{}", "no 'format' key"),
        ('{"format": 5}', "missing required field"),
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
