"""The code that a result depends on: a digest of every source that a module imports, directly or not.

A result is current as long as these digests are the same. Imports are followed recursively to the modules that define
the imported names. The digest of a module is that of its syntax tree without docstrings, so comments and formatting do
not change it. The package's private base (argument checks, files, limits) is excluded. For a module that reads files
in its own folder, those files are included; for one that imports by a computed name, its whole package. For each name
of the compiled part that is used, the digest is that of the Rust module that binds it and of the modules below.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Collection, Iterator, Mapping
from functools import cache, cached_property
from importlib.util import find_spec
from pathlib import Path

from taxel import _core

__all__ = ["Sources", "installed_sources"]

_CORE = "taxel._core"
#: The private base: a change there does not change a result.
_BASE = "taxel._base"
#: Files in the folder of a module that are not its data.
_CODE = {".py", ".pyi", ".pyc", ".so", ".typed"}


class Sources:
    """Follow imports through the sources of some packages.

    Parameters
    ----------
    roots : mapping of str to Path
        By name, each package's folder, or the file of a single module.
    compiled : mapping of str to str
        The digest of each name of the compiled part.
    without : names
        Functions, and modules that are imported, that no result depends on.

    Examples
    --------
    >>> found = installed_sources().parts("taxel.neuron")
    >>> "taxel.neuron" in found, "taxel._core.neuron_run" in found, "taxel.learn.cone_x" in found
    (True, True, False)
    """

    def __init__(self, roots: Mapping[str, Path], compiled: Mapping[str, str], without: Collection[str] = ()) -> None:
        self._roots, self._compiled, self._without = dict(roots), dict(compiled), frozenset(without)
        self._modules: dict[str, _Module | None] = {}
        #: What each module uses, of those that were followed.
        self._followed: dict[str, list[str]] = {}

    def parts(self, *modules: str) -> dict[str, str]:
        """Return the digest of every part that the results of some modules depend on.

        Parameters
        ----------
        *modules : str
            Names, such as "taxel.neuron".

        Returns
        -------
        dict of str to str
            By name of a module, name in ``taxel._core``, or path of a data file; sorted.
        """
        done: set[str] = set()
        digests: dict[str, str] = {}
        open_ = list(modules)
        while open_:
            name = open_.pop()
            if name in done:
                continue
            done.add(name)
            if name.startswith(f"{_CORE}."):
                compiled = self._compiled.get(name.removeprefix(f"{_CORE}."))
                digests |= {} if compiled is None else {name: compiled}  # names used only as types have none
            elif (module := self._module(name)) is not None:
                digests[name] = module.digest
                data = module.data if self._roots[name.split(".")[0]].is_dir() else []
                digests |= {self._shown(file): _digest(file.read_bytes()) for file in data}
                if name not in self._followed:
                    self._followed[name] = list(self._used(module))
                open_ += self._followed[name]
        return dict(sorted(digests.items()))

    def digest(self, *modules: str) -> str:
        """Return one digest of all that `parts` finds."""
        return _digest(repr(self.parts(*modules)).encode())

    def _module(self, name: str) -> _Module | None:
        if name not in self._modules:
            path = None if f"{name}.".startswith(f"{_BASE}.") else self._path(name)
            self._modules[name] = None if path is None else _Module(name, path, self._without)
        return self._modules[name]

    def _path(self, name: str) -> Path | None:
        first, *inner = name.split(".")
        root = self._roots.get(first)
        if root is None or root.suffix:
            return root if root is not None and not inner else None
        place = root.joinpath(*inner)
        for path in (place / "__init__.py", place.with_suffix(".py")):
            if path.is_file():
                return path
        return None

    def _shown(self, file: Path) -> str:
        root = next(root for root in self._roots.values() if file.is_relative_to(root))
        return file.relative_to(root.parent).as_posix()

    def _used(self, module: _Module) -> Iterator[str]:
        for source, name in module.imported:
            if name is None or self._is_module(f"{source}.{name}"):
                continue  # a module: the names used from it are followed
            yield from self._home(source, name)
        for alias, chain in module.chains:
            source, name = module.bound[alias]
            whole = source if name is None else f"{source}.{name}"
            if self._is_module(whole):
                yield from self._reached(whole, chain)
        if module.computes_names:
            yield from (other for other in self._beside(module))

    def _is_module(self, name: str) -> bool:
        return name == _CORE or self._path(name) is not None

    def _reached(self, module: str, chain: tuple[str, ...]) -> Iterator[str]:
        """Find what ``module.a.b`` refers to; the whole module if it is used as a value itself."""
        for name in chain:
            if module != _CORE and self._is_module(f"{module}.{name}"):
                module = f"{module}.{name}"
            else:
                yield from self._home(module, name)
                return
        yield from (f"{_CORE}.{name}" for name in self._compiled) if module == _CORE else (module,)

    def _home(self, module: str, name: str) -> Iterator[str]:
        """Find the module that defines a name which another module re-exports."""
        if module == _CORE:
            yield f"{_CORE}.{name}"
            return
        there = self._module(module)
        if there is None or name == "__version__":
            return
        if name in there.defined or name not in there.bound:
            yield module
            return
        source, original = there.bound[name]
        whole = source if original is None else f"{source}.{original}"
        if self._is_module(whole):
            yield from self._reached(whole, ())
        elif original is not None:
            yield from self._home(source, original)

    def _beside(self, module: _Module) -> Iterator[str]:
        package = module.name if module.path.name == "__init__.py" else module.name.rpartition(".")[0]
        folder = module.path.parent
        for file in sorted(folder.rglob("*.py")):
            inside = file.relative_to(folder).with_suffix("").parts
            yield ".".join([package, *(part for part in inside if part != "__init__")])


class _Module:
    """A module's syntax tree and what it imports."""

    def __init__(self, name: str, path: Path, without: frozenset[str]) -> None:
        self.name, self.path = name, path
        tree = ast.parse(path.read_bytes())
        tree.body = [node for node in tree.body if not without & {_called(node)}]
        nodes = list(ast.walk(tree))
        for node in nodes:
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and _described(
                node
            ):
                del node.body[0]
        self.digest = _digest(_flat(tree).encode())
        #: The origin of each name that an import binds: module, and name in it; includes imports for types.
        self.bound: dict[str, tuple[str, str | None]] = {}
        #: The names that are imported when the module runs.
        self.imported: list[tuple[str, str | None]] = []
        for node, runs in _imports(nodes):
            for alias, source, original in _names(node):
                self.bound[alias] = (source, original)
                if runs:
                    self.imported.append((source, original))
        self._nodes = nodes
        self.defined = {name for node in tree.body for name in _defines(node)}

    @cached_property
    def chains(self) -> list[tuple[str, tuple[str, ...]]]:
        """List how each name that an import binds is used: ``learn.ConeX`` is ``("learn", ("ConeX",))``."""
        bases = {id(node.value) for node in self._nodes if isinstance(node, ast.Attribute)}
        uses = []
        for node in self._nodes:
            if isinstance(node, ast.Attribute | ast.Name) and id(node) not in bases:
                chain: list[str] = []
                inner: ast.expr = node
                while isinstance(inner, ast.Attribute):
                    chain.append(inner.attr)
                    inner = inner.value
                if isinstance(inner, ast.Name) and inner.id in self.bound:
                    uses.append((inner.id, tuple(reversed(chain))))
        return sorted(set(uses))

    @cached_property
    def computes_names(self) -> bool:
        """Whether it imports by a computed name."""
        calls = [node for node in self._nodes if isinstance(node, ast.Call)]
        called = [(getattr(call.func, "id", getattr(call.func, "attr", "")), call) for call in calls]
        return any(
            name == "import_module" and not (call.args and isinstance(call.args[0], ast.Constant))
            for name, call in called
        )

    @cached_property
    def data(self) -> list[Path]:
        """The data files in its folder, if it reads files there; none in the folders of other packages."""
        looks = any(isinstance(node, ast.Name) and node.id == "__file__" for node in self._nodes)
        if not looks and "importlib.resources" not in {source for source, _ in self.imported}:
            return []
        folder = self.path.parent
        packages = {file.parent for file in folder.rglob("__init__.py")} - {folder}
        return sorted(
            file
            for file in folder.rglob("*")
            if file.is_file() and file.suffix not in _CODE and not packages & set(file.parents)
        )


