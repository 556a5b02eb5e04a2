import math
from pathlib import Path

import pytest

from sitl.vehicle import config
from sysid.models import model_file as models
from sysid.test_design import prior
from tests.sysid.monte_carlo.files import model_of

SHORT = """
name = "short"

[[step]]
depth_m = 2.0
heading_deg = 10.0
thrust_pct = 58.0
duration_s = 42.0

[[step]]
surface = true
"""
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
    known = prior.with_trim(
        prior.from_file(config.load("caribou_nominal")), math.radians(6.0), math.radians(0.4)
    )
    models.write(
        model_of(known._replace(covariance=0.01 * known.covariance)), tmp_path / "model.json"
    )
    (tmp_path / "held.param").write_text("HDG_P,0.6\nHDG_D,1.5\n")
    (tmp_path / "soft.param").write_text("HDG_P,0.3\nHDG_D,1.5\n")
    (tmp_path / "short.toml").write_text(SHORT)
    (tmp_path / "plan.toml").write_text(PLAN)
    return tmp_path
