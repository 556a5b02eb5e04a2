"""`ground campaign`: fly, identify, redesign and verify in one command."""

from pathlib import Path
from typing import Annotated

import typer

from ground.cli.options import Json, ScenarioName, Seed, Speed, VehicleName, print_result


def campaign(
    vehicle: VehicleName = "caribou_truth",
    scenario: ScenarioName = "disturbed",
    seed: Seed = 1,
    speed: Speed = "max",
    beside_paper: Annotated[
        bool,
        typer.Option(
            "--beside-paper", help="Fly the missions with the paper's improved gains too."
        ),
    ] = False,
    out: Annotated[Path, typer.Option(metavar="DIR", help="The campaign's folder.")] = Path(
        "campaign"
    ),
    force: Annotated[
        bool, typer.Option("--force", help="Replace the campaign that the folder holds.")
    ] = False,
    json: Json = False,
) -> None:
    """Prototype, identify, redesign, verify: fly them all, and report."""
    from ground import progress
    from ground.campaign import summary
    from ground.campaign.run import Campaign, CampaignRequest

    with progress.display("campaign", quiet=json) as shown:
        asked = CampaignRequest(out, vehicle, scenario, seed, speed, beside_paper, force)
        result = Campaign(asked, shown.watch_named, shown.announce).run()
    print_result(result, summary.format_text(result, out), json)
