"""Exported loops, loaded by python-control as a user would."""

import json
from pathlib import Path

import control
import msgspec
import numpy as np
import pytest
from scipy.io import loadmat

from autopilot.control import lqg_file
from sitl.vehicle import config as vehicle_files
from sysid.control_analysis.control_systems import MarginsDisagreeError
from sysid.control_analysis.loop_transfer import Margins
from sysid.design import loop_export, lqg, pid
from sysid.design.loop_export import LoopExport
from sysid.design.specification import Design
from sysid.models.model_file import IdentifiedModel


@pytest.fixture(scope="module")
def designed(model: IdentifiedModel) -> Design:
    return pid.redesign(model)


@pytest.fixture(scope="module")
def exported(model: IdentifiedModel, designed: Design) -> LoopExport:
    return loop_export.export_pid(model, designed)


@pytest.mark.parametrize("suffix", ["", ".json", ".mat"])
def test_files_load_as_control_state_space(
    tmp_path: Path, exported: LoopExport, designed: Design, suffix: str
) -> None:
    """Both files give the phase margin of the design, by control.margin."""
    text, binary = loop_export.write(exported, tmp_path / f"loops{suffix}")
    assert (text.name, binary.name) == ("loops.json", "loops.mat")
    contents = json.loads(text.read_text()), loadmat(binary, simplify_cells=True)
    for content in contents:
        loop = content["loops"]["rudder"]
        system = control.ss(loop["A"], loop["B"], loop["C"], loop["D"])
        # the polynomials of control.margin overflow for 14 states: sampled response instead
        response = control.frd(system, np.geomspace(1e-2, 20.0, 1000), smooth=True)
        _, pm, _, crossover = control.margin(response)
        expected = designed.analysis.margins["rudder"]
        assert pm == pytest.approx(expected.pm_deg, abs=0.3)
        assert crossover == pytest.approx(expected.crossover_radps, rel=1e-3)
        assert content["margins"]["rudder"]["gm_db"] == pytest.approx(expected.gm_db, abs=0.1)
        assert content["gains"]["HDG_P"] == pytest.approx(designed.gains["HDG_P"])
        assert set(content["plants"]) == {"yaw", "pitch"}


def test_model_of_a_vehicle_file_is_exported_with_that_file(
    model: IdentifiedModel, exported: LoopExport
) -> None:
    """The name of a file that is not shipped does not lead to the vehicle."""
    own = msgspec.structs.replace(
        model, vehicle=msgspec.structs.replace(model.vehicle, prior="own.toml")
    )
    vehicle = vehicle_files.load(model.vehicle.prior)
    design = pid.redesign(own, prior=vehicle)
    assert loop_export.export_pid(own, design, vehicle).margins == exported.margins


def test_closed_loops_are_stable(exported: LoopExport) -> None:
    assert exported.loops
    for name, loop in exported.loops.items():
        closed = control.feedback(control.ss(*loop[:4]), 1)
        assert np.max(control.poles(closed).real) < -1e-3, name


def test_design_with_wrong_margins_is_not_exported(
    model: IdentifiedModel, designed: Design
) -> None:
    margins = designed.analysis.margins | {"rudder": Margins(20.0, 80.0, 1.1, 1.0)}
    wrong = designed._replace(analysis=designed.analysis._replace(margins=margins))
    with pytest.raises(MarginsDisagreeError, match="at rudder"):
        loop_export.export_pid(model, wrong)


@pytest.mark.slow
def test_lqg_controller_and_plant_give_the_exported_loop(
    model: IdentifiedModel, tmp_path: Path
) -> None:
    """L = -K P, with K and P loaded from the export; the controller file has the prediction."""
    design = lqg.design_lqg(model)
    lqg.write(design, tmp_path / "controller.json")
    assert lqg_file.load(tmp_path / "controller.json") == lqg.autopilot_controllers(design)
    content = json.loads((tmp_path / "controller.json").read_text())
    assert content["predicted"]["depth_m"] == design.predicted.depth_m
    assert design.minimum is not None
    assert design.minimum.same_rudder_heading_deg < design.predicted.heading_deg
    exported = loop_export.export_lqg(model, design)
    assert set(exported.margins) == {"rudder", "heading", "elevator", "depth"}
    for plane, cut in (("yaw", "rudder"), ("pitch", "elevator")):
        plant = control.ss(*exported.plants[plane][:4])
        controller = control.ss(*exported.controllers[plane][:4])
        assert exported.controllers[plane].inputs == exported.plants[plane].outputs
        s = 1j * np.geomspace(0.05, 5.0, 20)
        product = np.array([(-controller(x) @ plant(x)).item() for x in s])
        loop = np.array([control.ss(*exported.loops[cut][:4])(x) for x in s])
        assert np.allclose(loop, product, rtol=1e-6)
