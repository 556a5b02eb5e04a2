"""Cached machine code is never older than the source files it was compiled from."""

import importlib.util
import os
from pathlib import Path
from typing import NamedTuple

from sitl.vehicle import jit

SOURCE = """
from sitl.vehicle.jit import entry_point


@entry_point
def doubled(x):
    return 2.0 * x
"""


def load(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_cache_older_than_sources_is_removed(tmp_path):
    path = tmp_path / "doubling.py"
    path.write_text(SOURCE)
    assert load(path).doubled(2.0) == 4.0
    (index,) = tmp_path.rglob("doubling.doubled-*.nbi")
    os.utime(index, ns=(0, jit._NEWEST_PHYSICS_NS - 1))
    load(path)
    assert not index.exists()


def test_cache_newer_than_sources_is_used(tmp_path):
    path = tmp_path / "doubling.py"
    path.write_text(SOURCE)
    load(path).doubled(2.0)
    again = load(path).doubled
    assert again(2.0) == 4.0
    assert sum(again.stats.cache_hits.values()) == 1


class One(NamedTuple):
    number: float


class Two(NamedTuple):
    number: float


def test_cache_index_names_only_its_own_type():
    # Reading an index imports the modules of all types in it; the simulator would import modules
    # that it does not need.
    for kind in (One, Two):
        jit.native(kind(1.0))
    packer = jit._packer(One)
    indices = Path(packer.stats.cache_path).glob(f"jit.{packer.py_func.__qualname__}-*.nbi")
    (content,) = [index.read_bytes() for index in indices]
    assert b"One" in content
    assert b"Two" not in content
