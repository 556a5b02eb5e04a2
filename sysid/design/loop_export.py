"""Export of the designed loops as state spaces, in JSON and in MATLAB's format.

Every entry has the matrices A, B, C, D, so that ``control.ss(A, B, C, D)`` loads it.
"""

import json
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import control
import numpy as np
from scipy.io import savemat

from mavlink_io.user_data_dir import write_output
from sitl.vehicle.config import VehicleConfig
from sysid.control_analysis import control_systems, loop_transfer
from sysid.control_analysis.control_systems import LoopSystem
from sysid.control_analysis.loop_transfer import Margins
from sysid.design import design_model
from sysid.design.lqg import LqgDesign, loop_analysis
from sysid.design.lqg.controller import ContinuousController
from sysid.design.specification import Design
from sysid.models.linear_planes import LinearPlane
from sysid.models.model_file import IdentifiedModel
from sysid.planes import Plane

FORMAT = 1
"""Format of the JSON file."""


class LoopExport(NamedTuple):
    """Loops of a design."""

    method: str
    """pid or lqg."""
    model_sha256: str
    plants: dict[str, LoopSystem]
    """Plane from command to measured motion, by plane."""
    controllers: dict[str, LoopSystem]
    """Controllers of an LQG design, by plane; empty for PID loops."""
    loops: dict[str, LoopSystem]
    """Open loop L by cut."""
    margins: dict[str, Margins]
    """Margins by cut, as found by python-control and in agreement with the design's."""
    gains: dict[str, float]
    """Parameters of PID loops by name; empty for LQG."""


def export_pid(
    model: IdentifiedModel, design: Design, prior: VehicleConfig | None = None
) -> LoopExport:
    """Return the loops of a PID design, with its margins confirmed by python-control.

    Parameters
    ----------
    model : IdentifiedModel
        Model of the design.
    design : Design
        Designed gains and their analysis.
    prior : VehicleConfig, optional
        Vehicle file of the refit; by default the one in the model.

    Returns
    -------
    LoopExport
        Plants, open loops and margins.

    Raises
    ------
    MarginsDisagreeError
        A margin of the design differs from that of python-control.
    """
    vehicle = design_model.from_model(model, prior)
    lags = vehicle.yaw_lag, vehicle.pitch_lag
    loops = control_systems.open_loops(vehicle.planes, lags, design.gains)
    return LoopExport(
        method="pid",
        model_sha256=design.baseline.model_sha256,
        plants=control_systems.plants(vehicle.planes, lags, design.gains),
        controllers={},
        loops=loops,
        margins=control_systems.check_margins(loops, design.analysis.margins),
        gains=dict(design.gains),
    )


def export_lqg(
    model: IdentifiedModel, design: LqgDesign, prior: VehicleConfig | None = None
) -> LoopExport:
    """Return the loops of an LQG design, with its margins confirmed by python-control.

    Parameters
    ----------
    model : IdentifiedModel
        Model of the design.
    design : LqgDesign
        Designed controllers.
    prior : VehicleConfig, optional
        Vehicle file of the refit; by default the one in the model.

    Returns
    -------
    LoopExport
        Plants, controllers, open loops and margins.

    Raises
    ------
    MarginsDisagreeError
        A margin of the design differs from that of python-control.
    """
    vehicle = design_model.from_model(model, prior)
    lags = vehicle.yaw_lag, vehicle.pitch_lag
    loops: dict[str, LoopSystem] = {}
    reported: dict[str, Margins] = {}
    controllers = {Plane.YAW: design.heading, Plane.PITCH: design.depth}
    for (plane, controller), linear, lag in zip(
        controllers.items(), vehicle.planes, lags, strict=True
    ):
        measured = loop_analysis.measured_plane(vehicle, plane)
        cuts = loop_analysis.cuts(measured, controller)
        surface, outer = measured.names
        reported |= {
            surface: loop_transfer.margins(cuts.surface),
            outer: loop_transfer.margins(cuts.outer),
        }
        loops |= _lqg_loops(linear, lag, controller, measured.names)
    return LoopExport(
        method="lqg",
        model_sha256=design.model_sha256,
        plants=control_systems.plants(vehicle.planes, lags, {}),
        controllers={
            str(plane): _controller(controller, linear)
            for (plane, controller), linear in zip(controllers.items(), vehicle.planes, strict=True)
        },
        loops=loops,
        margins=control_systems.check_margins(loops, reported),
        gains={},
    )


