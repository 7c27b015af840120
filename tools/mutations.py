"""Wrong changes to equations: what `tools.mutants` alters in the source of a function, one change at a time.

Mutation testing (DeMillo, Lipton, Sayward 1978): code that can be changed without a failing test is not
tested. Altered are numbers, operators, terms, comparisons, conditions, reductions and statements. Not altered
are checks of arguments (what ends in `raise`), text, annotations, logging and progress bars.
"""

from __future__ import annotations

import ast
import copy
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

_OPERATORS: dict[type, type] = {
    **{ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Div},
    **{ast.Pow: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd, ast.Mod: ast.FloorDiv},
    **{ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq},
    **{ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In},
    **{ast.And: ast.Or, ast.Or: ast.And},
}
_AT_LIMIT: dict[type, type] = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}
"""The same comparison, other at equality; tried beside whole numbers, where equality happens."""
_PAIRS = (
    *(("mean", "sum"), ("max", "min"), ("amax", "amin"), ("argmax", "argmin"), ("maximum", "minimum")),
    *(("any", "all"), ("floor", "ceil"), ("sin", "cos"), ("zeros", "ones"), ("zeros_like", "ones_like")),
    *(("fmax", "fmin"), ("logical_and", "logical_or"), ("nanmean", "nansum"), ("nanmax", "nanmin")),
)
_INSTEAD = dict(_PAIRS) | {other: one for one, other in _PAIRS} | {"logsumexp": "amax", "median": "mean"}
_DROPPED = frozenset({
    *("abs", "absolute", "sqrt", "square", "exp", "expm1", "log", "log1p", "clamp", "clip", "hypot"),
    *("cumsum", "cumprod", "accumulate", "diff", "detach", "round", "rint", "floor", "ceil", "flip", "sort"),
    *("relu", "sigmoid", "tanh", "softplus", "softmax", "log_softmax", "maximum", "minimum", "unwrap"),
    *("nan_to_num", "tril", "triu"),
})  # fmt: skip
"""Functions that are replaced by their first argument."""
MEDIAN = "median"
"""Built-in function that the altered code finds: of a numpy array, or of a tensor."""
_LIBRARIES = frozenset({"np", "torch", "math", "F", "nn"})
_SILENT = ("_LOG", "bar", "logging", "warnings")
_NO_EFFECT = frozenset({"strict", "copy", "assume_unique", "non_blocking"})
"""Named arguments that only check, or save time."""
_TEXT = (ast.JoinedStr, ast.Raise, ast.Assert, ast.arguments)


@dataclass(frozen=True)
class Mutation:
    """One wrong change.

    Attributes:
        line: of the source file.
        change: before and after, as source.
        place: the node above the change, the name of its field, and the index in a list.
        after: what is put there.
    """

    line: int
    change: str
    place: tuple[ast.AST, str, int | None]
    after: ast.AST

    def apply(self) -> None:
        """Change the tree."""
        node, field, index = self.place
        if index is None:
            setattr(node, field, self.after)
        else:
            getattr(node, field)[index] = self.after


def functions(tree: ast.Module) -> Iterator[tuple[str, ast.FunctionDef]]:
    """Functions and methods with their qualified names; those inside of functions belong to the outer one."""
    within: list[tuple[str, ast.stmt]] = [("", node) for node in tree.body]
    for prefix, node in within:  # grows
        if isinstance(node, ast.FunctionDef):
            yield prefix + node.name, node
        elif isinstance(node, ast.ClassDef):
            within += [(f"{prefix}{node.name}.", inner) for inner in node.body]


def constants(tree: ast.Module) -> Iterator[tuple[str, ast.Assign | ast.AnnAssign]]:
    """Module constants that are numbers."""
    for node in tree.body:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        if isinstance(node, ast.Assign | ast.AnnAssign) and isinstance(targets[0], ast.Name) and node.value:
            yield targets[0].id, node


def mutations(function: ast.AST) -> Iterator[Mutation]:
    """All changes of one function or constant."""
    if isinstance(function, ast.FunctionDef):
        for index, statement in enumerate(function.body):
            yield from _within(statement, (function, "body", index))
    else:
        yield from _within(function, None)


def _within(node: ast.AST, place: tuple[ast.AST, str, int | None] | None) -> Iterator[Mutation]:
    if isinstance(node, _TEXT) or _is_check(node) or _is_silent(node):
        return
    if isinstance(node, ast.keyword) and node.arg in _NO_EFFECT:
        return
    if isinstance(node, ast.keyword) and node.arg in ("axis", "dim") and isinstance(node.value, ast.UnaryOp):
        node, place = node.value, (node, "value", None)  # -1 becomes -2, not 1, which is often the same axis
        yield from _within(node.operand, (node, "operand", None))
        return
    for after in _changed(node) if place else ():
        change = f"{_source(node)} -> {_source(after)}"
        yield Mutation(getattr(node, "lineno", 0), change, place, after)  # type: ignore[arg-type]
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "decorator_list", "returns", "type_comment"):
            continue
        if isinstance(value, ast.AST):
            yield from _within(value, (node, field, None))
        elif isinstance(value, list):
            for index, inner in enumerate(value):
                if isinstance(inner, ast.AST):
                    yield from _within(inner, (node, field, index))


def _is_check(node: ast.AST) -> bool:
    """Whether a statement only refuses something."""
    return isinstance(node, ast.If) and isinstance(node.body[-1], ast.Raise) and not node.orelse


