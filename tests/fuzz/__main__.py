"""Coverage-guided fuzzing of one target with atheris (libFuzzer).

    python -m tests.fuzz TARGET [libFuzzer options and corpus folders]

TARGET is a link (ground, hil, file_transfer), a reader, or ``all``: every target in a process of
its own, one after the other. Needs ``pip install atheris``.
"""

import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

ALL = "all"
"""Name for all targets."""
LINKS = "ground", "hil", "file_transfer"
"""Targets on the links of the autopilot: methods of ``LinkFuzz``."""


def main() -> None:
    """Fuzz the target that the first argument names."""
    import atheris

    name = sys.argv[1] if len(sys.argv) > 1 else ""
    if name == ALL:
        from tests.fuzz.files import FILES

        sys.exit(fuzz_each([*LINKS, *FILES], sys.argv[2:]))
    with atheris.instrument_imports(include=["autopilot", "mavlink_io", "ground", "sitl", "sysid"]):
        from tests.fuzz.files import CORPUS, FILES
        from tests.fuzz.links import LinkFuzz

    links = LinkFuzz()
    targets: dict[str, Callable[[bytes], object]] = {link: getattr(links, link) for link in LINKS}
    with tempfile.TemporaryDirectory() as folder:
        for reader, target in FILES.items():
            path = Path(folder) / f"file{target.suffix}"
            targets[reader] = lambda data, path=path, target=target: target.run(data, path)  # type: ignore[misc]
        if name not in targets:
            sys.exit(f"python -m tests.fuzz: {name!r}: give {ALL} or one of {', '.join(targets)}")
        corpus = [str(CORPUS / name)] if (CORPUS / name).is_dir() else []
        atheris.Setup(
            [sys.argv[0], *sys.argv[2:], *corpus], lambda data: targets[name](data) and None
        )
        atheris.Fuzz()


def fuzz_each(names: list[str], options: list[str]) -> int:
    """Fuzz each target with the same options; return 1 if one has a defect."""
    failed = []
    for name in names:
        # libFuzzer adds what it finds to the first folder: not to the corpus of the repository
        with tempfile.TemporaryDirectory() as found:
            command = [sys.executable, "-m", "tests.fuzz", name, *options, found]
            done = subprocess.run(command, check=False, stderr=subprocess.PIPE, text=True)
        lines = done.stderr.splitlines()
        if done.returncode:
            failed.append(name)
            print("\n".join(lines[-40:]))
        runs = next((line for line in lines if line.startswith("Done ")), "ended early")
        print(f"{name}: {runs}", flush=True)
    print(f"{len(names) - len(failed)} of {len(names)} targets without a defect {' '.join(failed)}")
    return int(bool(failed))


if __name__ == "__main__":
    main()
