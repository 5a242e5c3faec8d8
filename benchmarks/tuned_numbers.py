"""Every number that somebody set in the package, found in the source, and what it can affect.

A tuned number stands in a module constant (a name in capitals at the top level) or as the default
of a field of the option records that `pipeline.Options` holds. Numbers of one constant are apart
where there are few of them; of longer tables, the same argument of every record goes together.
Stages and their order are read from `pipeline.py`, and which of them a module can affect from the
imports. Nothing is imported here, so that a number can be changed before anything uses it.
"""

import ast
import copy
import hashlib
import math
import operator
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parent.parent / "keyrecon"
FOLDERS = (
    "tracking", "segmentation", "keyframes", "propagation", "lifting", "body_models", "numerics",
)  # fmt: skip
APART = 4
"""Constants of up to as many numbers are varied number by number."""
CONSTANT = re.compile(r"_?[A-Z][A-Z0-9_]*$")
ARITHMETIC = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.LShift: operator.lshift,
}
FORMS = (
    "lifting/preprocessing.py:MAD_TO_SIGMA",
    "lifting/preprocessing.py:RAYLEIGH_MEDIAN",
    "body_models/depth_model.py:DEPTH_MODEL_VERSION",
    "body_models/depth_model.py:INPUTS",
    "numerics/banded_least_squares.py:STENCIL",
    "propagation/appearance.py:DIAGONAL",
    "propagation/bone_bounds.py:MIN_FRAMES",
    "propagation/correspondence.py:BODY_PARTS",
    "propagation/correspondence.py:WORKERS",
    "propagation/limb_motion.py:SWINGING",
    "segmentation/background_model.py:COVERED",
    "segmentation/background_model.py:FREE",
    "segmentation/color_model.py:BINS",
    "segmentation/contours.py:SMOOTHING_KERNEL",
    "segmentation/foreground_model.py:UNKNOWN",
    "segmentation/player_crops.py:DIRECTIONS",
    "tracking/radial_symmetry.py:CIRCLE",
)
"""Formulas, shapes that code is written for, and what a file says of itself: there is nothing to
tune."""
ENDS = {
    "keyframes/selection.py:BETA_FACTOR": 1,
    "keyframes/selection.py:KeyframeOptions.coverage": 1,
    "propagation/hypotheses.py:VELOCITY_PERSISTENCE": 1,
    "segmentation/repeated_frames.py:CHANGED": 100,
    "segmentation/static_overlay.py:MIN_PERSISTENCE": 1,
    "tracking/detection.py:BEST_SCORE_PERCENTILE": 100,
}
"""Shares and percentiles of nearly all: what is missing to the whole is varied."""
SHAPES = ("dtype", "axis", "shape")
"""Arguments that are no numbers to be tuned."""
Place = tuple[int, int, int, int]
"""Lines and columns between which an expression stands."""


@dataclass(frozen=True)
class TunedNumber:
    """A number, or a column of a table, that is varied as one."""

    module: str
    """File below the package: tracking/tracker.py."""
    name: str
    """The constant or `Record.field`, with what tells this number from its others."""
    symbol: str
    """What code that uses it calls it: the constant's or the field's name."""
    line: int
    places: tuple[Place, ...]
    values: tuple[float, ...]

    @property
    def key(self) -> str:
        """Tells it from all others: file:name."""
        return f"{self.module}:{self.name}"

    def varied(self, factor: float) -> list[float]:
        """The values times a factor."""
        if end := ENDS.get(self.key):
            return [end - vary(end - value, factor) for value in self.values]
        return [vary(value, factor) for value in self.values]


def read_package(package: Path = PACKAGE) -> dict[str, ast.Module]:
    """The parsed source of every module, by its file below the package."""
    files = sorted(package.rglob("*.py"))
    return {str(f.relative_to(package)): ast.parse(f.read_text(encoding="utf-8")) for f in files}


