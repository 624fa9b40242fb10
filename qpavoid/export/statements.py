"""Statements of the compiled subset, as C."""

import ast
import re
from collections.abc import Sequence

from qpavoid.export.values import NUMBERS, UNKNOWN, Value, c_name, constant, leaves
from qpavoid.export.variables import ANNOTATED, Variables


class Function(Variables):
    """One compiled function as C, for arguments of given kinds."""

    def body(self, nodes: Sequence[ast.stmt]) -> None:
        """Translate statements one after another, up to the first that ends them."""
        for node in nodes:
            method = getattr(self, f"_{type(node).__name__}", None)
            if method is None:
                self.refuse(node, f"{type(node).__name__} is outside the subset")
            method(node)
            if self.ended:
                return

    def assign(self, node: ast.AST, target: ast.expr, value: Value) -> None:
        """Give a value to whatever can have one."""
        if isinstance(target, ast.Name):
            self.to_variable(node, target.id, value)
        elif isinstance(target, ast.Tuple):
            self._unpack(node, target, value)
        else:
            place = self.expr(target)
            if ".at[" not in place.text or value.kind not in NUMBERS:
                self.refuse(node, "only numbers are stored, and only in arrays")
            self.emit(f"{place.text} = {value.text};")

    def _unpack(self, node: ast.AST, target: ast.Tuple, value: Value) -> None:
        """Assign the parts of a tuple, all of them read before one is written."""
        parts = self.parts(node, value)
        if len(parts) != len(target.elts):
            self.refuse(node, f"{len(parts)} parts for {len(target.elts)}")
        for i, one in enumerate(target.elts):
            later = " ".join(part.text for part in parts[i + 1 :])
            name = c_name(one.id) if isinstance(one, ast.Name) else "at"
            if value.parts and re.search(rf"\b{name}\b", later):
                parts[i + 1 :] = [
                    part if part.known is not UNKNOWN else self.temporary(part, "new")
                    for part in parts[i + 1 :]
                ]
            self.assign(node, one, parts[i])

    def _Assign(self, node: ast.Assign) -> None:
        value = self.expr(node.value)
        target = node.targets[0]
        names = target.elts if isinstance(target, ast.Tuple) else [target]
        unread = {"_", *self.unread}
        if isinstance(node.value, ast.Call) and all(
            isinstance(one, ast.Name) and one.id in unread for one in names
        ):
            self.emit(f"{value.text};")
            return
        if len(node.targets) > 1 and value.known is UNKNOWN:
            value = self.temporary(value, "same")
        for target in node.targets:
            self.assign(node, target, value)

    def _AugAssign(self, node: ast.AugAssign) -> None:
        left = ast.parse(ast.unparse(node.target), mode="eval").body
        changed = ast.BinOp(left, node.op, node.value)
        value = self.expr(ast.fix_missing_locations(ast.copy_location(changed, node)))
        self.assign(node, node.target, value)

    def _Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call):
            self.emit(f"{self.expr(node.value).text};")
        elif not isinstance(node.value, ast.Constant):
            self.refuse(node, "an expression without effect")

    def _If(self, node: ast.If, head: str = "if") -> None:
        test = self.number(node.test)
        if test.known is not UNKNOWN:
            self.body(node.body if test.known else node.orelse)
            return
        with self.block(f"{head} ({test.text})"):
            self.body(node.body)
        other = node.orelse[0] if len(node.orelse) == 1 else None
        if isinstance(other, ast.If) and self._test(other.test).known is UNKNOWN:
            self._If(other, "} else if")
            return
        if node.orelse:
            with self.block("} else"):
                self.body(node.orelse)
        self.emit("}")

    def _test(self, node: ast.expr) -> Value:
        """Return a condition that is not asked at once: nothing can stand before it."""
        before, value = len(self.lines), self.number(node)
        if len(self.lines) > before:
            self.refuse(node, "a condition needs a variable of its own")
        return value

    def _While(self, node: ast.While) -> None:
        if node.orelse:
            self.refuse(node, "a loop with else")
        with self.block(f"while ({self._test(node.test).text})"):
            self.body(node.body)
        self.emit("}")

    def _For(self, node: ast.For) -> None:
        call, target = node.iter, node.target
        if node.orelse or not isinstance(target, ast.Name):
            self.refuse(node, "a loop with else, or over several names")
        self.temporaries += 1
        i = f"turn_{self.temporaries}"
        value, begin = Value("int", i), constant(0)
        if not isinstance(call, ast.Call):
            value = self.chosen(node, parts := self.expr(call), i)
            end = constant(len(parts.parts))
        elif self.found(call.func) is range and len(call.args) < 3:
            begin, end = [begin, *map(self.number, call.args)][-2:]
            i = i if target.id in ("_", *self.kinds) else c_name(target.id)
        else:
            self.refuse(node, "only over a range or a tuple")
        if end.known is UNKNOWN:
            end = self.temporary(end, "end")
        with self.block(f"for (int {i} = {begin.text}; {i} < {end.text}; {i}++)"):
            own = i == c_name(target.id)
            self.loops.append(target.id if own else "")
            if not own:
                self.assign(node, target, value)
            self.body(node.body)
            self.loops.pop()
        self.emit("}")

    def _Return(self, node: ast.Return) -> None:
        self.ended = True
        if node.value is None:
            self.emit("return;")
            return
        value = self.expr(node.value)
        if not value.kind:
            self.returned = value
            value = self.packed([leaf for leaf in leaves(value) if leaf.kind])
        told = ANNOTATED.get(ast.unparse(self.definition.returns or node))
        if self.result not in ("void", told or value.kind):
            self.refuse(node, f"returned {self.result} before")
        self.result = told or value.kind
        self.emit(f"return {value.text};")

    def _Break(self, node: ast.Break) -> None:
        self.ended = True
        self.emit("break;")

    def _Continue(self, node: ast.Continue) -> None:
        self.ended = True
        self.emit("continue;")
