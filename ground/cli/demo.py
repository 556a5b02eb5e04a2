"""`ground demo`: fly a simulated vehicle and show it in a browser."""

import tempfile
import time
from pathlib import Path
from typing import Annotated

import typer

from ground.cli.live import Browser, page_process
from ground.cli.options import Seed, remark, say

MISSION, VEHICLE, SCENARIO = "square", "caribou_truth", "disturbed"


def demo(
    speed: Annotated[
        str, typer.Option(metavar="N|max", help="Vehicle time as a multiple of real time.")
    ] = "8",
    seed: Seed = 1,
    browser: Browser = True,
    stay: Annotated[
        bool, typer.Option("--stay/--no-stay", help="Keep the page after the dive until Ctrl-C.")
    ] = True,
) -> None:
    """Fly a square in a simulated sea and show it live in a browser."""
    from ground.campaign import prototype
    from ground.cli import progress
    from ground.client import assessment, flight, verdict
    from ground.client.flight import Dive
    from ground.errors import Interrupted
    from ground.live.page.feed import DiveFeed
    from ground.simulation.processes import SimulatedVehicle, Simulation

    with tempfile.TemporaryDirectory() as folder, page_process(live=True, browser=browser) as page:
        assert page is not None
        parameters = prototype.trim_learning_for(VEHICLE)
        dive = Dive.load(MISSION, Path(folder) / "demo.mcap", parameters=parameters)
        simulation = Simulation(
            vehicle=VEHICLE, scenario=SCENARIO, seed=seed, speed=speed, no_compile=True
        )
        with progress.display("demo") as display:
            result = flight.fly_simulated(
                dive,
                SimulatedVehicle(simulation),
                display.watch,
                display.show_text,
                DiveFeed(page, MISSION, dive.items),
            )
        assessed = assessment.assess_dive(result.log, result.trims_learned)
        say(f"{result.vehicle_s:.0f} s flown\n{verdict.format_text(assessed)}")
        remark("next: `ground campaign --live` identifies the vehicle and redesigns its gains")
        if stay:
            remark("the page stays until Ctrl-C")
            try:
                while True:
                    time.sleep(1.0)
            except Interrupted:
                return
