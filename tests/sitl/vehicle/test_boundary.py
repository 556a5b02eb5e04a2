"""Forces of floor, ice and surface: contact, friction and suction; none of them adds energy."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.vehicle import boundary, config, dynamics, hull, wall_effects
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.vectors import Vector
from sitl.vehicle.water import Water
from tests.reference import energy
from tests.sitl.vehicle import flight

FIELD = flight.model("caribou_truth")
H = FIELD.hydrostatics
RHO = 1025.0
HULL = config.load("caribou_truth").hull
FLOOR_M = -50.0
SLOPE = np.array([-math.sin(0.2), 0.0, math.cos(0.2)])


def frictionless(model: VehicleModel) -> VehicleModel:
    """Return the model without drag and lift, but with suction of walls."""
    return flight.without_fluid_forces(model)._replace(walls=model.walls)


def pulled(state: Vector, water: Water, model: VehicleModel = FIELD) -> Vector:
    """Return the wrench of wall suction alone: with walls minus without walls."""
    blind = model._replace(walls=model.walls._replace(far_m=0.0))
    difference = flight.rate(model, state, water=water) - flight.rate(blind, state, water=water)
    return np.asarray(model.inertia.M @ difference[7:13])


@pytest.mark.parametrize("distance_m", [0.4, 1.0, 2.0])
def test_wall_pull_equals_pressure_integral_on_wall(distance_m: float) -> None:
    """Reference: integral of the Bernoulli pressure 1/2 rho v^2 over the wall.

    v is the flow of hull and mirror image. The part of the pressure that is linear in v comes from
    pairs of sources and sums to zero.
    """
    x, dx = hull.quadrature(HULL, wall_effects.NODES)
    source = -wall_effects._section_growth(HULL, x) * dx / (4 * math.pi)
    nodes, weights = np.polynomial.legendre.leggauss(160)
    stretch, size = 2.0 * np.tan(nodes * 1.5), 2.0 * 1.5 / np.cos(nodes * 1.5) ** 2 * weights
    along, across = np.meshgrid(stretch, stretch, indexing="ij")
    area = np.outer(size, size)
    apart = along[..., None] - x
    cubed = (apart**2 + (across**2 + distance_m**2)[..., None]) ** 1.5
    v_x, v_y = 2 * (source * apart / cubed).sum(-1), 2 * across * (source / cubed).sum(-1)
    suction = RHO / 2 * float(((v_x**2 + v_y**2) * area).sum())
    assert wall_effects.pull(HULL, RHO, distance_m)[0] == pytest.approx(suction, rel=0.01)


def test_wall_table_equals_integral_minus_far_value() -> None:
    rest = wall_effects.pull(HULL, RHO, FIELD.walls.far_m)
    assert rest[0] < 0.003 * FIELD.walls.pull_kgpm[-1]
    for distance_m in (0.3, 0.5, 1.0, 2.0):
        state = flight.cruising()
        state[2] = -50.0
        force = -pulled(state, Water(floor_m=-50.0 - distance_m))
        exact = np.array(wall_effects.pull(HULL, RHO, distance_m)) - rest
        assert force[2] / 1.3**2 == pytest.approx(exact[0], rel=0.01)
        assert force[4] / 1.3**2 == pytest.approx(-exact[1], rel=0.02, abs=1e-3)


def test_floor_ice_and_surface_attract_equally() -> None:
    state = flight.cruising()
    state[2] = -1.0
    up = pulled(state, Water(surface_m=50.0, ceiling_m=0.0))
    down = pulled(state, Water(surface_m=50.0, floor_m=-2.0))
    assert up[2] > 1.0
    np.testing.assert_allclose(down, -up, atol=1e-9)
    np.testing.assert_allclose(pulled(state, Water()), up, atol=1e-12)


def test_surface_suction_vanishes_at_speed_but_not_under_ice() -> None:
    state = flight.cruising(boundary.SOFT_FROUDE * math.sqrt(H.gravity_mps2 * 1.0) + 0.01)
    state[2] = -1.0
    assert pulled(state, Water())[2] == 0.0
    assert pulled(state, Water(ceiling_m=0.0, surface_m=9.0))[2] > 1.0


def test_hull_at_rest_in_water_has_no_suction() -> None:
    state = flight.cruising()
    state[2] = -1.0
    np.testing.assert_array_equal(pulled(state, Water(velocity_mps=(1.3, 0.0, 0.0))), 0.0)


@given(
    st.tuples(*[st.floats(-1.0, 1.0)] * 6),
    st.floats(0.3, 3.0),
    st.floats(-0.6, 0.6),
    st.floats(-3.0, 3.0),
    st.sampled_from(["floor", "slope", "ice"]),
)
def test_wall_suction_has_zero_power(
    nu: tuple[float, ...], distance_m: float, pitch: float, roll: float, wall: str
) -> None:
    state = flight.cruising()
    state[2] = -50.0
    c, s, cr, sr = math.cos(pitch / 2), math.sin(pitch / 2), math.cos(roll / 2), math.sin(roll / 2)
    state[3:7] = c * cr, c * sr, s * cr, -s * sr
    state[7:13] = nu
    normal = tuple(SLOPE.tolist()) if wall == "slope" else (0.0, 0.0, 1.0)
    ice = wall == "ice"
    water = (
        Water(ceiling_m=-50.0 + distance_m)
        if ice
        else Water(floor_m=-50.0 - distance_m, floor_normal=normal)
    )
    force = pulled(state, water)
    assert force @ state[7:13] == pytest.approx(0.0, abs=1e-9 * (1.0 + np.abs(force).max()))


def spring_j(model: VehicleModel, track: Vector, floor_m: float, normal: Vector) -> Vector:
    """Return the energy in the contact springs of both ends, J."""
    h = model.hydrostatics
    arm = h.half_length_m - h.radius_m
    stiffness = 0.5 * h.weight_n / h.gravity_mps2 * boundary.CONTACT_STIFFNESS_PER_S2
    stored = np.zeros(len(track))
    for i, state in enumerate(track):
        forward = flight.rotation(state)[:, 0]
        for x in (arm, -arm):
            gap = (state[:3] + x * forward - (0.0, 0.0, floor_m)) @ normal - h.radius_m
            stored[i] += 0.5 * stiffness * min(0.0, gap) ** 2
    return stored


def thrown(normal: Vector) -> tuple[VehicleModel, Vector]:
    """Return model and track of a hull without drag that sinks onto a floor.

    As in the simulator, the height of the floor under the hull is updated every tick.
    """
    model, state = frictionless(FIELD), flight.cruising()
    heavy = model.hydrostatics._replace(weight_n=1.01 * model.hydrostatics.buoyancy_n)
    model = model._replace(hydrostatics=heavy)
    state[2] = FLOOR_M + 1.0
    state[3:7] = math.cos(0.1), 0.0, math.sin(0.1), 0.0
    state[7:13] = 1.0, 0.2, -0.3, 0.1, 0.05, -0.02
    tracks = []
    for _ in range(round(30.0 / 0.02)):
        under = FLOOR_M - float(state[:2] @ normal[:2]) / normal[2]
        flown = flight.fly(
            model, state, 0.02, water=Water(floor_m=under, floor_normal=tuple(normal.tolist()))
        )
        state = flown[-1]
        tracks.append(flown[:-1])
    return model, np.concatenate(tracks)


@pytest.mark.parametrize("normal", [np.array([0.0, 0.0, 1.0]), SLOPE], ids=["level", "slope"])
def test_hull_impact_on_floor_loses_energy(normal: Vector) -> None:
    """The total energy of body, water and springs does not increase, within 1 %."""
    model, track = thrown(normal)
    stored = spring_j(model, track, FLOOR_M, normal)
    total = energy.mechanical_j(model, track) + stored
    assert stored.max() > 1.0
    assert (total - np.minimum.accumulate(total)).max() < 0.01 * np.ptp(total)
    assert total[-1] < total[0] - 100.0


def test_ice_holds_buoyant_vehicle_level_below_it() -> None:
    track = flight.fly(FIELD, dynamics.state_at_rest(-3.0), 120.0, water=Water(ceiling_m=-0.5))
    assert track[-1, 2] == pytest.approx(-0.5 - H.radius_m, abs=0.005)
    assert track[:, 2].max() < -0.5 - H.radius_m + 0.02
    np.testing.assert_allclose(track[-1, 7:], 0.0, atol=1e-3)
