"""Reference pages of messages, files and the Python interface, generated from the code."""

import inspect
import re
from collections.abc import Iterator
from functools import partial

import msgspec
from msgspec import inspect as kinds
from sphinx.pycode import ModuleAnalyzer

import caribou_auv
from autopilot.commands import commander
from autopilot.telemetry.streams import STREAMS, TelemetryStream
from ground.bench_tests.incline import IncliningPlan
from ground.campaign.summary_file import CampaignSummary
from ground.missions.script import Script
from ground.sweep.plan_file import SweepPlan
from mavlink_io.mission_items import MavCmd
from sitl.scenario import Scenario
from sitl.vehicle.file_schema import VehicleConfig
from sysid.design.specification import Spec
from sysid.models.model_file import IdentifiedModel

FILES: tuple[tuple[str, str, type[msgspec.Struct]], ...] = (
    ("Mission", "TOML file of `ground fly` ([tutorial](../tutorials/first_flight.md)).", Script),
    (
        "Vehicle",
        "TOML file of `--vehicle` and `--prior`. Most keys may be missing: `ground vehicle new`"
        " writes the others ([tutorial](../tutorials/own_vehicle.md)).",
        VehicleConfig,
    ),
    ("Scenario", "TOML file of `--scenario` ([scenarios](../scenarios.md)).", Scenario),
    (
        "Design specification",
        "TOML file of `ground redesign --spec`, and table `spec` of a sweep plan.",
        Spec,
    ),
    ("Sweep plan", "TOML file of `ground sweep` ([sweep](../sweep.md)).", SweepPlan),
    ("Inclining plan", "TOML file of `ground inclining-test --moves`.", IncliningPlan),
    ("model.json", "Result of `ground refit` ([explained](../model.md)).", IdentifiedModel),
    ("summary.json", "Result of `ground campaign` ([explained](../summary.md)).", CampaignSummary),
)
"""Title, text and root record of each file format."""


def messages_page() -> str:
    """Return the page of the telemetry and of the commands of the autopilot."""
    lines = [
        "# Messages",
        "",
        "Telemetry and commands of the autopilot, generated from its tables. Fields, units and",
        "enums are those of the MAVLink dialect `common`. [MAVLink interface](../mavlink.md)",
        "explains modes, missions, parameters and clients.",
        "",
        "## Telemetry",
        "",
        "Default rates of a link without bandwidth limit ([links](../links.md));",
        "SET_MESSAGE_INTERVAL changes them, REQUEST_MESSAGE asks for one message.",
        "",
        "| message | number | rate, Hz | content; fields |",
        "|---|---|---|---|",
        *map(_telemetry_row, sorted(STREAMS, key=lambda row: row.message.name)),
        "",
        "## Commands",
        "",
        "COMMAND_LONG and COMMAND_INT. Every other command is answered UNSUPPORTED.",
        "",
        "| command | number | effect |",
        "|---|---|---|",
        *(_command_row(number) for number in sorted(commander.HANDLERS)),
    ]
    return "\n".join([*lines, ""])


def _telemetry_row(row: TelemetryStream) -> str:
    """Return the row of a telemetry message."""
    rate = f"{row.rate_hz:g}" if row.rate_hz else "on request"
    text = inspect.getdoc(row.build) or ""
    content = _first_sentence(text.partition(row.message.name)[2].lstrip(": .;"))
    fields = " ".join(
        f"`{f.name}`" + (f" ({f.unit})" if f.unit else "") for f in row.message.fields
    )
    return f"| {row.message.name} | {row.message.message_id} | {rate} | {content}<br>{fields} |"


def _command_row(number: int) -> str:
    """Return the row of a command."""
    handler = commander.HANDLERS[number]
    if isinstance(handler, partial):
        text = f"Enter mode {handler.args[0].name}."
    else:
        text = _first_sentence(re.sub(r"^[A-Z0-9_, ]+: ", "", inspect.getdoc(handler) or ""))
    return f"| {MavCmd(number).name} | {number} | {text} |"


def _first_sentence(text: str) -> str:
    """Return the first paragraph of a docstring for the cell of a table."""
    paragraph = " ".join(text.split("\n\n")[0].split()).replace("``", "`").replace("|", "\\|")
    return paragraph[:1].upper() + paragraph[1:]


def python_page() -> str:
    """Return the page of the Python interface, with the docstring of each public name."""
    classes = [n for n in caribou_auv.__all__ if inspect.isclass(getattr(caribou_auv, n))]
    functions = [name for name in caribou_auv.__all__ if name not in classes]
    lines = [
        "# Python reference",
        "",
        "All names of `caribou_auv` and the pytest fixture, from their docstrings.",
        "[Python](../python.md) shows how to use them.",
        "",
        "## Functions",
        "",
        *(_autodoc("autofunction", name) for name in functions),
        "## Fixture",
        "",
        _autodoc("autoclass", "CaribouVehicle", ":members: fly", where="caribou_auv.pytest_plugin"),
        "## Records",
        "",
        *(_autodoc("autoclass", name, ":members:", ":undoc-members:") for name in classes),
    ]
    return "\n".join(lines)


def _autodoc(directive: str, name: str, *options: str, where: str = "caribou_auv") -> str:
    """Return the autodoc directive of a name under a heading."""
    options_text = "".join(f"   {option}\n" for option in options)
    return f"### {name}\n\n```{{eval-rst}}\n.. {directive}:: {where}.{name}\n{options_text}```\n"