def _controller(controller: ContinuousController, plane: LinearPlane) -> LoopSystem:
    """Return a controller from measurements (relative to the set-point) to the command."""
    outputs = control_systems.plant(plane, loop_transfer.Lag(0.0), {}).output_labels
    system = control.ss(
        controller.closed,
        controller.L,
        controller.F[None, :],
        np.zeros((1, controller.L.shape[1])),
        inputs=list(outputs),
        outputs=["command"],
    )
    return control_systems.record_of(system, 0.0)


def _lqg_loops(
    plane: LinearPlane,
    lag: loop_transfer.Lag,
    controller: ContinuousController,
    names: tuple[str, str],
) -> dict[str, LoopSystem]:
    """Return the loops opened at the surface and at the outer outputs, as `loop_analysis.cuts`."""
    surface, outer = names
    system = control_systems.plant(plane, lag, {})
    outputs = list(system.output_labels)
    count = 1 if len(outputs) == 2 else 2

    def part(first: int, last: int, output: str) -> Any:
        """Return the controller with some of its inputs."""
        return control.ss(
            controller.closed,
            controller.L[:, first:last],
            controller.F[None, :],
            np.zeros((1, last - first)),
            inputs=outputs[first:last],
            outputs=[output],
        )

    at_surface = control.interconnect(
        [control_systems.named(system, surface), part(0, len(outputs), "command")],
        inputs=[surface],
        outputs=["command"],
        check_unused=False,
    )
    cut = f"{outer}_cut"  # "depth" is also the name of a measurement
    total = control.summing_junction(inputs=["inner", cut], output="command")
    at_outer = control.interconnect(
        [
            control_systems.named(system, "command"),
            part(0, count, "inner"),
            part(count, len(outputs), "demand"),
            total,
        ],
        inputs=[cut],
        outputs=["demand"],
        check_unused=False,
    )
    return {
        surface: control_systems.loop(-1.0, at_surface, lag.delay_s),
        outer: control_systems.loop(-1.0, at_outer, lag.delay_s),
    }


def files_of(path: Path) -> tuple[Path, Path]:
    """Return the JSON file and the .mat file of an export.

    Parameters
    ----------
    path : Path
        Name of either file, or of both without a suffix.

    Returns
    -------
    tuple of Path
        JSON file and .mat file.
    """
    stem = path.with_suffix("") if path.suffix in (".json", ".mat") else path
    return stem.with_name(f"{stem.name}.json"), stem.with_name(f"{stem.name}.mat")


def write(export: LoopExport, path: Path) -> tuple[Path, Path]:
    """Write the loops as JSON and in MATLAB's format.

    Parameters
    ----------
    export : LoopExport
        Loops of a design.
    path : Path
        Name of either file, or of both without a suffix.

    Returns
    -------
    tuple of Path
        JSON file and .mat file.
    """
    files = files_of(path)
    matlab = BytesIO()
    savemat(matlab, _content(export, _arrays))
    write_output(files[0], json.dumps(_content(export, _lists), indent=1))
    write_output(files[1], matlab.getvalue())
    return files


def _content(export: LoopExport, convert: Any) -> dict[str, Any]:
    """Return the content of a file; `convert` turns a system into its values."""
    groups = {
        name: {key: convert(system) for key, system in getattr(export, name).items()}
        for name in ("plants", "controllers", "loops")
    }
    return {
        "format": FORMAT,
        "method": export.method,
        "model_sha256": export.model_sha256,
        "pade_order": control_systems.PADE_ORDER,
        **{name: systems for name, systems in groups.items() if systems},
        "margins": {name: _finite(margins) for name, margins in export.margins.items()},
        **({"gains": export.gains} if export.gains else {}),
    }


def _finite(margins: Margins) -> dict[str, float]:
    """Return the finite margins by name; JSON has no infinity."""
    return {name: value for name, value in margins._asdict().items() if np.isfinite(value)}


def _lists(system: LoopSystem) -> dict[str, Any]:
    """Return matrices as nested lists."""
    return {
        **{name: getattr(system, name).tolist() for name in "ABCD"},
        "inputs": list(system.inputs),
        "outputs": list(system.outputs),
        "delay_s": system.delay_s,
    }


def _arrays(system: LoopSystem) -> dict[str, Any]:
    """Return matrices as arrays and names as cell arrays."""
    return {
        **{name: getattr(system, name) for name in "ABCD"},
        "inputs": np.array(system.inputs, dtype=object),
        "outputs": np.array(system.outputs, dtype=object),
        "delay_s": system.delay_s,
    }
