"""Imports the package with other numbers in it, as if somebody had written them there."""

import ast
import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder, SourceLoader
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_file_location
from types import CodeType, ModuleType

from tuned_numbers import PACKAGE, Place, rewrite


class VariedImport(MetaPathFinder):
    """Finds one module of the package, with other numbers; all others are found as ever."""

    def __init__(self, module: str, new: dict[Place, float]) -> None:
        """`module`: the file below the package."""
        self.file = str(PACKAGE / module)
        self.name = "keyrecon." + module.removesuffix(".py").replace("/", ".")
        self.new = new

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """How to import the module."""
        if name != self.name:
            return None
        return spec_from_file_location(name, self.file, loader=_Loader(self.file, self.new))


class _Loader(SourceLoader):
    """Compiles the rewritten source; no compiled file is read or kept."""

    def __init__(self, file: str, new: dict[Place, float]) -> None:
        self.file = file
        self.new = new

    def get_filename(self, fullname: str) -> str:
        """The module's file."""
        return self.file

    def get_data(self, path: str) -> bytes:
        """A file's bytes."""
        with open(path, "rb") as file:
            return file.read()

    def get_code(self, fullname: str) -> CodeType:
        """The code with other numbers."""
        return compile(rewrite(ast.parse(self.get_data(self.file)), self.new), self.file, "exec")


def vary_imports(module: str, new: dict[Place, float]) -> None:
    """From now on the module is imported with other numbers at these places of its source."""
    varied = VariedImport(module, new)
    if varied.name in sys.modules:
        raise RuntimeError(f"{varied.name} has been imported already.")
    sys.meta_path.insert(0, varied)
