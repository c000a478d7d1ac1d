"""No index of compiled code counts from the end: numba is not asked to look, so it would read what lies before the array."""

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COMPILED = {"kernel", "called", "inlined", "apart"}
FILES = sorted(path for folder in ("bug_gym", "agents") for path in (ROOT / folder).rglob("*.py") if path.is_file())


def from_the_end(source: str) -> list[str]:
    """Indices of compiled functions that count from the end, as they are written."""
    found = []
    for function in ast.walk(ast.parse(source)):
        if isinstance(function, ast.FunctionDef) and COMPILED & {ast.unparse(one) for one in function.decorator_list}:
            for node in ast.walk(function):
                if isinstance(node, ast.Subscript):
                    parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
                    if any(isinstance(part, ast.UnaryOp) and isinstance(part.op, ast.USub) for part in parts):
                        found.append(ast.unparse(node))
    return found


def test_compiled_code_counts_from_the_beginning() -> None:
    sources = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in FILES}
    assert {name: found for name, source in sources.items() if (found := from_the_end(source))} == {}


def test_indices_from_the_end_are_seen() -> None:
    source = "@called\ndef f(a, i):\n    return a[-1, 0] + a[-i] + a[i - 1] + a[0]\ndef g(a):\n    return a[-1]\n"
    assert from_the_end(source) == ["a[-1, 0]", "a[-i]"]
