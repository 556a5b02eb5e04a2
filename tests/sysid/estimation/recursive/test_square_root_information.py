"""Knowledge that grows row by row, against the same rows all at once."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from sysid.estimation.recursive import square_root_information

SIZE = 4


def belief(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    root = rng.standard_normal((SIZE, SIZE)) + 3.0 * np.eye(SIZE)
    return rng.standard_normal(SIZE), root @ root.T


@given(seed=st.integers(0, 1000), blocks=st.lists(st.integers(1, 7), min_size=1, max_size=8))
@settings(max_examples=40)
def test_rows_taken_one_block_at_a_time_are_least_squares_with_a_prior(
    seed: int, blocks: list[int]
) -> None:
    rng = np.random.default_rng(seed)
    mean, covariance = belief(rng)
    rows, values = rng.standard_normal((sum(blocks), SIZE)), rng.standard_normal(sum(blocks))
    known, at = square_root_information.from_normal(mean, covariance), 0
    for block in blocks:
        known = square_root_information.absorb(
            known, rows[at : at + block], values[at : at + block]
        )
        at += block
    precision = np.linalg.inv(covariance)
    expected = np.linalg.inv(rows.T @ rows + precision)
    np.testing.assert_allclose(
        square_root_information.covariance(known), expected, rtol=1e-8, atol=1e-10
    )
    weighed = expected @ (rows.T @ values + precision @ mean)
    np.testing.assert_allclose(square_root_information.mean(known), weighed, rtol=1e-8, atol=1e-8)


@given(
    seed=st.integers(0, 1000),
    scale=st.floats(1e-6, 1e6),
    copies=st.integers(1, 200),
)
@settings(max_examples=40)
def test_a_covariance_keeps_its_positive_sign_and_only_shrinks(
    seed: int, scale: float, copies: int
) -> None:
    """Also where one direction is told of a million times better than the others."""
    rng = np.random.default_rng(seed)
    mean, covariance = belief(rng)
    known = square_root_information.from_normal(mean, covariance)
    row = scale * rng.standard_normal((1, SIZE))
    for _ in range(copies):
        known = square_root_information.absorb(known, row, rng.standard_normal(1))
    left = square_root_information.covariance(known)
    prior = (row @ covariance @ row.T).item()
    spread = float(np.sum(np.linalg.solve(known.root.T, row[0]) ** 2))
    assert (
        abs(spread / (prior / (1.0 + copies * prior)) - 1.0) < 1e-9
    )  # Sherman and Morrison, of the same row repeated
    smallest, *_, largest = np.linalg.eigvalsh(left)
    assert (
        smallest > -4.0 * np.finfo(float).eps * largest
    )  # an eigenvalue is computed no closer than this
    assert np.all(np.diag(left) <= np.diag(covariance) * (1.0 + 1e-6))


def test_two_pieces_together_tell_what_both_told() -> None:
    rng = np.random.default_rng(1)
    mean, covariance = belief(rng)
    rows, values = rng.standard_normal((9, SIZE)), rng.standard_normal(9)
    first = square_root_information.absorb(
        square_root_information.from_normal(mean, covariance), rows[:4], values[:4]
    )
    second = square_root_information.absorb(
        square_root_information.empty(SIZE), rows[4:], values[4:]
    )
    at_once = square_root_information.absorb(
        square_root_information.from_normal(mean, covariance), rows, values
    )
    together = square_root_information.combine(first, second)
    np.testing.assert_allclose(
        square_root_information.mean(together), square_root_information.mean(at_once), rtol=1e-10
    )
    np.testing.assert_allclose(
        square_root_information.covariance(together),
        square_root_information.covariance(at_once),
        rtol=1e-10,
    )
