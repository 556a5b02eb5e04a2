"""Vehicle files are checked before a flight or a campaign begins."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from ground.campaign import run
from ground.campaign.campaign_folder import CampaignFolder
from ground.campaign.request import CampaignRequest
from ground.cli.main import app
from mavlink_io.errors import InputError
from sitl.vehicle import config
from sysid.models import model_file
from sysid.test_design import prior
from tests.sitl.vehicle.test_fill_missing import FINNED
from tests.sysid.monte_carlo.files import model_of

WITHOUT_COMPASS = f'{FINNED}\n[instruments]\nmagnetometer = "none"\n'


def written(folder: Path, text: str, name: str = "mine.toml") -> str:
    """Write a vehicle file and return its path."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return str(path)


def refused(*words: str) -> str:
    """Run a command that bad input ends; return the message."""
    with pytest.raises(InputError) as refusal:
        CliRunner().invoke(app, words, catch_exceptions=False)
    assert "\n" not in str(refusal.value)
    return str(refusal.value)


def campaign_refused(folder: Path, *words: str) -> str:
    """Run a campaign that is refused before it writes a folder; return the message."""
    out = folder / "campaign"
    message = refused("campaign", *words, "--out", str(out))
    assert not out.exists()
    return message


def test_fly_vehicle_that_cannot_arm_refused_at_once(tmp_path: Path) -> None:
    """Before, the command waited for 300 s for a vehicle that is ready."""
    vehicle, log = written(tmp_path, WITHOUT_COMPASS), tmp_path / "a.mcap"
    message = refused("fly", "straight_run", "--sitl", "--vehicle", vehicle, "--log", str(log))
    assert message.startswith(f'{vehicle}: instruments.magnetometer = "none": ')
    assert not log.exists()


def test_campaign_vehicle_that_cannot_arm_refused_at_once(tmp_path: Path) -> None:
    vehicle = written(tmp_path, WITHOUT_COMPASS)
    assert "does not arm without it" in campaign_refused(tmp_path, "--vehicle", vehicle)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (FINNED.replace("span_m = 0.12", "span_m = nan"), "span_m = nan: expected a finite"),
        (WITHOUT_COMPASS, "does not arm without it"),
    ],
)
def test_campaign_truth_is_checked_first(text: str, expected: str, tmp_path: Path) -> None:
    """Before, the file was read after the preparation, when the folder was written."""
    truth = written(tmp_path, text, "flown.toml")
    message = campaign_refused(
        tmp_path, "--vehicle", written(tmp_path, FINNED), "--truth", truth, "--scenario", "missing"
    )
    assert message.startswith(f"{truth}: ")
    assert expected in message


HEAVY = f"{FINNED}\n[ballast]\nmass_kg = 58190.0\n"


def test_every_command_names_the_wrong_key_of_a_vehicle_file(tmp_path: Path) -> None:
    """All commands make the check of `vehicle check` first."""
    vehicle = written(tmp_path, HEAVY)
    messages = [
        refused("vehicle", "check", vehicle),
        refused("vehicle", "gains", vehicle, "--out", str(tmp_path / "gains.param")),
        refused("design-test", "--prior", vehicle, "--out", str(tmp_path / "test.toml")),
        refused("fly", "trim", "--sitl", "--vehicle", vehicle, "--log", str(tmp_path / "a.mcap")),
        campaign_refused(tmp_path, "--vehicle", vehicle),
        campaign_refused(tmp_path, "--vehicle", vehicle, "--truth", written(tmp_path, FINNED, "t")),
        campaign_refused(tmp_path, "--truth", vehicle),
    ]
    assert len(set(messages)) == 1
    assert messages[0].startswith(f"{vehicle}: ballast.mass_kg = 58190 with net_buoyancy_n = ")


def test_report_reads_the_vehicle_in_the_model(tmp_path: Path) -> None:
    """The path in campaign.toml is relative to the folder in which the campaign was begun."""
    known = config.load(written(tmp_path, FINNED))
    model_file.write(model_of(prior.from_file(known)), tmp_path / "model.json")
    (tmp_path / "campaign.toml").write_text('vehicle = "gone.toml"\n')
    folder = CampaignFolder(tmp_path)
    assert folder.prior == "gone.toml"
    assert folder.prior_config == known


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b'vehicle = "\xff"\n', "is no text in UTF-8"),
        (b"vehicle == 3\n", "is no valid TOML: Invalid value"),
        (b"seed = 1\n", "names no vehicle"),
    ],
)
def test_damaged_campaign_file_is_named(content: bytes, expected: str, tmp_path: Path) -> None:
    (tmp_path / "campaign.toml").write_bytes(content)
    with pytest.raises(InputError, match=rf"campaign\.toml: {expected}"):
        CampaignFolder(tmp_path).prior  # noqa: B018


def test_preparation_warns_of_a_vehicle_that_floats_nose_down(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    vehicle = written(tmp_path, f"{FINNED}\n[ballast]\nx_cm_m = 0.01\n")
    announced: list[str] = []

    def end(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(run.Campaign, "_measure_trims", end)
    request = CampaignRequest(tmp_path / "out", vehicle="caribou_nominal", truth=vehicle)
    with pytest.raises(KeyboardInterrupt):
        run.Campaign(request, lambda name, at: None, announced.append).run()
    assert any(text.startswith(f"warning: {vehicle}: floats at pitch -") for text in announced), (
        announced
    )
