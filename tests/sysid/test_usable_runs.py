"""Tests of a log that cannot be used."""

from pathlib import Path

import pytest

from sysid import refit
from sysid.refit import RefitRequest


def test_rejected_tests_with_the_same_reason_are_listed_once(tmp_path: Path) -> None:
    """Rows at 4 Hz are too slow for every test."""
    rows = ["time_s,heading_deg,rudder_deg,thrust_pct,test"]
    for k in range(4 * 120):
        time_s = k / 4
        deflected = 40.0 <= time_s < 50.0 or 90.0 <= time_s < 100.0
        rows.append(f"{time_s},{10.0 + 0.01 * k},{4.0 * deflected},60,{'rudder' * deflected}")
    path = tmp_path / "slow.csv"
    path.write_text("\n".join(rows) + "\n")
    with pytest.raises(
        refit.RefitError,
        match=r"every test was screened out: slow\.csv/1, slow\.csv/2 gap: 0\.25 s[^;]*$",
    ):
        refit.refit(RefitRequest(paths=[path]))
