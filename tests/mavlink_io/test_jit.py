"""Machine code belongs to the content of its sources, and kernels run without numba too.

The processes of these tests print whether numba was imported, that is, whether something was
compiled.
"""

import inspect
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from mavlink_io import jit, jit_stored
from mavlink_io.stored_code import object_file, store
from mavlink_io.stored_code.store import Source

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
print(doubled(3.0), 'numba' in sys.modules)
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A package of two files with kernels, one of which calls the other."""
    folder = tmp_path / "kernels_of_test"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "inner.py").write_text(INNER)
    (folder / "outer.py").write_text(OUTER.format(folder=folder.name))
    return folder


def call(package: Path) -> str:
    """Result of the outer kernel in a new process, and whether it was compiled."""
    command = [sys.executable, "-c", CALL.format(folder=package.name), str(package.parent)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def test_unchanged_sources_are_not_compiled_again(package: Path) -> None:
    assert call(package) == "6.0 True"
    assert call(package) == "6.0 False"


WITH_A_FLOAT_AND_A_RECORD = """
import numpy
from sitl.{folder}.records import Pair, swapped
pair, row, total = swapped(Pair(1.0, 2), numpy.arange(3.0), numpy.random.default_rng(1))
print(pair, row.tolist(), total, 'numba' in sys.modules)
"""
RECORDS = """
from typing import NamedTuple
import numpy as np
from mavlink_io.jit import entry_point


class Pair(NamedTuple):
    a: float
    b: int


@entry_point
def swapped(pair, row, generator, offset=0.5):
    if pair.b < 0:
        raise ValueError("negative")
    out = np.zeros(len(row))
    for i in range(len(row)):
        out[i] = row[-1 - i]
    return pair._replace(b=pair.b + 1), out, generator.standard_normal() + offset
"""


def test_stored_code_of_records_and_arrays_gives_the_same(package: Path) -> None:
    (package / "records.py").write_text(RECORDS)
    imports = CALL.partition("from sitl")[0] + WITH_A_FLOAT_AND_A_RECORD
    command = [sys.executable, "-c", imports.format(folder=package.name), str(package.parent)]
    compiled, stored = (
        subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
        for _ in range(2)
    )
    assert compiled[:-1] == stored[:-1]
    assert (compiled[-1], stored[-1]) == ("True", "False")


def test_stored_code_raises_the_exceptions_of_its_source(package: Path) -> None:
    (package / "records.py").write_text(RECORDS)
    imports = CALL.partition("from sitl")[0] + WITH_A_FLOAT_AND_A_RECORD
    code = imports.replace("Pair(1.0, 2)", "Pair(1.0, -2)").format(folder=package.name)
    command = [sys.executable, "-c", code, str(package.parent)]
    errors = [subprocess.run(command, capture_output=True, text=True).stderr for _ in range(2)]
    assert all(error.endswith("ValueError: negative\n") for error in errors)


INTERRUPTED = """
import pickle, signal
from mavlink_io import jit_stored

class CtrlC(BaseException): pass

class Pickle:
    @staticmethod
    def loads(data):
        signal.raise_signal(signal.SIGINT)
        return pickle.loads(data)

def interrupt(*_):
    raise CtrlC

signal.signal(signal.SIGINT, interrupt)
jit_stored.pickle = Pickle
given = Pair(1.0, 2), numpy.arange(3.0), numpy.random.default_rng(1)
try:
    swapped(*given)
except CtrlC:
    jit_stored.pickle = pickle
    print("interrupted", swapped(*given)[0], 'numba' in sys.modules)
