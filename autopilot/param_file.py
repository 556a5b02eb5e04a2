"""Parameter files: lines of ``NAME,VALUE`` or ``NAME VALUE``; ``#`` starts a comment."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from autopilot.control.params import ParamError, validate


def load(path: Path) -> dict[str, float]:
    """The values in a file that somebody names: all of them, or none.

    Raises:
        ParamError: naming file, line, and what is wrong with it.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ParamError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    values = {}
    for number, name, value in lines(text):
        if isinstance(value, ParamError):
            raise ParamError(f"{path}:{number}: {value}")
        values[name] = value
    return values


def lines(text: str) -> Iterator[tuple[int, str, float | ParamError]]:
    """Each line's number, name and value, or what is wrong with it."""
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split("#", 1)[0].replace(",", " ").split()
        if not words:
            continue
        try:
            name, digits = words
            yield number, name, validate(name, float(digits))
        except ParamError as error:
            yield number, "", error
        except ValueError:
            yield number, "", ParamError(f"expected NAME,VALUE, not {line.strip()!r}")


def to_text(values: Mapping[str, float]) -> str:
    """The file of some values, each as exact as a float32 is."""
    return "".join(f"{name},{value:.9g}\n" for name, value in sorted(values.items()))
