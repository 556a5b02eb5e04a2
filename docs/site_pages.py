"""Pages of the documentation that are generated from the code."""

from collections.abc import Iterator
from enum import Enum
from pathlib import Path

import typer
from reference_pages import files_page, messages_page, python_page
from typer.core import TyperArgument, TyperCommand, TyperGroup, TyperOption

from autopilot.cli import fly
from autopilot.control.params import LOCKED_WHILE_ARMED, PARAMETERS, ParamInfo
from ground.cli.main import app as ground_app
from sitl.cli import simulate

Command = TyperCommand | TyperGroup
ROOT = Path(__file__).parents[1]
PROJECT_PAGES = {
    "contributing": "CONTRIBUTING.md",
    "changelog": "CHANGELOG.md",
    "security": "SECURITY.md",
}
"""Pages of the site that show a file of the repository's root."""


def write_pages(folder: Path) -> None:
    """Write all generated pages; a page that has not changed keeps its time.

    Parameters
    ----------
    folder : Path
        Folder of the pages; created if it does not exist.
    """
    pages = {
        "command_line": command_line_page(),
        "parameters": parameters_page(),
        "messages": messages_page(),
        "files": files_page(),
        "python_reference": python_page(),
        **{name: _project_page(file) for name, file in PROJECT_PAGES.items()},
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in pages.items():
        path = folder / f"{name}.md"
        if not path.exists() or path.read_text("utf-8") != text:
            path.write_text(text, "utf-8")


def _project_page(file: str) -> str:
    """Return a file of the root with the links that the site has."""
    text = (ROOT / file).read_text("utf-8").replace("](docs/", "](../")
    for name, other in PROJECT_PAGES.items():
        text = text.replace(f"]({other}", f"]({name}.md")
    return text


def link_project_pages(text: str) -> str:
    """Return a page of docs with links to files of the root as links to the site's pages."""
    for name, file in PROJECT_PAGES.items():
        text = text.replace(f"](../{file}", f"](generated/{name}.md")
    return text


def programs() -> dict[str, Command]:
    """Return the command of each program by its name."""
    return {
        "ground": typer.main.get_command(ground_app),
        "autopilot": _command_of(fly),
        "sitl": _command_of(simulate),
    }


def _command_of(function: object) -> Command:
    """Return the command of a program that has one."""
    app = typer.Typer(add_completion=False)
    app.command()(function)  # type: ignore[type-var]
    return typer.main.get_command(app)


def command_line_page() -> str:
    """Return the page of all commands with their arguments and options."""
    sections = [
        section for name, command in programs().items() for section in _sections(name, command)
    ]
    return "\n".join(["# Command line", "", *sections])


def _sections(name: str, command: Command) -> Iterator[str]:
    """Yield a command's section, then those of its subcommands."""
    level = "#" * min(4, 1 + len(name.split()))
    yield f"{level} {name}\n\n{_text(command.help)}\n"
    if rows := [row for parameter in command.params for row in _row(parameter)]:
        yield "\n".join(["| option | value | meaning |", "|---|---|---|", *rows, ""])
    if isinstance(command, TyperGroup):
        for child, subcommand in sorted(command.commands.items()):
            yield from _sections(f"{name} {child}", subcommand)


def _row(parameter: TyperArgument | TyperOption) -> Iterator[str]:
    """Yield the row of an option or argument; nothing for --help."""
    if isinstance(parameter, TyperArgument):
        name = parameter.metavar or str(parameter.name).upper()
        yield f"| `{name}` | | {_cell(_text(parameter.help))} |".replace("``", "")
    elif not parameter.hidden and parameter.name != "help":
        names = ", ".join(f"`{name}`" for name in parameter.opts)
        value = "" if parameter.is_flag else _value(parameter)
        default = parameter.default
        shown = isinstance(default, str | int | float) and not isinstance(default, bool)
        text = _text(parameter.help) + (f" Default: `{_plain(default)}`." if shown else "")
        yield f"| {names} | {value} | {_cell(text)} |"


def _value(option: TyperOption) -> str:
    """Return the placeholder or the choices of an option's value."""
    kind = option.type_descriptor.annotation
    if option.metavar is None and isinstance(kind, type) and issubclass(kind, Enum):
        return ", ".join(f"`{choice.value}`" for choice in kind)
    placeholder = option.metavar or getattr(kind, "__name__", "value").upper()
    return f"`{placeholder}`".replace("|", "\\|")


def _plain(value: object) -> str:
    """Return a default or a choice as a user types it."""
    return str(getattr(value, "value", value))


def _text(help_text: str | None) -> str:
    """Return a help text on one line for each paragraph."""
    paragraphs = (help_text or "").replace("\b", "").split("\n\n")
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)


def _cell(text: str) -> str:
    """Return text for a cell of a table."""
    return " ".join(text.split()).replace("|", "\\|").replace("<", "\\<")


def parameters_page() -> str:
    """Return the page of the autopilot's parameters, in one table for each prefix."""
    groups: dict[str, list[ParamInfo]] = {}
    for parameter in PARAMETERS:
        groups.setdefault(parameter.name.partition("_")[0], []).append(parameter)
    lines = [
        "# Parameters",
        "",
        "Parameters of the autopilot, as `ground params` and every ground station show them. All",
        "values travel as MAVLink REAL32.",
    ]
    for prefix, parameters in sorted(groups.items()):
        lines += ["", f"## {prefix}", "", "| name | default | range | unit | meaning |"]
        lines += ["|---|---|---|---|---|", *map(_parameter_row, parameters)]
    return "\n".join([*lines, ""])


def _parameter_row(parameter: ParamInfo) -> str:
    """Return the row of a parameter."""
    locked = "; does not change while armed" if parameter.name in LOCKED_WHILE_ARMED else ""
    span = f"{parameter.minimum:g} to {parameter.maximum:g}"
    meaning = _cell(f"{parameter.doc}{locked}")
    return f"| `{parameter.name}` | {parameter.default:g} | {span} | {parameter.unit} | {meaning} |"