def find_numbers(trees: dict[str, ast.Module]) -> list[TunedNumber]:
    """All tuned numbers in `FOLDERS`."""
    fields = {c.name: _fields(c) for tree in trees.values() for c in _classes(tree)}
    records = _option_records(trees)
    found = []
    for module, tree in trees.items():
        if module.split("/")[0] in FOLDERS:
            for name, value in _constants(tree):
                if f"{module}:{name}" not in FORMS:
                    found += _of_constant(module, name, value, fields)
            for record in _classes(tree):
                if record.name in records:
                    found += _of_record(module, record)
    return found


def vary(value: float, factor: float) -> float:
    """A number times the factor; a whole number stays whole and moves by at least 1."""
    if isinstance(value, float):
        return value * factor
    away = 1 if (factor > 1) == (value > 0) else -1
    moved = round(value * factor)
    return moved if moved != value else value + away


def rewrite(tree: ast.Module, new: dict[Place, float]) -> ast.Module:
    """The module with other numbers at these places; every place must be there."""
    rewriting = _Rewriting(dict(new))
    changed = ast.fix_missing_locations(rewriting.visit(tree))
    if rewriting.left:
        raise ValueError(f"no number at {sorted(rewriting.left)}")
    return changed


def find_stages(trees: dict[str, ast.Module]) -> dict[str, str]:
    """The pipeline's stages in order, each with the file that its function is imported from."""
    calls = [
        found
        for name in ("prepare", "reconstruct")
        for found in _keep_calls("pipeline.py", name, trees)
    ]
    stages: dict[str, str] = {}
    for source, call in calls:
        stages.setdefault(_stage_name(call.args[0]), source[call.args[1].id])
    return stages


def _stage_name(name: ast.expr) -> str:
    """The name that is written, or, of one for each shot, what stands before the shot."""
    if isinstance(name, ast.JoinedStr):
        name = name.values[0]
    return name.value.removesuffix("@")


def _keep_calls(
    module: str, name: str, trees: dict[str, ast.Module]
) -> Iterator[tuple[dict[str, str], ast.Call]]:
    """Calls of `keep` in the order in which a function of a recipe comes to them, each with the
    files that the names around it are imported from."""
    functions = {n.name: n for n in trees[module].body if isinstance(n, ast.FunctionDef)}
    source = {
        alias.asname or alias.name: _file_of(node.module)
        for node in trees[module].body
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }
    calls = [node for node in ast.walk(functions[name]) if isinstance(node, ast.Call)]
    for call in sorted(calls, key=lambda call: (call.lineno, call.col_offset)):
        called = getattr(call.func, "id", "")
        home = module if called in functions else source.get(called, "")
        if called == "keep":
            yield source, call
        elif called != name and _is_recipe(home, called, trees):
            yield from _keep_calls(home, called, trees)


def _is_recipe(module: str, function: str, trees: dict[str, ast.Module]) -> bool:
    """Whether a function keeps what stages find: it is handed `keep`."""
    if module not in trees:
        return False
    defined = (n for n in trees[module].body if isinstance(n, ast.FunctionDef))
    return any(
        node.name == function and any(argument.arg == "keep" for argument in node.args.args)
        for node in defined
    )


def stages_using(
    number: TunedNumber,
    trees: dict[str, ast.Module],
    reach: dict[str, set[str]],
    called: dict[str, dict[str, set[str]]],
) -> tuple[str, ...]:
    """Stages in which code that ran mentions the number, in order; '' last for code between them.

    `reach`: modules that each stage of the pipeline can use (`reached_from` its own), the stages
    in order. `called`: names in the functions run, by stage and module. Code at the top level of a
    module and defaults of arguments count for all stages that import it, however indirectly.
    """
    homes = {number.module} | {m for m, t in trees.items() if _imports(t, number)}
    if CONSTANT.match(number.symbol):
        at_import = {m for m in homes if number.symbol in _read_on_import(trees[m])}
    else:
        homes, at_import = set(trees), set()  # a field is mentioned wherever its record goes
    found = []
    for stage, modules in called.items():
        used = any(number.symbol in modules.get(module, ()) for module in homes)
        reached = reach[stage] if stage else {number.module}
        if (used and number.module in reached) or (stage and at_import & reached):
            found.append(stage)
    order = [*reach, ""]
    return tuple(sorted(found, key=order.index))


