"""The packed parameter file, read by pymavlink's decoder."""

import string

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.mavftp import MAVFTP

from mavlink_io.services.param_file_ftp import PackedParameter, pack

names = st.text(string.ascii_uppercase[:3] + "_1", min_size=1, max_size=16)
reals = st.floats(width=32, allow_nan=False, allow_infinity=False)
lists = st.dictionaries(names, st.builds(PackedParameter, reals, reals), max_size=40)


@given(lists)
def test_param_file_values_and_defaults_are_equal(parameters: dict[str, PackedParameter]) -> None:
    read = MAVFTP.ftp_param_decode(pack(parameters, with_defaults=True))
    assert [(name.decode(), value) for name, value, _ in read.params] == [
        (name, parameters[name].value) for name in sorted(parameters)
    ]
    assert {name.decode(): value for name, value, _ in read.defaults or ()} == {
        name: parameter.default for name, parameter in parameters.items()
    }


@given(lists)
def test_param_file_without_defaults_contains_none(parameters: dict[str, PackedParameter]) -> None:
    read = MAVFTP.ftp_param_decode(pack(parameters))
    assert {name.decode(): value for name, value, _ in read.params} == {
        n: p.value for n, p in parameters.items()
    }
    assert not read.defaults


def test_param_file_names_share_prefix() -> None:
    rows = {f"LONG_NAME_{n:02d}": PackedParameter(float(n), 0.0) for n in range(20)}
    assert len(pack(rows)) < 20 * 8 + 30
    assert pack({}) == bytes.fromhex("1b6700000000")


@pytest.mark.parametrize("name", ["A" * 16, "A"])
def test_param_file_longest_and_shortest_name(name: str) -> None:
    read = MAVFTP.ftp_param_decode(
        pack(
            {
                "A" * 15 if len(name) > 1 else "AB": PackedParameter(1.0, 1.0),
                name: PackedParameter(2.0, 1.0),
            }
        )
    )
    assert {n.decode(): v for n, v, _ in read.params}[name] == 2.0
