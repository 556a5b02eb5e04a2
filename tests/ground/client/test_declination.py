"""A magnetic declination of another place is remarked before a dive."""

import pytest

from ground.client import declination

KIEL, BOSTON, WELLINGTON = (54.3, 10.2), (42.4, -71.1), (-41.3, 174.8)


@pytest.mark.parametrize(
    ("set_deg", "place", "local_deg"),
    [(-14.4, BOSTON, None), (-14.4, KIEL, 4.0), (4.0, KIEL, None), (-14.4, WELLINGTON, 23.0)],
)
def test_declination_of_another_place_is_remarked(
    set_deg: float, place: tuple[float, float], local_deg: float | None
) -> None:
    """The declinations are those of the World Magnetic Model, 2020 to 2025, within a degree."""
    text = declination.remark({"MAG_DECL_DEG": set_deg}, *place)
    assert bool(text) == (local_deg is not None)
    if local_deg is not None:
        assert "deg too small" in text
        assert float(text.split()[2]) == pytest.approx(local_deg - set_deg, abs=1.5)
        assert float(text.split()[-1]) == pytest.approx(local_deg, abs=1.0)


def test_declination_near_the_antimeridian_and_unknown_parameter() -> None:
    assert declination.remark({}, *KIEL) == ""
    text = declination.remark({"MAG_DECL_DEG": 175.0}, 85.0, -140.0)
    assert "deg too" in text
    assert 3.0 <= float(text.split()[2]) <= 180.0
