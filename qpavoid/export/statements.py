"""One compiled function as C: its statements."""

import ast
import inspect
import re
import textwrap
from collections.abc import Callable, Sequence
from typing import Any

from qpavoid.export.expressions import Expressions
from qpavoid.export.values import (
    ANNOTATED,
    ATOM,
    NUMBERS,
    Refusal,
    TranslationError,
    Value,
    c_name,
    c_words,
    constant,
)

MOST = 99
"""So often a function is written until what its variables are is settled."""


class Function(Expressions):
    """Writes a function for arguments of given kinds: visiting a statement."""

    def __init__(
        self, unit: Any, plain: Callable[..., Any], given: Sequence[Value]
    ) -> None:
        super().__init__(unit, plain)
        tree = ast.parse(textwrap.dedent(inspect.getsource(plain))).body[0]
        assert isinstance(tree, ast.FunctionDef)
        self.told = ANNOTATED.get(ast.unparse(tree.returns or tree))
        bound: dict[str, Value] = {}
        for name, value in zip(tree.args.args, given, strict=True):
            if value.kind:
                told = ANNOTATED.get(ast.unparse(name.annotation or name))
                self.kinds[name.arg] = told or value.kind
            else:
                bound[name.arg] = value
        self.parameters, self.bound, before = list(self.kinds), set(bound), None
        while before != (before := self.state):
            self.begin()
            if self.times > MOST:
                raise TranslationError(f"cannot be C: {self.name} is never settled")
            self.aliases = dict(bound)
            self.counted = set()
            self.write(tree.body)

    def write(self, nodes: Sequence[ast.stmt]) -> None:
        """Write statements one after another, up to the first that ends them."""
        for node in nodes:
            self.visit(node)
            if self.ended:
                return

    def assign(self, target: ast.expr, value: Value) -> None:
        """Give a value to whatever can have one."""
        if isinstance(target, ast.Name):
            self.keep(target.id, value)
        elif isinstance(target, ast.Tuple):
            self.unpack(target.elts, value)
        else:
            place: Value = self.visit(target)
            if ".at[" not in place.text or value.kind not in NUMBERS:
                raise Refusal("only numbers are stored, and only in arrays")
            self.emit(f"{place.text} = {value.text};")

    def unpack(self, targets: Sequence[ast.expr], value: Value) -> None:
        """Assign the parts of a tuple, all of them read before one is written."""
        struct = self.unit.structs.get(value.kind)
        parts = [] if value.parts or not struct else list(struct.parts)
        if parts and all(map(self.idle, targets, parts)):
            self.discard(value)
        else:
            parts = self.parts(value)
        if len(parts) != len(targets):
            raise Refusal(f"{len(parts)} parts for {len(targets)}")
        for i, one in enumerate(targets):
            later = parts[i + 1 :]
            if any(written(one, part.text) for part in later):
                parts[i + 1 :] = [
                    self.temporary(part, "new") if open_(part) else part
                    for part in later
                ]
            self.assign(one, parts[i])

    def idle(self, target: ast.expr, part: Value) -> bool:
        """Say whether to assign a part means nothing in C."""
        unread = {"_", *self.unread}
        return not part.kind or (isinstance(target, ast.Name) and target.id in unread)

    def keep(self, name: str, value: Value) -> None:
        """Assign to a variable."""
        known = isinstance(value.known, bool | int | float)
        if not value.kind and known and name not in self.bound:
            value = constant(value.known)
        if not value.kind or name in self.bound:
            same = self.aliases.get(name, value).identity == value.identity
            if (self.path and not same) or (value.kind and not value.decided):
                raise Refusal(f"{name} must be known at translation")
            self.aliases[name] = value
        elif name in self.unread or name == "_":
            self.discard(value)
        else:
            held = Value(self.kinds.get(name, value.kind), name)
            self.kinds[name] = self.unit.common(held, value)
            text = self.unit.cast(value, self.kinds[name]).text
            self.store(name, self.kinds[name], text)

    def discard(self, value: Value) -> None:
        """Evaluate what nobody reads, where a function might change an array."""
        names = {made.name for made in self.unit.functions.values()}
        if names & set(re.findall(r"(\w+)\(", value.text)):
            plain = value.level == ATOM and re.fullmatch(r"\w+\(.*\)", value.text)
            self.emit(f"{'' if plain else '(void)'}{value.at(ATOM)};")

    def visit_Assign(self, node: ast.Assign) -> None:
        """Write an assignment."""
        value = self.visit(node.value)
        if len(node.targets) > 1 and open_(value):
            value = self.temporary(value, "same")
        for target in node.targets:
            self.assign(target, value)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        """Write an assignment; as compiled, what is said of it has no meaning."""
        if node.value is not None:
            self.assign(node.target, self.visit(node.value))

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        """Write a change of a variable or an element."""
        left = ast.parse(ast.unparse(node.target), mode="eval").body
        changed = ast.copy_location(ast.BinOp(left, node.op, node.value), node)
        self.assign(node.target, self.visit(ast.fix_missing_locations(changed)))

    def visit_Expr(self, node: ast.Expr) -> None:
        """Write a call."""
        if not isinstance(node.value, ast.Constant):
            self.discard(self.visit(node.value))

    def visit_Pass(self, node: ast.Pass) -> None:
        """Write nothing."""

    def visit_If(self, node: ast.If, head: str = "if") -> None:
        """Write a choice, or what has been chosen already."""
        test = self.number(node.test)
        if test.decided:
            self.write(node.body if test.known else node.orelse)
            return
        with self.block(f"{head} ({test.text})"):
            self.write(node.body)
        other = node.orelse[0] if len(node.orelse) == 1 else None
        if isinstance(other, ast.If):
            before, value = len(self.lines), self.number(other.test)
            if len(self.lines) == before and not value.decided:
                self.visit_If(other, "} else if")
                return
            del self.lines[before:]
        if node.orelse:
            with self.block("} else"):
                self.write(node.orelse)
        self.emit("}")

    def visit_While(self, node: ast.While) -> None:
        """Write a loop."""
        if node.orelse:
            raise Refusal("a loop with else")
        with self.block(f"while ({self.lazily(node.test).text})"):
            self.write(node.body)
        self.emit("}")

    def visit_For(self, node: ast.For) -> None:
        """Write a loop over a range or a tuple."""
        call, target = node.iter, node.target
        if node.orelse:
            raise Refusal("a loop with else")
        i, begin, step = self.new("turn"), constant(0), constant(1)
        value, own = Value("int", i), ""
        if isinstance(call, ast.Call) and self.found(call.func) is range:
            given = [self.number(argument) for argument in call.args]
            begin, end = [begin, *given[:2]][-2:]
            step = given[2] if len(given) > 2 else step
            if isinstance(target, ast.Name) and target.id not in ("_", *self.kinds):
                i, own = c_name(target.id), target.id
        else:
            parts = self.parts(self.visit(call))
            end, value = constant(len(parts)), self.chosen(parts, i, hoisted=True)
        if not end.decided:
            end = self.temporary(end, "end")
        if not step.decided or not step.known:
            raise Refusal("a range with a step that is not known")
        count = f"{i}++" if step.known == 1 else f"{i} += {step.text}"
        sign = "<" if step.known > 0 else ">"
        head = f"for (int {i} = {begin.text}; {i} {sign} {end.text}; {count})"
        with self.block(head):
            self.loops.append(own)
            if not own:
                self.assign(target, value)
            self.write(node.body)
            self.counted.add(self.loops.pop())
        self.emit("}")

    def visit_Return(self, node: ast.Return) -> None:
        """Write a return."""
        self.ended = True
        if node.value is None:
            self.emit("return;")
            return
        value: Value = self.visit(node.value)
        if not value.kind:
            value = self.number(node.value)
        before = Value(value.kind if self.result == "void" else self.result, "")
        self.result = self.told or self.unit.common(before, value)
        self.emit(f"return {self.unit.cast(value, self.result).text};")

    def visit_Break(self, node: ast.Break) -> None:
        """Write the end of a loop."""
        self.ended = True
        self.emit("break;")

    def visit_Continue(self, node: ast.Continue) -> None:
        """Write the end of a turn."""
        self.ended = True
        self.emit("continue;")


def open_(value: Value) -> bool:
    """Say whether a value exists in C and is not known before."""
    return bool(value.kind) and not value.decided


def written(target: ast.expr, text: str) -> bool:
    """Say whether to write a variable or an element may change what a text means."""
    if isinstance(target, ast.Name):
        return c_name(target.id) in c_words(text)
    return "(" in text or "at[" in text
