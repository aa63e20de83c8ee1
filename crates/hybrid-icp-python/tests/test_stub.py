"""Checks that the stub has the docstrings of the native module, which editors show.

`HYBRID_ICP_BLESS=1` writes them.
"""

import ast
import inspect
import os

from conftest import ROOT
from hybrid_icp import _native

STUB = ROOT / "crates" / "hybrid-icp-python" / "python" / "hybrid_icp" / "_native.pyi"


def document(node, item):
    """Replaces the docstring of a class or function, and those of its members."""
    if ast.get_docstring(node) is not None:
        del node.body[0]
    for member in node.body:
        if isinstance(member, ast.FunctionDef):
            document(member, getattr(item, member.name, None))
    doc = inspect.getdoc(item) if item is not None else None
    if doc and not node.name.startswith("_"):
        margin = " " * (node.col_offset + 4)
        lines = [line and margin + line for line in doc.splitlines()]
        if len(lines) > 1:
            lines.append(margin)
        node.body.insert(0, ast.Expr(ast.Constant("\n".join(lines).lstrip())))
    if len(node.body) > 1 and isinstance(node, ast.FunctionDef):
        del node.body[1:]
    node.body = node.body or [ast.Expr(ast.Constant(...))]


def documented(text):
    """Returns the stub with the docstrings of the module in place of older ones."""
    head, _, _ = text.partition("\n\n")
    stub = ast.parse(text)
    for node in stub.body:
        item = getattr(_native, getattr(node, "name", ""), None)
        if item is not None:
            document(node, item)
    return f"{head}\n\n{ast.unparse(stub)}\n"


def test_the_stub_has_the_docstrings_of_the_module():
    text = STUB.read_text(encoding="utf-8")
    if os.environ.get("HYBRID_ICP_BLESS"):
        text = documented(text)
        STUB.write_text(text, encoding="utf-8")
    assert text == documented(text), "run again with HYBRID_ICP_BLESS=1"
    assert text.count('"""') > 150
