"""Settling time of a campaign's dives: longer where the legs of its missions are longer."""

from pathlib import Path

import pytest

from ground.campaign import summary


@pytest.mark.parametrize(("leg_s", "settling_s"), [(720.0, 60.0), (150.0, 25.0)])
def test_settling_time_follows_the_legs_of_the_mission(
    tmp_path: Path, leg_s: float, settling_s: float
) -> None:
    """Shipped straight run: 300 s, settling time 25 s, which is also the least."""
    mission = tmp_path / "straight_run.toml"
    leg = f"depth_m = 3.0\nheading_deg = 20.0\nthrust_pct = 60.0\nduration_s = {leg_s}\n"
    mission.write_text(f'name = "straight_run"\n[[step]]\n{leg}[[step]]\nsurface = true\n')
    assert summary.settling_s(str(mission)) == pytest.approx(settling_s)
    assert summary.settling_s("straight_run") == 25.0
