"""Plans of sweeps: what they mean, and one line for each mistake."""

from pathlib import Path

import numpy as np
import pytest

from ground.missions import plans
from ground.sweep import plan_file
from mavlink_io.errors import InputError
from sysid.sweep.dives import DiveLimits
from sysid.sweep.points import ParameterRange, Sampler


def changed(folder: Path, old: str, new: str) -> Path:
    """Return the plan with another text."""
    path = folder / "plan.toml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return path


def test_load_reads_plan_and_its_files(folder: Path) -> None:
    path = changed(folder, "samples = 6", 'samples = 6\nsampler = "halton"\nrepeats = 2\nseed = 9')
    with path.open("a") as file:
        file.write("[fault]\nrudder_bias_deg = [0, 2.0]\nactuator_delay_s = 0.1\n")
        file.write("[pass]\ndepth_m = 0.5\n")
    request = plan_file.load(path)
    (vehicle,), (mission,) = request.vehicles, request.missions
    assert (vehicle.name, vehicle.spread, vehicle.prior.name) == ("model", 1.0, "model.json")
    assert [gains.name for gains in vehicle.gains] == ["held", "soft"]
    assert vehicle.gains[1].config.heading_p == 0.3
    assert vehicle.gains[0].config.rudder_trim_deg != 0.0, "the trims of the mean vehicle"
    assert (mission.name, mission.items) == ("short", plans.load_items(str(folder / "short.toml")))
    assert request.conditions == {
        "current_mps": ParameterRange(0.0, 0.2),
        "rudder_bias_deg": (0.0, 2.0),
        "actuator_delay_s": (0.1,),
    }
    assert request.limits == DiveLimits(depth_m=0.5)
    assert (request.sampler, request.samples, request.repeats) == (Sampler.HALTON, 6, 2)
    assert (request.seed, request.chunk, request.name) == (9, 1, "plan.toml")


def test_load_vehicle_file_has_first_principles_spread(folder: Path) -> None:
    request = plan_file.load(changed(folder, '"model.json"', '"caribou_nominal"'))
    (vehicle,) = request.vehicles
    assert vehicle.name == "caribou_nominal"
    assert np.all(np.diag(vehicle.prior.covariance) == 1.0)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("samples = 6", "samples = 0", "plan.toml: samples = 0: must be 1 to 1000000"),
        ("samples = 6", "sample = 6", "sample = 6: unknown key"),
        ("samples = 6", "samples = six", "not valid TOML"),
        ("samples = 6", 'sampler = "grid"', "sampler = 'grid': expected sobol"),
        ('missions = ["short.toml"]', "missions = []", "missions: is empty; give at least one"),
        ('["short.toml"]', '["nowhere.toml"]', "nowhere.toml: no readable mission"),
        ('"soft.param"', '"held.param"', "plan.toml: gains: held stands for two"),
        ('"soft.param"', '"hard.param"', "hard.param"),
        ('"soft.param"', '"soft.param"\ncontroller = "no.json"', "no.json: No such file"),
        ('"model.json"', '"model.json"\nspread = -1', "model: spread = -1: must be 0 to 10"),
        ('"model.json"', '"other.json"', "other.json"),
        ("min = 0.0", "min = 0.3", "sea.current_mps: min must be less than max"),
        ("max = 0.2", "max = 9.0", "sea.current_mps = 9: must be 0 to 5"),
        ("max = 0.2 }", "max = nan }", "sea.current_mps.max = nan: expected a finite number"),
        ("current_mps = {", "gnss = {", "sea.gnss: cannot be swept; expected one of"),
        ("{ min = 0.0, max = 0.2 }", "[0.1, 0.1]", "must be different numbers"),
        ('"soft.param"', '"soft.param"\nheld_out = ["short.toml"]', "soft: held_out: needs tests"),
        ('"soft.param"', '"soft.param"\ntests = ["no.toml"]', "no.toml: no readable mission"),
        ('"soft.param"', '"soft.param"\nspec = { pm = 40 }', "gains[1].spec.pm = 40: unknown key"),
        ("[sea]", "[fault]", "fault.current_mps: cannot be swept; expected one of rudder_bias"),
        ("[sea]", "[pass]\ndepth_m = 0\n[sea]", "pass.depth_m = 0: must be greater than 0"),
    ],
)
def test_load_mistake_is_one_line(folder: Path, old: str, new: str, said: str) -> None:
    path = changed(folder, old, new)
    with pytest.raises(InputError) as failure:
        plan_file.load(path)
    assert said in str(failure.value)
    assert "\n" not in str(failure.value)


def test_load_rejected_parameter_names_gains(folder: Path) -> None:
    (folder / "soft.param").write_text("HDG_Q,1\n")
    with pytest.raises(InputError, match="soft: parameter HDG_Q does not exist"):
        plan_file.load(folder / "plan.toml")