def code_digest(trees: dict[str, ast.Module]) -> str:
    """Tells versions of the code that can affect a result; docstrings and comments do not count."""
    texts = [
        module + ast.dump(_Undocumented().visit(copy.deepcopy(tree)))
        for module, tree in sorted(trees.items())
        if "/" not in module or module.split("/")[0] in FOLDERS
    ]
    return hashlib.sha256("".join(texts).encode()).hexdigest()[:10]


def number_in(node: ast.expr) -> float | None:
    """The value of an expression made of numbers alone."""
    if isinstance(node, ast.Constant):
        plain = isinstance(node.value, int | float) and not isinstance(node.value, bool)
        return node.value if plain else None
    if isinstance(node, ast.Attribute):
        return math.pi if ast.unparse(node) in ("np.pi", "math.pi") else None
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        value = number_in(node.operand)
        return None if value is None else -value
    if isinstance(node, ast.BinOp) and type(node.op) in ARITHMETIC:
        one, other = number_in(node.left), number_in(node.right)
        return None if one is None or other is None else ARITHMETIC[type(node.op)](one, other)
    return None


def _constants(tree: ast.Module) -> Iterator[tuple[str, ast.expr]]:
    """Name and value of every module constant; a, b = 1, 2 are two."""
    for node in tree.body:
        if isinstance(node, ast.AnnAssign) and node.value is not None:
            pairs = [(node.target, node.value)]
        elif isinstance(node, ast.Assign):
            pairs = [
                pair
                for target in node.targets
                for pair in (
                    zip(target.elts, node.value.elts, strict=True)
                    if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
                    else [(target, node.value)]
                )
            ]
        else:
            continue
        for target, value in pairs:
            if isinstance(target, ast.Name) and CONSTANT.match(target.id):
                yield target.id, value


def _of_constant(
    module: str, name: str, value: ast.expr, fields: dict[str, list[str]]
) -> list[TunedNumber]:
    """The numbers of one constant: apart if they are few, else by the argument they are."""
    found = [(path, node) for path, node in _numbers(value, "", fields) if number_in(node)]
    if len(found) > APART:
        found = [(path[path.rfind(".") :] if "." in path else "", node) for path, node in found]
    groups: dict[str, list[ast.expr]] = {}
    for path, node in found:
        groups.setdefault(path, []).append(node)
    return [_number(module, name + path, name, nodes) for path, nodes in groups.items()]


def _of_record(module: str, record: ast.ClassDef) -> Iterator[TunedNumber]:
    for node in record.body:
        if isinstance(node, ast.AnnAssign) and node.value is not None and number_in(node.value):
            name = f"{record.name}.{node.target.id}"
            yield _number(module, name, node.target.id, [node.value])


def _number(module: str, name: str, symbol: str, nodes: list[ast.expr]) -> TunedNumber:
    values = tuple(number_in(node) for node in nodes)
    return TunedNumber(module, name, symbol, nodes[0].lineno, tuple(map(_place, nodes)), values)


def _numbers(
    node: ast.AST, path: str, fields: dict[str, list[str]]
) -> Iterator[tuple[str, ast.expr]]:
    """The largest expressions made of numbers alone, each with the way to it."""
    if isinstance(node, ast.expr) and number_in(node) is not None:
        yield path, node
    else:
        for step, part in _parts(node, fields):
            yield from _numbers(part, path + step, fields)


