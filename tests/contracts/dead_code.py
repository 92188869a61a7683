"""Definitions that no line of the product reads: `python tests/contracts/dead_code.py`.

A function, class or constant of a module is read where a line outside its own body names it, in
its module or through an import, and names are resolved as Python does: a local variable, a keyword
or a word of the same spelling is another thing. A method is read where an object's attribute of
that name is, or where a template asks for it; attributes of modules are no object's. Reading begins
with what runs at import and with the entry points: what only dead code reads is dead too.
"""

import ast
import re
import symtable
import sys
import tomllib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parents[2]
# The benchmarks use the product, as its tests do; they are no part of it.
PRODUCT = ("genpolicy", "gates", "stages", "flows")
ASKED = re.compile(r"\{[{%](.*?)[%}]\}", re.DOTALL)
REFERENCE = re.compile(r"([\w.]*):([A-Za-z_]\w*)")
# Decorators that only wrap; any other hands the function to a library, which calls it by itself.
WRAPS = {"property", "setter", "staticmethod", "classmethod", "dataclass", "cached_property",
         "cache", "lru_cache", "override", "contextmanager", "abstractmethod", "total_ordering",
         "runtime_checkable", "wraps", "jit", "no_grad", "inference_mode"}  # fmt: skip
FUNCTION = ast.FunctionDef | ast.AsyncFunctionDef
DEFINITION = FUNCTION | ast.ClassDef


@dataclass
class Module:
    """What one module defines, imports and reads; who reads is the definition around the line.

    Attributes:
        defined: Its functions, classes and constants, and methods as `Class.method`.
        imports: What its names stand for: a module, and a name in it or none.
        names: Names of the module that are read, with who reads them.
        attributes: Attributes that are read, with what stands in front of the dot where that is
            a name, and with who reads them.
        strings: Texts, which may name a module, or `module:name`, or `:name` after `__name__`.
    """

    defined: list[str] = field(default_factory=list)
    imports: dict[str, tuple[str, str]] = field(default_factory=dict)
    names: set[tuple[str, str]] = field(default_factory=set)
    attributes: set[tuple[str, str, str]] = field(default_factory=set)
    strings: set[str] = field(default_factory=set)


def parse(source: str) -> Module:
    """Definitions, imports and reads of one module."""
    tree = ast.parse(source)
    found = Module(list(definitions(tree)))
    found.names |= set(_globals(symtable.symtable(source, "module", "exec"), ""))
    for reader, node in _nodes(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            for name in node.names:
                found.imports[name.asname or name.name] = (node.module, name.name)
        elif isinstance(node, ast.Import):
            for name in node.names:
                bound = name.asname or name.name.partition(".")[0]
                found.imports[bound] = (name.name if name.asname else bound, "")
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load):
            found.attributes.add((node.attr, _dotted(node.value), reader))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found.strings.add(node.value)
        found.names |= {(name, reader) for name in _annotated(node)}
    return found


def definitions(tree: ast.Module) -> Iterator[str]:
    """Every function, class, method and constant that is called by name; no hook of a library."""
    for node in tree.body:
        if isinstance(node, DEFINITION):
            if not _dunder(node.name) and not _hook(node):
                yield node.name
            for part in node.body if isinstance(node, ast.ClassDef) else []:
                if isinstance(part, FUNCTION) and not _dunder(part.name) and not _hook(part):
                    yield f"{node.name}.{part.name}"
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                for name in target.elts if isinstance(target, ast.Tuple) else [target]:
                    if isinstance(name, ast.Name) and not _dunder(name.id):
                        yield name.id


def _dunder(name: str) -> bool:
    return name.startswith("__") or name == "_"


def _hook(node: DEFINITION) -> bool:
    names = (ast.unparse(item).split("(")[0].split(".")[-1] for item in node.decorator_list)
    return not WRAPS.issuperset(names)


def _nodes(tree: ast.Module) -> Iterator[tuple[str, ast.AST]]:
    """Every node with the definition that it stands in: a function, a class or a method."""
    for node in tree.body:
        reader = node.name if isinstance(node, DEFINITION) else ""
        parts = ast.iter_child_nodes(node) if isinstance(node, ast.ClassDef) else [node]
        for part in parts:
            inside = isinstance(node, ast.ClassDef) and isinstance(part, FUNCTION)
            name = f"{reader}.{part.name}" if inside else reader
            yield from ((name, inner) for inner in ast.walk(part))


def _globals(
    table: symtable.SymbolTable, reader: str, around: frozenset[str] = frozenset()
) -> Iterator[tuple[str, str]]:
    """Names of the module, or imported, that a scope and those within it read; locals hide them."""
    imported = around | {
        symbol.get_name() for symbol in table.get_symbols() if symbol.is_imported()
    }
    for symbol in table.get_symbols():
        ours = table.get_type() == "module" or symbol.is_global() or symbol.is_imported()
        if symbol.is_referenced() and (ours or (symbol.is_free() and symbol.get_name() in around)):
            yield symbol.get_name(), reader
    for child in table.get_children():
        inside = table.get_type() == "class" and child.get_type() == "function"
        deeper = f"{reader}.{child.get_name()}" if inside and "." not in reader else reader
        yield from _globals(child, deeper or child.get_name(), imported)