def _is_silent(node: ast.AST) -> bool:
    """Whether a statement is documentation, or tells people how far the work is."""
    if not isinstance(node, ast.Expr):
        return False
    called = getattr(node.value, "func", None)
    return isinstance(node.value, ast.Constant) or ast.unparse(called or node).startswith(_SILENT)


def _changed(node: ast.AST) -> Iterator[ast.AST]:
    """What a node is replaced with, one after the other."""
    for kinds, change in _CHANGES:
        if isinstance(node, kinds):
            for after in change(node):
                yield ast.fix_missing_locations(ast.copy_location(after, node))


def _with(node: Any, **fields: Any) -> Any:
    """A copy of a node with other fields."""
    return type(node)(**{**dict(ast.iter_fields(node)), **fields})


def _number(node: ast.Constant) -> Iterator[ast.AST]:
    value = node.value
    if isinstance(value, bool):
        yield ast.Constant(not value)
    elif isinstance(value, int):
        yield ast.Constant(value + 1)
    elif isinstance(value, float):
        yield ast.Constant(1.1 * value if value else 1.0)


def _binary(node: ast.BinOp) -> Iterator[ast.AST]:
    if any(isinstance(part, ast.JoinedStr) or isinstance(getattr(part, "value", 0), str)
           for part in (node.left, node.right)):  # fmt: skip
        return
    if other := _OPERATORS.get(type(node.op)):
        yield _with(node, op=other())
    if isinstance(node.op, ast.Add | ast.Sub | ast.Mult | ast.Div) and not isinstance(
        node.right, ast.Constant
    ):
        yield node.left
    if isinstance(node.op, ast.Add | ast.Mult) and not isinstance(node.left, ast.Constant):
        yield node.right


def _compare(node: ast.Compare) -> Iterator[ast.AST]:
    for k, op in enumerate(node.ops):
        sides = [node.left, *node.comparators][k : k + 2]
        tables = [_OPERATORS]
        if any(isinstance(side, ast.Constant) and type(side.value) is int for side in sides):
            tables.append(_AT_LIMIT)
        for table in tables:
            if other := table.get(type(op)):
                yield _with(node, ops=[*node.ops[:k], other(), *node.ops[k + 1 :]])


def _boolean(node: ast.BoolOp) -> Iterator[ast.AST]:
    yield _with(node, op=_OPERATORS[type(node.op)]())


def _unary(node: ast.UnaryOp) -> Iterator[ast.AST]:
    yield node.operand


def _choice(node: ast.IfExp) -> Iterator[ast.AST]:
    yield _with(node, body=node.orelse, orelse=node.body)


def _call(node: ast.Call) -> Iterator[ast.AST]:
    if isinstance(node.func, ast.Attribute):
        name, owner = node.func.attr, node.func.value
        on_library = isinstance(owner, ast.Name) and owner.id in _LIBRARIES
        first = next(iter(node.args), None) if on_library else owner
    elif isinstance(node.func, ast.Name):
        name, on_library, first = node.func.id, False, next(iter(node.args), None)
    else:
        return
    empty = name in ("zeros", "ones") and "0" in re.findall(r"\w+", ast.unparse(node.args[0]))
    if name in _INSTEAD and not empty and not (isinstance(node.func, ast.Name) and name in ("sum", "mean")):
        field = "attr" if isinstance(node.func, ast.Attribute) else "id"
        yield _with(node, func=_with(node.func, **{field: _INSTEAD[name]}))
    if name == "mean" and isinstance(first, ast.AST):
        yield _with(
            node,
            func=ast.Name(MEDIAN, ast.Load()),
            args=[first, *(node.args[1:] if on_library else node.args)],
        )
    if name == "where" and len(node.args) == 3:
        yield _with(node, args=[node.args[0], node.args[2], node.args[1]])
    if name in _DROPPED and isinstance(first, ast.AST):
        yield first


def _condition(node: ast.If) -> Iterator[ast.AST]:
    if not isinstance(node.test, ast.Compare | ast.BoolOp | ast.UnaryOp):  # which are changed themselves
        yield _with(node, test=ast.UnaryOp(ast.Not(), node.test))


def _update(node: ast.AugAssign) -> Iterator[ast.AST]:
    yield ast.Assign([node.target], node.value)
    if other := _OPERATORS.get(type(node.op)):
        yield _with(node, op=other())


def _removed(node: ast.AST) -> Iterator[ast.AST]:
    if not (isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name | ast.Tuple)):
        yield ast.Pass()


_CHANGES: tuple[tuple[Any, Any], ...] = (
    (ast.Constant, _number),
    (ast.BinOp, _binary),
    (ast.Compare, _compare),
    (ast.BoolOp, _boolean),
    (ast.UnaryOp, _unary),
    (ast.IfExp, _choice),
    (ast.Call, _call),
    (ast.If, _condition),
    (ast.AugAssign, _update),
    ((ast.Expr, ast.Assign, ast.AugAssign, ast.Continue, ast.Break), _removed),
)


def _source(node: ast.AST) -> str:
    """One line of source; of a compound statement its head."""
    text = ast.unparse(ast.fix_missing_locations(copy.deepcopy(node))).splitlines()[0]
    return text if len(text) <= 90 else f"{text[:60]} ... {text[-25:]}"
