"""The scripts of a report as one: they are written as modules, and a report must load nothing.

Each module becomes a function that is called once and returns what it exports; the modules that it
imports come before it. Only the two forms are known that our scripts use:

    import { name, other } from "./module.js";
    export function name ...        export const name ...
"""

import re
from importlib.resources import files

IMPORT = re.compile(r'^import \{([^}]+)\} from "\./(\w+)\.js";\n', re.MULTILINE)
EXPORT = re.compile(r"^export (?=(?:function|const) (\w+))", re.MULTILINE)


def bundle_scripts(*names: str) -> str:
    """The named modules and all that they import, in the order in which they build on another."""
    bundled: dict[str, str] = {}
    for name in names:
        _add_module(name, bundled)
    return '"use strict";\n' + "".join(bundled.values())


def _add_module(name: str, bundled: dict[str, str]) -> None:
    if name in bundled:
        return
    source = (files("keyrecon.report") / f"{name}.js").read_text("utf-8")
    for imported in IMPORT.finditer(source):
        _add_module(imported[2], bundled)
    exported = ", ".join(EXPORT.findall(source))
    body = EXPORT.sub("", IMPORT.sub(r"const {\1} = \2_module;\n", source))
    bundled[name] = f"const {name}_module = (() => {{\n{body}return {{ {exported} }};\n}})();\n"
