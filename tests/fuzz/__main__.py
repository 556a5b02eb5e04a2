"""Coverage-guided fuzzing of one target with atheris (libFuzzer).

    python -m tests.fuzz TARGET [libFuzzer options and corpus folders]

TARGET is a link (ground, hil, file_transfer) or a reader. Needs ``pip install atheris``.
"""

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path


def main() -> None:
    """Fuzz the target that the first argument names."""
    import atheris

    with atheris.instrument_imports(include=["autopilot", "mavlink_io", "ground", "sitl", "sysid"]):
        from tests.fuzz.files import CORPUS, FILES
        from tests.fuzz.links import LinkFuzz

    links = LinkFuzz()
    targets: dict[str, Callable[[bytes], object]] = {
        "ground": links.ground,
        "hil": links.hil,
        "file_transfer": links.file_transfer,
    }
    name = sys.argv[1] if len(sys.argv) > 1 else ""
    with tempfile.TemporaryDirectory() as folder:
        for reader, target in FILES.items():
            path = Path(folder) / f"file{target.suffix}"
            targets[reader] = lambda data, path=path, target=target: target.run(data, path)  # type: ignore[misc]
        if name not in targets:
            sys.exit(f"python -m tests.fuzz: {name!r}: give one of {', '.join(targets)}")
        corpus = [str(CORPUS / name)] if (CORPUS / name).is_dir() else []
        atheris.Setup(
            [sys.argv[0], *sys.argv[2:], *corpus], lambda data: targets[name](data) and None
        )
        atheris.Fuzz()


if __name__ == "__main__":
    main()