def files_page() -> str:
    """Return the page of all file formats, with one table per record."""
    lines = [
        "# Files",
        "",
        "Keys of the files that users write and read, generated from the records that decode",
        "them. An unknown or missing key is an error that names file, key and value. A key without",
        "default is required, and one without text is what its name says, in the unit of its name.",
        "Logs: [logs](../logs.md).",
        "",
    ]
    seen: set[type] = set()
    for title, text, root in FILES:
        lines += [f"## {title}", "", text, ""]
        for record, path in _records(root, seen):
            lines += [*_record(record, path, title), ""]
    return "\n".join(lines)


def _records(root: type[msgspec.Struct], seen: set[type]) -> list[tuple[kinds.StructType, str]]:
    """Return a record and the records inside it that were not seen, with their paths."""
    first = kinds.type_info(root)
    assert isinstance(first, kinds.StructType)
    found = [(first, "")]
    seen.add(first.cls)
    for record, path in found:  # grows meanwhile: breadth first
        for field in record.fields:
            for inner, suffix in _structs(field.type):
                if inner.cls not in seen:
                    seen.add(inner.cls)
                    found.append((inner, f"{path}.{field.encode_name}{suffix}".lstrip(".")))
    return found


def _structs(kind: kinds.Type, suffix: str = "") -> Iterator[tuple[kinds.StructType, str]]:
    """Yield the records in a type, with ``[]`` for an element of a list and ``.*`` of a table."""
    match kind:
        case kinds.StructType():
            yield kind, suffix
        case kinds.UnionType(types=types) | kinds.TupleType(item_types=types):
            for inner in types:
                yield from _structs(inner, suffix)
        case kinds.ListType(item_type=inner) | kinds.VarTupleType(item_type=inner):
            yield from _structs(inner, suffix + "[]")
        case kinds.DictType(value_type=inner):
            yield from _structs(inner, suffix + ".*")


def _record(record: kinds.StructType, path: str, title: str) -> Iterator[str]:
    """Yield the heading and the table of a record."""
    yield f"({_anchor(record)})="
    yield f"### {title}: `{path}`" if path else f"### {title}: keys"
    yield ""
    yield _first_sentence(inspect.getdoc(record.cls) or "")
    yield ""
    yield "| key | value | default | meaning |"
    yield "|---|---|---|---|"
    if record.tag is not None:
        yield f"| `{record.tag_field}` | `{record.tag}` | | kind of this table |"
    docs = _attribute_docs(record.cls)
    for field in record.fields:
        meaning = _first_sentence(docs.get(field.name) or _table_doc(field.type))
        default = _default(field)
        yield f"| `{field.encode_name}` | {_kind(field.type)} | {default} | {meaning} |"


def _table_doc(kind: kinds.Type) -> str:
    """Return the docstring of the only record in a type; nothing for several."""
    docs = [inspect.getdoc(record.cls) or "" for record, _ in _structs(kind)]
    return docs[0] if len(docs) == 1 else ""


def _attribute_docs(record: type) -> dict[str, str]:
    """Return the docstring of each attribute of a class and of its bases."""
    docs: dict[str, str] = {}
    for cls in reversed(record.__mro__):
        if cls.__module__.partition(".")[0] in ("ground", "sitl", "sysid"):
            attributes = ModuleAnalyzer.for_module(cls.__module__).find_attr_docs()
            docs |= {
                name: "\n".join(lines)
                for (owner, name), lines in attributes.items()
                if owner == cls.__qualname__
            }
    return docs


def _anchor(record: kinds.StructType) -> str:
    """Return the target of links to a record."""
    return re.sub(r"[._]", "-", f"{record.cls.__module__}-{record.cls.__name__}").lower()


def _default(field: kinds.Field) -> str:
    """Return the default of a key: nothing for a required one."""
    if field.required:
        return ""
    if field.default_factory is not msgspec.NODEFAULT:
        return "empty" if field.default_factory in (list, dict, tuple) else "its defaults"
    value = getattr(field.default, "value", field.default)
    if value is None or value is msgspec.UNSET or value in ("", ()):
        return "none"
    return "its defaults" if isinstance(value, msgspec.Struct) else f"`{_literal(value)}`"


def _literal(value: object) -> str:
    """Return a value as TOML and JSON write it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _kind(kind: kinds.Type) -> str:
    """Return a type in words."""
    match kind:
        case kinds.StructType():
            return f"[table](#{_anchor(kind)})"
        case kinds.UnionType(types=types):
            return " or ".join(_kind(t) for t in types if not isinstance(t, kinds.NoneType))
        case kinds.ListType(item_type=inner) | kinds.VarTupleType(item_type=inner):
            return f"list of {_kind(inner)}"
        case kinds.TupleType(item_types=types):
            return f"[{', '.join(map(_kind, types))}]".replace("[", "(").replace("]", ")")
        case kinds.DictType(value_type=inner):
            return f"{_kind(inner)} by name"
        case kinds.LiteralType(values=values):
            return ", ".join(f"`{_literal(value)}`" for value in values)
        case kinds.EnumType(cls=cls):
            return ", ".join(f"`{choice.value}`" for choice in cls)
        case kinds.FloatType() | kinds.IntType():
            return _number(kind)
        case kinds.BoolType():
            return "true or false"
        case kinds.StrType():
            return "text"
    return type(kind).__name__.removesuffix("Type").lower()


def _number(kind: kinds.FloatType | kinds.IntType) -> str:
    """Return a number type with its range."""
    name = "number" if isinstance(kind, kinds.FloatType) else "integer"
    limits = [
        f"{sign} {limit:g}"
        for sign, limit in ((">", kind.gt), (">=", kind.ge), ("<", kind.lt), ("<=", kind.le))
        if limit is not None
    ]
    return " ".join([name, " and ".join(limits)]).strip()
