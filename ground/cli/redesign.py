"""``ground redesign``: from a model to gains that meet a specification, and on request to the
vehicle."""

from pathlib import Path
from typing import Annotated

import typer

from ground.cli import params
from ground.cli.options import Force, Json, ModelFile, Prior, Sign, SpecFile, print_result


def redesign(
    model: ModelFile,
    out: Annotated[Path, typer.Option(metavar="GAINS.param")] = Path("gains.param"),
    upload: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Set the gains on this vehicle.")
    ] = None,
    prior: Prior = None,
    spec: SpecFile = None,
    damping: Annotated[
        float | None, typer.Option(help="Least of any mode that shows; 0.6.")
    ] = None,
    gm_db: Annotated[
        float | None,
        typer.Option(help="Gain margin at rudder, heading, elevator and depth; 8."),
    ] = None,
    pm_deg: Annotated[
        float | None,
        typer.Option(help="Phase margin at the same four, deg; 55."),
    ] = None,
    ms: Annotated[
        float | None,
        typer.Option(help="Largest sensitivity at the same four; 1.6."),
    ] = None,
    least_gm_db: Annotated[
        float | None, typer.Option(help="On each vehicle that the model allows for; 6.")
    ] = None,
    least_pm_deg: Annotated[float | None, typer.Option(help="On each of them; 45.")] = None,
    probability: Annotated[
        float | None, typer.Option(help="Share of them that must keep all of it; 0.5.")
    ] = None,
    finish_s: Annotated[
        float | None, typer.Option(help="Seconds for an integrator to finish; 30.")
    ] = None,
    depth_overshoot: Annotated[
        float | None, typer.Option(help="Share of a change of depth; 0.1.")
    ] = None,
    force: Force = False,
    sign: Sign = None,
    json: Json = False,
) -> None:
    """Redesign the gains for a model, or refuse with the reason."""
    from ground.campaign import refit, specification, summary

    identified = refit.read_model(model)
    limits = {
        "damping": damping,
        "gm_db": gm_db,
        "pm_deg": pm_deg,
        "ms": ms,
        "least_gm_db": least_gm_db,
        "least_pm_deg": least_pm_deg,
        "probability": probability,
        "finish_s": finish_s,
        "depth_overshoot": depth_overshoot,
    }
    asked = specification.read(spec, limits, refit.specification(identified, prior))
    design = refit.redesign(identified, asked, prior, force=force)
    design.write_params(out)
    words = summary.format_design(design, out)
    if upload:
        steps = params.upload(upload, sign, design.gains, str(out), design.baseline.model_sha256)
        words = "\n".join([words, f"{upload}, {params.UNDO}:", *params.format_changes(steps, {})])
    print_result(summary.summarise_design(design), words, json)