def _annotated(node: ast.AST) -> Iterator[str]:
    """Names in an annotation, which may be quoted."""
    for place in (getattr(node, "annotation", None), getattr(node, "returns", None)):
        for inner in ast.walk(place) if place else ():
            if isinstance(inner, ast.Constant) and isinstance(inner.value, str):
                yield from re.findall(r"[A-Za-z_]\w*", inner.value)
            elif isinstance(inner, ast.Name):
                yield inner.id


def _dotted(node: ast.expr) -> str:
    """`a.b.c` where an expression is no more than that."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute) and (before := _dotted(node.value)):
        return f"{before}.{node.attr}"
    return ""


@dataclass(frozen=True)
class Tree:
    """The modules of a product, by dotted name, and what names their parts from outside.

    Attributes:
        modules: The modules.
        templates: Words of the expressions in templates.
        points: Entry points, `module:name`.
    """

    modules: Mapping[str, Module]
    templates: frozenset[str] = frozenset()
    points: tuple[str, ...] = ()

    def dead(self, kept: Collection[str] = ()) -> list[str]:
        """Places `module:name` that nothing alive reads; what is `kept` is alive."""
        places = {f"{name}:{d}" for name, module in self.modules.items() for d in module.defined}
        reads = self.reads()
        alive: set[str] = set()
        while True:
            read = {what for what, reader in reads if _stands_in(reader, places) <= alive}
            now = set(kept) | {
                place
                for place in places
                if (place in read or _method(place) in read)
                and _stands_in(place, places) - {place} <= alive
            }
            if now <= alive:
                return sorted(places - alive)
            alive |= now

    def reads(self) -> set[tuple[str, str]]:
        """(what is read, who reads): a place, or `.name` for an attribute of some object."""
        found = {(self.place(*point.split(":")), "") for point in self.points}
        found |= {(f".{word}", "") for word in self.templates}
        for here, module in self.modules.items():
            for name, reader in module.names:
                found.add((self.place(here, name), f"{here}:{reader}"))
            for name, before, reader in module.attributes:
                if (of := self._module(module, before)) is None:
                    found.add((f".{name}", f"{here}:{reader}"))
                else:
                    found.add((self.place(of, name), f"{here}:{reader}"))
            for text in module.strings:
                if match := REFERENCE.fullmatch(text):
                    found.add((self.place(match[1] or here, match[2]), f"{here}:"))
                if text in self.modules:  # imported by name: its parts are a variable's attributes
                    found |= {(f"{text}:{name}", f"{here}:") for name, _, _ in module.attributes}
        return found

    def place(self, module: str, name: str) -> str:
        """Where a name of a module is defined: there, or where it is imported from."""
        seen = set()  # a package may import a module of its own by its own name
        while (module, name) not in seen and module in self.modules:
            seen.add((module, name))
            if name not in self.modules[module].defined:
                module, name = self.modules[module].imports.get(name, (module, name))
        return f"{module}:{name}"

    def _module(self, module: Module, before: str) -> str | None:
        """The module in front of a dot, ours or a library's; None for an object."""
        first, _, rest = before.partition(".")
        if first not in module.imports:
            return None
        of, name = module.imports[first]
        path = ".".join(filter(None, (of, name, rest)))
        ours = of.split(".")[0] in {known.split(".")[0] for known in self.modules}
        return path if path in self.modules or not ours else None


def _method(place: str) -> str:
    """`.name` of a method, nothing for what stands in a module."""
    _, dot, name = place.split(":")[1].partition(".")
    return f".{name}" if dot else ""


def _stands_in(reader: str, places: Collection[str]) -> set[str]:
    """The definitions around a line, itself and its class; none where it runs at import."""
    module, _, name = reader.partition(":")
    return {place for place in (reader, f"{module}:{name.partition('.')[0]}") if place in places}


def tree() -> Tree:
    """The product of this repository."""
    modules, words = {}, set()
    for folder in PRODUCT:
        for path in sorted((ROOT / folder).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            modules[name] = parse(path.read_text())
        for path in (ROOT / folder).rglob("*.html"):
            words |= set(re.findall(r"\.([A-Za-z_]\w*)", " ".join(ASKED.findall(path.read_text()))))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    points = [*project["scripts"].values()]
    for group in project["entry-points"].values():
        points += group.values()
    return Tree(modules, frozenset(words), tuple(points))


if __name__ == "__main__":
    sys.stdout.write("\n".join([*tree().dead(), ""]))
