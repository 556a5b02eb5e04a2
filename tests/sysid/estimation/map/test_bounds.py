"""Parameters at a bound: which of them are a failure of the fit, and which a note."""

import numpy as np
import pytest

from sysid.estimation.map import bounds
from sysid.estimation.map.gauss_newton import Z_LIMIT
from sysid.models.parameters import BENCH_TEST_SD, NAMES

ASSUMED_SD = 0.3


def z_at(**values: float) -> np.ndarray:
    """Return z with some parameters at their upper (1) or lower (-1) bound."""
    z = np.zeros(len(NAMES))
    for name, sign in values.items():
        z[NAMES.index(name)] = sign * Z_LIMIT
    return z


def test_backlash_of_none_is_a_result() -> None:
    """Backlash is a ratio to the prior.

    A tailcone without backlash is at its lower bound, 0.0013 deg.
    """
    assert bounds.reached(z_at(backlash=-1), BENCH_TEST_SD).decisive == ()
    assert not bounds.reached(z_at(backlash=-1), BENCH_TEST_SD).notes
    assert bounds.reached(z_at(Y_v=-1, backlash=1), BENCH_TEST_SD).decisive == ("Y_v", "backlash")


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("name", [*bounds.NONLINEAR, *bounds.ACROSS])
def test_parameter_off_the_crossover_is_a_note(name: str, sign: int) -> None:
    z = z_at(N_v=1, **{name: sign})
    assert bounds.reached(z, BENCH_TEST_SD).decisive == ("N_v",)
    (note,) = bounds.reached(z, BENCH_TEST_SD).notes
    assert note.startswith(f"{name} at a bound")


def test_servo_faster_than_assumed_is_a_note() -> None:
    z = z_at(natural_frequency=1)
    assert bounds.reached(z, ASSUMED_SD).decisive == ()
    (note,) = bounds.reached(z, ASSUMED_SD).notes
    assert "faster than the file assumes" in note


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("name", bounds.DRIVE_RATIOS)
def test_drives_of_assumed_lag_may_differ(name: str, sign: int) -> None:
    z = z_at(**{name: sign})
    assert bounds.reached(z, ASSUMED_SD).decisive == ()
    (note,) = bounds.reached(z, ASSUMED_SD).notes
    assert "rudder and elevator differ" in note
    assert bounds.reached(z, BENCH_TEST_SD).decisive == (name,)


@pytest.mark.parametrize(("sign", "lag_sd"), [(-1, ASSUMED_SD), (1, BENCH_TEST_SD), (-1, 0.05)])
def test_servo_slower_or_against_bench_test_fails(sign: int, lag_sd: float) -> None:
    z = z_at(natural_frequency=sign)
    assert bounds.reached(z, lag_sd).decisive == ("natural_frequency",)
    assert not bounds.reached(z, lag_sd).notes


def test_parameters_inside_their_bounds_are_not_mentioned() -> None:
    z = 0.9 * z_at(**dict.fromkeys(NAMES, 1))
    assert bounds.reached(z, ASSUMED_SD).decisive == ()
    assert not bounds.reached(z, ASSUMED_SD).notes
