"""Check of the public docstrings: ``python -m tests.docstrings`` names every one that is short.

Public is what another first-party package imports: a function, or a class with its public methods.
A function or class with parameters documents each of them, and the value it returns, in numpydoc
sections with type and text. One without parameters needs a summary line only; so does a record,
whose fields have docstrings of their own.
"""

import ast
import sys
from pathlib import Path

from numpydoc.hooks.validate_docstrings import AstValidator
from numpydoc.validate import validate

PACKAGES = ("mavlink_io", "autopilot", "sitl", "sysid", "ground", "caribou_auv", "benchmarks")
CHECKS = ("GL06", "GL07", "GL08", "PR01", "PR02", "PR03", "PR04", "PR07", "RT01", "RT03", "YD01")
"""Checks of numpydoc: unknown, unordered or no sections; a parameter that is missing, unknown, in
another order, without type or text; no Returns, a returned value without text, no Yields."""
CHECKS_WITHOUT_PARAMETERS = ("GL06", "GL07", "GL08", "PR02")

Function = ast.FunctionDef | ast.AsyncFunctionDef
Definition = Function | ast.ClassDef


class Sources:
    """Syntax trees of all modules and the names that they import."""

    def __init__(self) -> None:
        self.paths = {
            ".".join(path.with_suffix("").parts).removesuffix(".__init__"): path
            for package in PACKAGES
            for path in sorted(Path(package).rglob("*.py"))
        }
        self.trees = {
            name: ast.parse(path.read_text(encoding="utf-8")) for name, path in self.paths.items()
        }
        self.imports = {name: self._imports(name) for name in self.trees}

    def _imports(self, module: str) -> dict[str, tuple[str, str]]:
        """Return module and name of each ``from ... import ...``, by the local name."""
        path = module.split(".")
        package = path if self.paths[module].name == "__init__.py" else path[:-1]
        imports: dict[str, tuple[str, str]] = {}
        for node in ast.walk(self.trees[module]):
            if isinstance(node, ast.ImportFrom):
                base = package[: len(package) + 1 - node.level] if node.level else []
                source = ".".join([*base, *filter(None, [node.module])])
                imports |= {item.asname or item.name: (source, item.name) for item in node.names}
        return imports

    def find(self, module: str, name: str) -> tuple[str, Definition] | None:
        """Return module and syntax tree of a function or class, also if it is imported again."""
        if module not in self.trees:
            return None
        for node in self.trees[module].body:
            if isinstance(node, Definition) and node.name == name:
                return module, node
        source = self.imports[module].get(name)
        return self.find(*source) if source and source != (module, name) else None

    def used_elsewhere(self) -> dict[tuple[str, str], Definition]:
        """Return functions and classes that another package imports, by module and name."""
        names = set()
        for module, imports in self.imports.items():
            modules = {}
            for local, (source, name) in imports.items():
                if source.split(".")[0] != module.split(".")[0]:
                    names.add((source, name))
                    modules[local] = f"{source}.{name}"
            names |= {
                (modules[node.value.id], node.attr)
                for node in ast.walk(self.trees[module])
                if isinstance(node, ast.Attribute)
                and isinstance(node.value, ast.Name)
                and node.value.id in modules
            }
        found = (self.find(*name) for name in sorted(names))
        return {(module, node.name): node for module, node in filter(None, found)}


class PublicDocstring(AstValidator):  # type: ignore[misc]  # numpydoc has no types
    """Docstring of a public function or class; its annotation says whether it returns a value."""

    @property
    def is_generator_function(self) -> bool:
        """True if the body yields."""
        return any(isinstance(node, ast.Yield | ast.YieldFrom) for node in ast.walk(self.node))

    @property
    def method_returns_something(self) -> bool:
        """True if the annotation of the return value is a type other than None."""
        returns = ast.unparse(self.node.returns or ast.Constant(None))
        return not self.is_generator_function and returns not in ("None", "Never", "NoReturn")


def faults(path: Path, node: Definition, parents: list[ast.AST]) -> list[str]:
    """Return file, line and text of each fault of a docstring and of a class's methods."""
    tree = {"ast_node": node, "filename": path, "ancestry": parents}
    parameters = PublicDocstring(obj_name=node.name, **tree).signature_parameters
    report = validate(node.name, PublicDocstring, **tree)
    checks = CHECKS if parameters else CHECKS_WITHOUT_PARAMETERS
    found = [
        f"{path}:{node.lineno}: {node.name}: {code} {text}"
        for code, text in report["errors"]
        if code in checks
    ]
    if isinstance(node, ast.ClassDef):
        for method in node.body:
            if isinstance(method, Function) and not method.name.startswith("_"):
                found += faults(path, method, [*parents, node])
    return found


def main() -> int:
    """Print each fault of a public docstring, and return 1 if there is one."""
    sources = Sources()
    found = [
        fault
        for (module, _), node in sources.used_elsewhere().items()
        for fault in faults(sources.paths[module], node, [sources.trees[module]])
    ]
    print("\n".join(found) or "docstrings: all complete")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
