"""Square-root information updated row by row, against all rows at once."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from sysid.estimation.recursive import square_root_information
from sysid.estimation.recursive.square_root_information import Information

SIZE = 4


def covariance_of(information: Information) -> np.ndarray:
    inverse = np.linalg.inv(information.root)
    return np.asarray(inverse @ inverse.T)


def random_prior(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    root = rng.standard_normal((SIZE, SIZE)) + 3.0 * np.eye(SIZE)
    return rng.standard_normal(SIZE), root @ root.T


@given(seed=st.integers(0, 1000), blocks=st.lists(st.integers(1, 7), min_size=1, max_size=8))
@settings(max_examples=40)
def test_absorb_blocks_of_rows_matches_least_squares(seed: int, blocks: list[int]) -> None:
    rng = np.random.default_rng(seed)
    mean, covariance = random_prior(rng)
    rows, values = rng.standard_normal((sum(blocks), SIZE)), rng.standard_normal(sum(blocks))
    information, row = square_root_information.from_normal(mean, covariance), 0
    for block in blocks:
        information = square_root_information.absorb(
            information, rows[row : row + block], values[row : row + block]
        )
        row += block
    precision = np.linalg.inv(covariance)
    expected = np.linalg.inv(rows.T @ rows + precision)
    np.testing.assert_allclose(covariance_of(information), expected, rtol=1e-8, atol=1e-10)
    expected_mean = expected @ (rows.T @ values + precision @ mean)
    np.testing.assert_allclose(
        square_root_information.mean(information), expected_mean, rtol=1e-8, atol=1e-8
    )


@given(
    seed=st.integers(0, 1000),
    scale=st.floats(1e-6, 1e6),
    copies=st.integers(1, 200),
)
@settings(max_examples=40)
def test_absorb_repeated_rows_keeps_covariance_positive(
    seed: int, scale: float, copies: int
) -> None:
    """The scale of one direction is up to a million times that of the others."""
    rng = np.random.default_rng(seed)
    mean, covariance = random_prior(rng)
    information = square_root_information.from_normal(mean, covariance)
    row = scale * rng.standard_normal((1, SIZE))
    for _ in range(copies):
        information = square_root_information.absorb(information, row, rng.standard_normal(1))
    posterior = covariance_of(information)
    prior = (row @ covariance @ row.T).item()
    row_variance = float(np.sum(np.linalg.solve(information.root.T, row[0]) ** 2))
    assert (
        abs(row_variance / (prior / (1.0 + copies * prior)) - 1.0) < 1e-9
    )  # Sherman and Morrison, of the same row repeated
    smallest, *_, largest = np.linalg.eigvalsh(posterior)
    assert (
        smallest > -4.0 * np.finfo(float).eps * largest
    )  # an eigenvalue is computed no closer than this
    assert np.all(np.diag(posterior) <= np.diag(covariance) * (1.0 + 1e-6))


def test_combine_matches_all_rows_at_once() -> None:
    rng = np.random.default_rng(1)
    mean, covariance = random_prior(rng)
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
        covariance_of(together),
        covariance_of(at_once),
        rtol=1e-10,
    )
