"""Enough of IEC 61131-3 Structured Text to run an exported function block: one statement a line, turned into Python."""

import ast
import re
from types import CodeType


def _divide(a, b):
    """Integers divide to integers."""
    return int(a / b) if isinstance(a, int) and isinstance(b, int) else a / b


class _Divisions(ast.NodeTransformer):
    def visit_BinOp(self, node):
        self.generic_visit(node)
        if isinstance(node.op, ast.Div):
            return ast.Call(func=ast.Name(id="_divide", ctx=ast.Load()), args=[node.left, node.right], keywords=[])
        return node


def _expression(text: str) -> str:
    text = text.replace("<>", "!=")
    text = re.sub(r"(?<![<>:!])=(?!=)", "==", text)
    for word, python in (("AND", "and"), ("OR", "or"), ("NOT", "not"), ("TRUE", "True"), ("FALSE", "False")):
        text = re.sub(rf"\b{word}\b", python, text)
    return re.sub(r"\bTRUNC\b", "int", re.sub(r"\bDINT_TO_LREAL\b", "float", text))


class Block:
    """An instance of a function block: call it with its inputs, read its outputs as items."""

    def __init__(self, text: str) -> None:
        text = re.sub(r"\(\*.*?\*\)", "", text, flags=re.DOTALL)
        head, body = text[: text.rindex("END_VAR")], text[text.rindex("END_VAR") + len("END_VAR") :]
        assert head.lstrip().startswith("FUNCTION_BLOCK"), "one function block in a file"
        assert body.rstrip().endswith("END_FUNCTION_BLOCK"), "a block must end"
        self.values: dict[str, object] = {}
        self.constants: set[str] = set()
        for kind, section in re.findall(r"(VAR\w*(?: CONSTANT)?)\n(.*?)(?=END_VAR|\Z)", head, flags=re.DOTALL):
            for name, declared, first in re.findall(r"(\w+) : ([^:;]+?)(?: := ([^;]+))?;", section):
                zero = {"BOOL": "False", "DINT": "0"}.get(declared, "0.0")
                self.values[name] = ast.literal_eval(" ".join((first or zero).split()))
                if declared.startswith("ARRAY"):
                    last = int(re.search(r"\[0\.\.(\d+)\]", declared)[1])
                    assert len(self.values[name]) == last + 1, name
                if "CONSTANT" in kind:
                    self.constants.add(name)
        self.code = self._compiled(body.replace("END_FUNCTION_BLOCK", ""))

    def _compiled(self, body: str) -> CodeType:
        lines, depth = [], 0
        for line in (" ".join(line.split()) for line in body.splitlines()):
            if not line:
                continue
            if found := re.fullmatch(r"(IF|ELSIF|WHILE) (.*) (?:THEN|DO)", line):
                depth -= found[1] == "ELSIF"
                word = {"IF": "if", "ELSIF": "elif", "WHILE": "while"}[found[1]]
                lines.append(f"{'    ' * depth}{word} {_expression(found[2])}:")
                depth += 1
            elif line == "ELSE":
                lines.append(f"{'    ' * (depth - 1)}else:")
            elif line in ("END_IF;", "END_WHILE;"):
                depth -= 1
            else:
                name, value = re.fullmatch(r"(\w+) := (.*);", line).groups()
                assert name in self.values, f"{name} is not declared"
                assert name not in self.constants, f"{name} is a constant"
                lines.append(f"{'    ' * depth}{name} = {_expression(value)}")
        assert depth == 0, "IF and WHILE must end"
        tree = _Divisions().visit(ast.parse("\n".join(lines)))
        return compile(ast.fix_missing_locations(tree), "block", "exec")

    def __call__(self, **inputs: object) -> "Block":
        self.values |= inputs
        exec(self.code, {"_divide": _divide}, self.values)  # noqa: S102 - our own text
        return self

    def __getitem__(self, name: str) -> object:
        return self.values[name]
