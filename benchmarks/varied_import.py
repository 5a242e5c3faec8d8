"""Imports the package with other numbers in it, as if somebody had written them there."""

import ast
import sys
from collections.abc import Mapping, Sequence
from importlib.abc import MetaPathFinder, SourceLoader
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_file_location
from types import CodeType, ModuleType

from tuned_numbers import PACKAGE, Place, rewrite


class VariedImport(MetaPathFinder):
    """Finds some modules of the package, with other numbers; all others are found as ever."""

    def __init__(self, new: Mapping[str, Mapping[Place, float]]) -> None:
        """`new`: numbers by the module's file below the package."""
        self.new = {
            "keyrecon." + module.removesuffix(".py").replace("/", "."): (module, numbers)
            for module, numbers in new.items()
        }

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """How to import one of the modules."""
        if name not in self.new:
            return None
        module, numbers = self.new[name]
        file = str(PACKAGE / module)
        return spec_from_file_location(name, file, loader=_Loader(file, numbers))


class _Loader(SourceLoader):
    """Compiles the rewritten source; no compiled file is read or kept."""

    def __init__(self, file: str, new: Mapping[Place, float]) -> None:
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


def vary_imports(new: Mapping[str, Mapping[Place, float]]) -> None:
    """From now on modules are imported with other numbers at these places of their source."""
    varied = VariedImport(new)
    if imported := varied.new.keys() & sys.modules.keys():
        raise RuntimeError(f"{', '.join(sorted(imported))} imported already.")
    sys.meta_path.insert(0, varied)
