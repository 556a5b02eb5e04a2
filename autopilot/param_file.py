"""Parameter files: one ``NAME,VALUE`` or ``NAME VALUE`` per line; ``#`` starts a comment."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from autopilot.control.params import ParamError, validate
from mavlink_io.text_files import read_text


def load(path: Path) -> dict[str, float]:
    """Return all values in a parameter file.

    Raises ParamError with file, line and reason at the first line that is not valid.
    """
    try:
        text = read_text(path)
    except (OSError, UnicodeDecodeError) as error:
        raise ParamError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    values = {}
    for number, name, value in lines(text):
        if isinstance(value, ParamError):
            raise ParamError(f"{path}:{number}: {value}")
        values[name] = value
    return values


def lines(text: str) -> Iterator[tuple[int, str, float | ParamError]]:
    """Yield line number, name and value of each line; a ParamError instead of a bad value."""
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
    """Return the text of a parameter file, with the nine digits that identify a float32."""
    return "".join(f"{name},{value:.9g}\n" for name, value in sorted(values.items()))
