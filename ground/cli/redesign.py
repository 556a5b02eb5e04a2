"""`ground redesign`: design gains or an LQG controller that meet a specification on a model."""

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ground.cli import params
from ground.cli.options import (
    Force,
    Json,
    ModelFile,
    Modem,
    Prior,
    Sign,
    SpecFile,
    VehicleId,
    print_result,
    refuse_empty,
    refuse_given,
    remark_other_vehicle,
)
from ground.output_files import check_output
from mavlink_io.errors import InputError

if TYPE_CHECKING:
    from ground.campaign.summary_file import DesignSummary
    from sysid.design.loop_export import LoopExport
    from sysid.design.lqg import LqgDesign
    from sysid.design.pid import Spec
    from sysid.models.model_file import IdentifiedModel


class DesignMethod(StrEnum):
    """Structure of the controller."""

    PID = "pid"
    LQG = "lqg"


DEFAULT_OUT = {DesignMethod.PID: Path("gains.param"), DesignMethod.LQG: Path("controller.json")}
"""File that a redesign writes without --out."""


def redesign(
    context: typer.Context,
    model: ModelFile,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Default: gains.param; with lqg controller.json."),
    ] = None,
    method: Annotated[
        DesignMethod,
        typer.Option(help="pid: gains of the PID loops; lqg: a controller for autopilot."),
    ] = DesignMethod.PID,
    upload: Annotated[
        str | None,
        typer.Option(
            callback=refuse_empty,
            metavar="ADDRESS",
            help="Also set the gains on the vehicle at this address.",
        ),
    ] = None,
    export: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Also write the loops as state spaces to FILE.json and FILE.mat.",
        ),
    ] = None,
    prior: Prior = None,
    spec: SpecFile = None,
    damping: Annotated[
        float | None, typer.Option(help="Min damping ratio of each visible mode; 0.6.")
    ] = None,
    gm_db: Annotated[
        float | None,
        typer.Option(help="Min gain margin at rudder, heading, elevator, depth and pitch, dB; 8."),
    ] = None,
    pm_deg: Annotated[
        float | None,
        typer.Option(help="Min phase margin at the same points, deg; 55."),
    ] = None,
    max_sensitivity: Annotated[
        float | None,
        typer.Option(help="Max sensitivity (Ms) at the same points; 1.6."),
    ] = None,
    robust_gm_db: Annotated[
        float | None,
        typer.Option(help="Min gain margin on each vehicle sampled from the model, dB; 6."),
    ] = None,
    robust_pm_deg: Annotated[
        float | None, typer.Option(help="Min phase margin on each sampled vehicle, deg; 45.")
    ] = None,
    robust_fraction: Annotated[
        float | None,
        typer.Option(help="Min fraction of sampled vehicles that meet all of these; 0.5."),
    ] = None,
    integral_settling_s: Annotated[
        float | None,
        typer.Option(help="Time in which the integral action removes a constant load, s; 30."),
    ] = None,
    depth_overshoot: Annotated[
        float | None, typer.Option(help="Max overshoot as a fraction of a depth step of 3 m; 0.04.")
    ] = None,
    force: Force = False,
    sign: Sign = None,
    vehicle_id: VehicleId = None,
    modem: Modem = None,
    json: Json = False,
) -> None:
    """Design gains or an LQG controller for a model; fail with the reason if none is good enough.

    The LQG design takes one to two minutes.
    """
    target = out or DEFAULT_OUT[method]
    _check_outputs(target, export, [model, prior, spec, sign])
    from ground.campaign import refit, specification

    if upload and method is DesignMethod.LQG:
        raise InputError(
            "--upload: sets parameters, an LQG controller is a file; "
            "give it to `autopilot --controller`"
        )
    if not upload:
        refuse_given(
            context,
            "--sign --vehicle-id --modem",
            "is for the link of --upload, which is not given",
        )
    identified = refit.read_model(model)
    remark_other_vehicle(model, prior)
    limits = {
        "damping": damping,
        "gm_db": gm_db,
        "pm_deg": pm_deg,
        "max_sensitivity": max_sensitivity,
        "robust_gm_db": robust_gm_db,
        "robust_pm_deg": robust_pm_deg,
        "robust_fraction": robust_fraction,
        "integral_settling_s": integral_settling_s,
        "depth_overshoot": depth_overshoot,
    }
    limit_spec = specification.read(spec, limits, refit.specification(identified, prior))
    result: DesignSummary | dict[str, Any]
    if method is DesignMethod.LQG:
        result, text = _redesign_lqg(
            identified, limit_spec, prior, target, force=force, export=export
        )
    else:
        result, text = _redesign_pid(
            identified, limit_spec, prior, target, force=force, export=export
        )
        if upload:
            changes = params.upload(
                upload,
                sign,
                result.gains,
                source=str(target),
                model_sha256=result.model_sha256,
                system=vehicle_id,
                modem_s=modem,
            )
            text = "\n".join(
                [text, f"{upload}, {params.UNDO}:", *params.format_changes(changes, {})]
            )
    print_result(result, text, json)


