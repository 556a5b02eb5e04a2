"""Machine code belongs to the content of its sources, and kernels run without numba too."""

import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from mavlink_io import jit, jit_numba

OUTER = """
from sitl.{folder}.inner import scaled
from mavlink_io.jit import entry_point


@entry_point
def doubled(x):
    return scaled(x, 2.0)
"""
INNER = """
from mavlink_io.jit import kernel


@kernel
def scaled(x, factor):
    return factor * x
"""
CALL = """
import sys
import sitl
sitl.__path__.append(sys.argv[1])
from sitl.{folder}.outer import doubled
print(doubled(3.0), sum(doubled.stats.cache_hits.values()))
"""


@pytest.fixture
def package(tmp_path):
    """A package of two files with kernels, one of which calls the other."""
    folder = tmp_path / "kernels_of_test"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "inner.py").write_text(INNER)
    (folder / "outer.py").write_text(OUTER.format(folder=folder.name))
    return folder


def call(package: Path) -> str:
    """Result and number of cache hits of the outer kernel in a new process."""
    command = [sys.executable, "-c", CALL.format(folder=package.name), str(package.parent)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def test_unchanged_sources_are_not_compiled_again(package):
    assert call(package) == "6.0 0"
    assert call(package) == "6.0 1"


def test_machine_code_from_disk_loads_no_compiler_library(package):
    """numba.np.linalg: one of the implementations that numba imports before it compiles."""
    loaded = "print('numba.np.linalg' in sys.modules)"
    command = [sys.executable, "-c", CALL.format(folder=package.name) + loaded, str(package.parent)]
    outputs = [
        subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
        for _ in range(2)
    ]
    assert outputs == [["6.0", "0", "True"], ["6.0", "1", "False"]]


def test_machine_code_is_stored_after_the_first_call_only(package):
    """Before it, an autopilot flies plain Python instead of compiling for a minute."""
    asked = "from mavlink_io import jit; print(jit.is_stored(doubled))"
    before = CALL.replace("print(doubled(3.0), sum(doubled.stats.cache_hits.values()))", asked)
    command = [sys.executable, "-c", before.format(folder=package.name), str(package.parent)]

    def stored() -> str:
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    assert stored() == "False"
    call(package)
    assert stored() == "True"
    (package / "inner.py").write_text(INNER.replace("factor * x", "factor + x"))
    assert stored() == "False", "the content of an inner kernel counts"


def test_newer_files_of_the_same_content_are_not_compiled_again(package):
    call(package)
    for source in package.glob("*.py"):
        os.utime(source, ns=(2 * 10**18, 2 * 10**18))
    assert call(package) == "6.0 1"


def test_a_change_of_a_called_kernel_in_another_file_is_noticed(package):
    call(package)
    (package / "inner.py").write_text(INNER.replace("factor * x", "factor * x + 1.0"))
    assert call(package) == "7.0 0"


class One(NamedTuple):
    number: float


class Two(NamedTuple):
    number: float


def test_cache_index_names_only_its_own_type():
    # Reading an index imports the modules of all types in it; the simulator would import modules
    # that it does not need.
    for kind in (One, Two):
        jit.native(kind(1.0))
    packer = jit_numba._packer(One)
    pack = packer.py_func
    name = f"jit_numba.{pack.__qualname__}-{pack.__code__.co_firstlineno}.*.nbi"
    (content,) = [index.read_bytes() for index in Path(packer.stats.cache_path).glob(name)]
    assert b"One" in content
    assert b"Two" not in content


class Wave(NamedTuple):
    height: float
    period: int
    crest: One


@jit.numeric
def raised(wave: Wave, height: float) -> Wave:
    higher = wave._replace(crest=wave.crest._replace(number=-height), height=height)
    return higher._replace(period=2)


@jit.entry_point
def raised_in_machine_code(wave: Wave, height: float) -> Wave:
    return raised(wave, height)


def test_numeric_function_is_called_by_kernels_and_is_itself_in_python():
    wave = Wave(1.0, 1, One(0.5))
    assert type(raised).__name__ == "function"
    assert raised_in_machine_code(wave, 3.0) == raised(wave, 3.0) == Wave(3.0, 2, One(-3.0))


@jit.entry_point
def height_of(wave: jit.Native, factor: float) -> float:
    return factor * wave.value.height


def test_machine_code_without_a_look_at_types_gives_the_same():
    wave = jit.native(Wave(1.5, 1, One(0.5)))
    code = jit.machine_code(height_of, wave, 1.0)
    assert code is not height_of
    assert code(wave, 3.0) == height_of(wave, 3.0) == 4.5


def make_levels(*fields: str) -> type:
    """Return a new NamedTuple class; each has the name Levels."""
    return NamedTuple("Levels", [(field, float) for field in fields])  # type: ignore[misc]


Sea, Air = make_levels("depth", "swell"), make_levels("height", "wind")


@jit.entry_point
def swell_of(levels: jit.Native) -> float:
    return levels.value.swell


@jit.entry_point
def wind_of(levels: jit.Native) -> float:
    return levels.value.wind


def test_references_to_two_records_of_one_name_are_told_apart():
    assert swell_of(jit.native(Sea(1.0, 2.0))) == 2.0
    assert wind_of(jit.native(Air(3.0, 4.0))) == 4.0


def test_replacing_a_field_of_a_kernel_does_not_change_the_record():
    wave = Wave(1.0, 1, One(0.5))
    raised_in_machine_code(wave, 3.0)
    assert wave == Wave(1.0, 1, One(0.5))


WITHOUT_NUMBA = """
import sys
sys.modules["numba"] = None
import importlib.util
found = importlib.util.find_spec
importlib.util.find_spec = lambda name: None if name == "numba" else found(name)
"""
PLAIN = """
from typing import NamedTuple
from mavlink_io import jit

class Pair(NamedTuple):
    a: float
    b: float

@jit.kernel
def total(pair):
    return pair.a + pair.b

@jit.entry_point
def total_of(reference):
    return total(reference.value)

pair = jit.native(Pair(1.0, 2.0))
print(jit.COMPILED, type(total).__name__, jit.machine_code(total_of, pair)(pair))
"""


@pytest.mark.parametrize(
    "preparation", [WITHOUT_NUMBA, "import os; os.environ['NUMBA_DISABLE_JIT'] = '1'"]
)
def test_kernels_are_plain_functions_without_numba(preparation):
    command = [sys.executable, "-c", preparation + PLAIN]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert output.strip() == "False function 3.0"