def _called(node: ast.stmt) -> str | None:
    """Return the name of a function, or of the module that names are imported from."""
    return node.module if isinstance(node, ast.ImportFrom) else getattr(node, "name", None)


def _described(node: ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    first = node.body[0] if node.body else None
    return isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and isinstance(first.value.value, str)


def _flat(value: object) -> str:
    """Return a syntax tree as text that is the same in every version of Python: empty fields are omitted."""
    if isinstance(value, ast.AST):
        fields = [(name, getattr(value, name, None)) for name in value._fields]
        inside = "".join(f" {name}={_flat(inner)}" for name, inner in fields if inner is not None and inner != [])
        return f"({type(value).__name__}{inside})"
    return "".join(map(_flat, value)) if isinstance(value, list) else repr(value)


def _imports(nodes: list[ast.AST]) -> Iterator[tuple[ast.Import | ast.ImportFrom, bool]]:
    """Find every import, and whether it is executed when the module runs or is for types only."""
    for_types = {
        id(inner)
        for node in nodes
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)
        for part in node.body
        for inner in ast.walk(part)
    }
    for node in nodes:
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node, id(node) not in for_types


def _names(node: ast.Import | ast.ImportFrom) -> Iterator[tuple[str, str, str | None]]:
    """Return the name that an import binds, the module, and the name in it."""
    for alias in node.names:
        if isinstance(node, ast.ImportFrom):
            yield alias.asname or alias.name, node.module or "", alias.name
        elif alias.asname:
            yield alias.asname, alias.name, None
        else:
            first = alias.name.split(".")[0]
            yield first, first, None


def _defines(node: ast.stmt) -> Iterator[str]:
    """Return the names that a statement at a module's level defines."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        yield node.name
    elif isinstance(node, ast.Assign | ast.AnnAssign | ast.AugAssign):
        for inner in ast.walk(node):
            if isinstance(inner, ast.Name) and isinstance(inner.ctx, ast.Store):
                yield inner.id
    elif isinstance(node, ast.If | ast.Try | ast.For | ast.With):
        for part in ast.iter_child_nodes(node):
            if isinstance(part, ast.stmt):
                yield from _defines(part)


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:12]


@cache
def installed_sources(*more: str | Path, without: tuple[str, ...] = ()) -> Sources:
    """Return the sources of the installed `taxel`.

    Parameters
    ----------
    *more : str or Path
        Further packages whose imports are followed, by name; files of single modules.
    without : names
        Functions, and modules that are imported, that no result depends on.
    """
    files = {file.stem: file for file in more if isinstance(file, Path)}
    packages = {name: find_spec(name) for name in ("taxel", *(name for name in more if isinstance(name, str)))}
    folders = {name: Path(str(spec.origin)).parent for name, spec in packages.items() if spec is not None}
    return Sources(folders | files, _core.source_digests(), without)
