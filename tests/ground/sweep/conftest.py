from pathlib import Path

import pytest

from tests.sysid.monte_carlo.files import SHORT_MISSION, write_known_model

PLAN = """
samples = 6
chunk = 1
missions = ["short.toml"]

[[vehicle]]
source = "model.json"

[[gains]]
file = "held.param"

[[gains]]
file = "soft.param"

[sea]
current_mps = { min = 0.0, max = 0.2 }
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a plan, a model, two sets of gains and a mission."""
    write_known_model(tmp_path / "model.json")
    (tmp_path / "held.param").write_text("HDG_P,0.6\nHDG_D,1.5\n")
    (tmp_path / "soft.param").write_text("HDG_P,0.3\nHDG_D,1.5\n")
    (tmp_path / "short.toml").write_text(SHORT_MISSION)
    (tmp_path / "plan.toml").write_text(PLAN)
    return tmp_path