"""


def test_signal_at_the_first_call_of_stored_code_is_raised(package: Path) -> None:
    """An exception in a call by compiled code would be lost, and the result NULL."""
    (package / "records.py").write_text(RECORDS)
    imports = CALL.partition("from sitl")[0] + WITH_A_FLOAT_AND_A_RECORD
    for code in (imports, imports.partition("pair, row")[0] + INTERRUPTED):
        command = [sys.executable, "-c", code.format(folder=package.name), str(package.parent)]
        output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert output.strip() == "interrupted Pair(a=1.0, b=3) False"


def test_damaged_store_is_compiled_again(package: Path) -> None:
    call(package)
    (stored,) = (package / "__pycache__").glob("outer.doubled.*.kernel")
    content = stored.read_bytes()
    for damaged in (b"", content[: len(content) // 2], b"\0" * len(content)):
        stored.write_bytes(damaged)
        assert call(package) == "6.0 True"
        assert call(package) == "6.0 False"


RECORD_KERNEL = """
from typing import NamedTuple
from mavlink_io import jit

class {name}(NamedTuple):
    value: float

@jit.entry_point
def half(record):
    return 0.5 * record.value

print(half({name}(3.0)))
"""


def test_index_of_a_class_with_another_name_now_is_left_out(tmp_path: Path) -> None:
    """As after an update of the program: pickle finds no class of the name in the index."""
    (tmp_path / "halves").mkdir()
    for name in ("Old", "New", "New"):
        path = tmp_path / "halves" / "__init__.py"
        path.write_text(RECORD_KERNEL.format(name=name))
        printed = subprocess.run(
            [sys.executable, "-c", "import halves"],
            check=True,
            capture_output=True,
            text=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])},
        )
        assert printed.stdout.strip() == "1.5", name


@pytest.mark.skipif(not store.is_supported(), reason="numba loads its own files here")
def test_kernel_with_a_default_is_stored_for_each_way_to_call_it() -> None:
    assert [shifted(1.0), shifted(1.0, 2.0), shifted(1.0, offset=3.0)] == [1.5, 3.0, 4.0]
    stored = store.stored_types(Source(Path(__file__), "shifted"))
    assert sorted(stored) == ["(f8;f8)", "(f8;omitted)"]
    with pytest.raises(TypeError, match="shifted"):
        shifted(1.0, other=2.0)  # type: ignore[call-arg]


def test_functions_that_a_function_makes_are_told_apart() -> None:
    def multiplier(factor: float) -> Callable[[float], float]:
        @jit.entry_point
        def multiplied(value: float) -> float:
            return factor * value

        return multiplied

    assert [multiplier(2.0)(3.0), multiplier(5.0)(3.0)] == [6.0, 15.0]


def test_arrays_may_be_named_arguments() -> None:
    assert scaled(factor=2.0, values=np.arange(3.0)).tolist() == [0.0, 2.0, 4.0]
    with pytest.raises(TypeError, match="scaled"):
        scaled(values=np.arange(3.0))  # type: ignore[call-arg]


@jit.entry_point
def scaled(values: NDArray[np.float64], factor: float) -> NDArray[np.float64]:
    return factor * values


def test_types_without_a_name_are_left_to_numba() -> None:
    number = np.float32(1.5)
    assert [shifted(number), shifted(number, 2.0)] == [2.0, 3.5]  # type: ignore[arg-type]
    assert jit.machine_code(shifted, number, 2.0)(number, 2.0) == 3.5  # type: ignore[arg-type]


@pytest.mark.skipif(not store.is_supported(), reason="numba loads its own files here")
def test_code_that_cannot_be_placed_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError("no memory may be executed")

    assert shifted(7.0) == 7.5
    monkeypatch.setattr(object_file, "place", refuse)
    fresh = jit_stored.compiled(inspect.unwrap(shifted), inline=False)
    assert fresh(7.0) == 7.5


@jit.entry_point
def shifted(value: float, offset: float = 0.5) -> float:
    return value + offset


@pytest.mark.skipif(not store.is_supported(), reason="numba loads its own files here")
def test_object_file_with_another_relocation_is_refused() -> None:
    shifted(1.0, 2.0)
    code = store.find(Source(Path(__file__), "shifted"), "(f8;f8)")
    assert code is not None
    content = bytearray(code.content)
    for section in object_file._sections(code.content):
        if section.kind == object_file._RELOCATIONS:
            content[section.offset + 8] = 11  # R_X86_64_32S, first relocation of the section
    with pytest.raises(ValueError, match="relocation type 11"):
        object_file.place(bytes(content), lambda name: 1)
    with pytest.raises(ValueError, match="ELF"):
        object_file.place(b"text" * 100, lambda name: 1)


def test_machine_code_is_stored_after_the_first_call_only(package: Path) -> None:
    """Before it, an autopilot flies plain Python instead of compiling for a minute."""
    asked = "from mavlink_io import jit; print(jit.is_stored(doubled))"
    before = CALL.replace("print(doubled(3.0), 'numba' in sys.modules)", asked)
    command = [sys.executable, "-c", before.format(folder=package.name), str(package.parent)]

    def stored() -> str:
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    assert stored() == "False"
    call(package)
    assert stored() == "True"
    (package / "inner.py").write_text(INNER.replace("factor * x", "factor + x"))
    assert stored() == "False", "the content of an inner kernel counts"


def test_newer_files_of_the_same_content_are_not_compiled_again(package: Path) -> None:
    call(package)
    for source in package.glob("*.py"):
        os.utime(source, ns=(2 * 10**18, 2 * 10**18))
    assert call(package) == "6.0 False"


def test_a_change_of_a_called_kernel_in_another_file_is_noticed(package: Path) -> None:
    call(package)
    (package / "inner.py").write_text(INNER.replace("factor * x", "factor * x + 1.0"))
    assert call(package) == "7.0 True"


class One(NamedTuple):
    number: float


class Two(NamedTuple):
    number: float


def test_stored_code_names_only_its_own_type() -> None:
    # Loading it imports the modules of all types in it; the simulator would import modules that it
    # does not need.
    for kind in (One, Two):
        jit.native(kind(1.0))
    content = jit_stored._packer(One).source.path.read_bytes()
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


def test_numeric_function_is_called_by_kernels_and_is_itself_in_python() -> None:
    wave = Wave(1.0, 1, One(0.5))
    assert type(raised).__name__ == "function"
    assert raised_in_machine_code(wave, 3.0) == raised(wave, 3.0) == Wave(3.0, 2, One(-3.0))


@jit.entry_point
def height_of(wave: jit.Native, factor: float) -> float:
    height: float = wave.value.height
    return factor * height


def test_machine_code_without_a_look_at_types_gives_the_same() -> None:
    wave = jit.native(Wave(1.5, 1, One(0.5)))
    code = jit.machine_code(height_of, wave, 1.0)
    assert code is not height_of
    assert code(wave, 3.0) == height_of(wave, 3.0) == 4.5


def make_levels(*fields: str) -> type:
    """Return a new NamedTuple class; each has the name Levels."""
    return NamedTuple("Levels", [(field, float) for field in fields])  # type: ignore[return-value]


Sea, Air = make_levels("depth", "swell"), make_levels("height", "wind")


@jit.entry_point
def swell_of(levels: jit.Native) -> float:
    swell: float = levels.value.swell
    return swell


@jit.entry_point
def wind_of(levels: jit.Native) -> float:
    wind: float = levels.value.wind
    return wind


def test_references_to_two_records_of_one_name_are_told_apart() -> None:
    assert swell_of(jit.native(Sea(1.0, 2.0))) == 2.0
    assert wind_of(jit.native(Air(3.0, 4.0))) == 4.0


def test_replacing_a_field_of_a_kernel_does_not_change_the_record() -> None:
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
def test_kernels_are_plain_functions_without_numba(preparation: str) -> None:
    command = [sys.executable, "-c", preparation + PLAIN]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert output.strip() == "False function 3.0"
