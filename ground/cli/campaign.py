"""`ground campaign`: fly, identify, redesign and verify in one command."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from ground.cli.live import Live, page_process
from ground.cli.options import (
    Jobs,
    Json,
    ScenarioName,
    Seed,
    Speed,
    VehicleName,
    print_result,
    refuse_empty,
)


def campaign(
    vehicle: VehicleName = "caribou_truth",
    truth: Annotated[
        str | None,
        typer.Option(
            callback=refuse_empty,
            metavar="FILE|perturbed",
            help="Vehicle that is flown and that identification does not know; `perturbed`: a"
            " random change of --vehicle within its uncertainty. Default: perturbed; for Caribou"
            " the vehicle itself.",
        ),
    ] = None,
    scenario: ScenarioName = "disturbed",
    seed: Seed = 1,
    speed: Speed = "max",
    include_paper_gains: Annotated[
        bool,
        typer.Option(
            "--include-paper-gains", help="Also fly the missions with the paper's improved gains."
        ),
    ] = False,
    extra_water_time: Annotated[
        float,
        typer.Option(
            metavar="SECONDS",
            min=0.0,
            help="Vehicle time for the tests that the assessment recommends if the model is not"
            " fit for redesign; 0: none.",
        ),
    ] = 1800.0,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the campaign.")] = Path(
        "campaign"
    ),
    force: Annotated[
        bool, typer.Option("--force", help="Replace the campaign that is in the folder.")
    ] = False,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume",
            help="Continue the campaign in the folder, which was begun with the same options and"
            " interrupted: dives that are recorded as finished are not flown again.",
        ),
    ] = False,
    jobs: Jobs = None,
    live: Live = False,
    json: Json = False,
) -> None:
    """Fly a simulated campaign: trims, tests, refit, redesign, verification and report."""
    from ground.simulation.subprocesses import start_fork_server

    start_fork_server()  # it loads the simulator while this process loads the rest
    from ground.campaign import summary
    from ground.campaign.request import CampaignRequest
    from ground.campaign.run import Campaign
    from ground.cli import progress
    from ground.live.page.feed import DiveFeed
    from sysid.trials import usable_cores

    request = CampaignRequest(
        out=out,
        vehicle=vehicle,
        truth=truth or "",
        scenario=scenario,
        seed=seed,
        speed=speed,
        include_paper_gains=include_paper_gains,
        force=force,
        resume=resume,
        jobs=jobs or usable_cores(),
        extra_water_s=extra_water_time,
    )
    with page_process(live=live) as page, progress.display("campaign") as display:
        listen = partial(DiveFeed, page) if page else None
        result = Campaign(request, display.watch_named, display.announce, listen).run()
    print_result(result, summary.format_text(result, out), json)
