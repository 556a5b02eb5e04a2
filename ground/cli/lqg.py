"""``ground laws``: from a model to laws that fly in place of the PIDs, which `autopilot --laws`
reads."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ground.cli.options import Force, Json, ModelFile, Prior, SpecFile, print_result

if TYPE_CHECKING:
    from sysid.design.lqg import LqgDesign


def design_lqg(
    model: ModelFile,
    out: Annotated[Path, typer.Option(metavar="LAWS.json")] = Path("laws.json"),
    prior: Prior = None,
    spec: SpecFile = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Design LQG laws of the redesign's specification for a model, or refuse with the reason; a
    minute or two."""
    from ground.campaign import refit, specification
    from sysid.design import lqg

    identified = refit.read_model(model)
    asked = specification.read(spec, {}, refit.specification(identified, prior))
    design = refit.redesign_lqg(identified, asked, prior, force=force)
    lqg.write(design, out)
    print_result(_result(design), _format_text(design, out), json)


def _result(design: "LqgDesign") -> dict[str, Any]:
    return {
        "predicted": design.predicted._asdict(),
        "trust": design.robustness and design.robustness._asdict(),
        "weights": design.weights,
        "speed_mps": design.speed_mps,
        "model_sha256": design.model_sha256,
    }


def _format_text(design: "LqgDesign", out: Path) -> str:
    found, sure = design.predicted, design.robustness
    lines = [
        f"{out}: autopilot --laws {out}; LAW_ENABLE 0 gives the vehicle back to the PIDs",
        (
            f"  in the sea of the tests, rms: heading {found.heading_deg:.2f} deg, pitch"
            f" {found.pitch_deg:.2f} deg, depth {100.0 * found.depth_m:.1f} cm, rudder"
            f" {found.rudder_deg:.2f} deg, elevator {found.elevator_deg:.2f} deg"
        ),
    ]
    if sure:
        lines.append(
            f"  {100.0 * sure.specification:.0f} % of the vehicles that the model allows for keep"
            " the specification"
        )
    return "\n".join(lines)