def _parts(node: ast.AST, fields: dict[str, list[str]]) -> list[tuple[str, ast.AST]]:
    """What an expression is made of that may hold numbers to be tuned, and how to tell it apart."""
    if isinstance(node, ast.Tuple | ast.List):
        return [(f"[{at}]", part) for at, part in enumerate(node.elts)]
    if isinstance(node, ast.Dict):
        keys = [f"[{ast.unparse(key)}]" if key else "" for key in node.keys]
        return list(zip(keys, node.values, strict=True))
    if isinstance(node, ast.Call):
        names = fields.get(getattr(node.func, "id", ""), [])
        steps = [f".{name}" for name in names] + [""] * len(node.args)
        named = [(f".{k.arg}", k.value) for k in node.keywords if k.arg not in SHAPES]
        return [*zip(steps, node.args, strict=False), *named]
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
        return [("", node.left)]  # an exponent is a form, no setting
    if isinstance(node, ast.Subscript):
        return []
    return [("", part) for part in ast.iter_child_nodes(node)]


def _place(node: ast.expr) -> Place:
    return node.lineno, node.col_offset, node.end_lineno, node.end_col_offset


def _classes(tree: ast.Module) -> list[ast.ClassDef]:
    return [node for node in tree.body if isinstance(node, ast.ClassDef)]


def _fields(record: ast.ClassDef) -> list[str]:
    return [node.target.id for node in record.body if isinstance(node, ast.AnnAssign)]


def _option_records(trees: dict[str, ast.Module]) -> set[str]:
    """Names of the records that `pipeline.Options` holds, and of those in them."""
    classes = {c.name: c for tree in trees.values() for c in _classes(tree)}
    found, waiting = set(), ["Options"]
    while waiting:
        record = classes[waiting.pop()]
        for node in record.body:
            if isinstance(node, ast.AnnAssign):
                held = {n.id for n in ast.walk(node.annotation) if isinstance(n, ast.Name)}
                new = (held & classes.keys()) - found
                found |= new
                waiting += new
    return found


def _file_of(module: str) -> str:
    """The file below the package of keyrecon.a.b."""
    return "/".join(module.split(".")[1:]) + ".py"


def reached_from(file: str, trees: dict[str, ast.Module]) -> set[str]:
    """A module and all that it imports, however indirectly."""
    found, waiting = set(), [file]
    while waiting:
        file = waiting.pop()
        if file in trees and file not in found:
            found.add(file)
            waiting += [target for target, _ in _imported(trees[file])]
    return found


@cache
def _imported(tree: ast.Module) -> frozenset[tuple[str, str]]:
    """File and name of everything that is imported from the package."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "keyrecon":
            for alias in node.names:
                found.add((_file_of(node.module), alias.name))
                found.add((_file_of(f"{node.module}.{alias.name}"), ""))
    return frozenset(found)


def _imports(tree: ast.Module, number: TunedNumber) -> bool:
    return bool({(number.module, number.symbol), (number.module, "")} & _imported(tree))


@cache
def _read_on_import(tree: ast.Module) -> set[str]:
    """Names that a module reads when it is imported: outside functions, and arguments' defaults."""
    found: set[str] = set()
    waiting: list[ast.AST] = list(tree.body)
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.FunctionDef):
            waiting += [d for d in (*node.args.defaults, *node.args.kw_defaults) if d]
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            found.add(node.id)
        elif isinstance(node, ast.AnnAssign):
            waiting += [node.value] if node.value else []
        else:
            waiting += ast.iter_child_nodes(node)
    return found


class _Rewriting(ast.NodeTransformer):
    """Puts numbers where others stood."""

    def __init__(self, new: dict[Place, float]) -> None:
        self.left = new

    def visit(self, node: ast.AST) -> ast.AST:
        """The number for this place, or the node with its parts rewritten."""
        place = _place(node) if isinstance(node, ast.expr) else None
        if place in self.left:
            return ast.copy_location(ast.Constant(self.left.pop(place)), node)
        return self.generic_visit(node)


class _Undocumented(ast.NodeTransformer):
    """Drops texts that stand as statements."""

    def visit_Expr(self, node: ast.Expr) -> ast.Expr | None:
        """Nothing for a text."""
        return None if isinstance(node.value, ast.Constant) else node