def _check_outputs(out: Path, export: Path | None, inputs: Sequence[Path | str | None]) -> None:
    """Raise InputError if a file to be written is one of the others."""
    check_output("--out", out, inputs)
    if export is not None:
        from sysid.design import loop_export

        for file in loop_export.files_of(export):
            check_output("--export", file, [*inputs, out])


def _redesign_pid(
    model: "IdentifiedModel",
    spec: "Spec",
    prior: str | None,
    out: Path,
    *,
    force: bool,
    export: Path | None,
) -> "tuple[DesignSummary, str]":
    """Design gains and write them; return the result as JSON and text."""
    from ground.campaign import refit, summary
    from sysid.design import loop_export

    design = refit.redesign(model, spec, prior, force=force)
    loops = loop_export.export_pid(model, design, refit.read_vehicle(prior))
    design.write_params(out)
    text = "\n".join([summary.format_design(design, out), *_format_loops(loops, export)])
    return summary.summarise_design(design), text


def _redesign_lqg(
    model: "IdentifiedModel",
    spec: "Spec",
    prior: str | None,
    out: Path,
    *,
    force: bool,
    export: Path | None,
) -> tuple[dict[str, Any], str]:
    """Design an LQG controller and write it; return the result as JSON and text."""
    from ground.campaign import refit
    from sysid.design import loop_export, lqg

    design = refit.redesign_lqg(model, spec, prior, force=force)
    loops = loop_export.export_lqg(model, design, refit.read_vehicle(prior))
    lqg.write(design, out)
    content = _lqg_json(design) | {
        "margins": {cut: margins._asdict() for cut, margins in loops.margins.items()}
    }
    return content, "\n".join([_format_lqg(design, out), *_format_loops(loops, export)])


def _format_loops(loops: "LoopExport", export: Path | None) -> list[str]:
    """Write the loops on request; return what python-control found, as lines of text."""
    from sysid.design import loop_export

    lines = ["margins confirmed by python-control:"]
    lines += [
        f"  {cut:10s}{margins.gm_db:6.1f} dB{margins.pm_deg:6.1f} deg  Ms"
        f" {margins.max_sensitivity:.2f}"
        for cut, margins in loops.margins.items()
    ]
    if export is not None:
        lines.append(", ".join(map(str, loop_export.write(loops, export))))
    return lines


def _lqg_json(design: "LqgDesign") -> dict[str, Any]:
    """Return the LQG design as plain numbers."""
    return {
        "predicted": design.predicted,
        "robustness": design.robustness,
        "minimum_variance": design.minimum,
        "weights": design.weights,
        "speed_mps": design.speed_mps,
        "model_sha256": design.model_sha256,
    }


def _format_lqg(design: "LqgDesign", out: Path) -> str:
    """Return the LQG design as lines of text."""
    from ground.campaign import summary

    predicted, robustness = design.predicted, design.robustness
    lines = [
        f"{out}: start `autopilot --controller {out}`; LQG_ENABLE = 0 switches to the PID loops",
        (
            f"  predicted rms in the sea of the tests: heading {predicted.heading_deg:.2f} deg, "
            f"pitch {predicted.pitch_deg:.2f} deg, depth {100.0 * predicted.depth_m:.1f} cm, "
            f"rudder {predicted.rudder_deg:.2f} deg, elevator {predicted.elevator_deg:.2f} deg"
        ),
    ]
    if robustness:
        lines.append(
            f"  {100.0 * robustness.specification:.0f} % of the vehicles sampled from the model"
            " meet the specification"
        )
    return "\n".join([*lines, *summary.minimum_lines(predicted, design.minimum)])
