"""Checks that every public item has a docstring with shapes and units, and runs the examples."""

import ast
import doctest
import inspect
import re

import pytest

import hybrid_icp as hi
from conftest import ROOT
from hybrid_icp import adapters, bop, plot, rerun

PUBLIC = [(name, getattr(module, name)) for module in (hi, bop, adapters, plot, rerun) for name in module.__all__]
PACKAGE = ROOT / "crates" / "hybrid-icp-python"

#: The units of arrays, and the words for arrays without a unit.
UNITS = re.compile(
    r"meter|pixel|radian|\bm²|units?\b|\bbool\b|indices|`unit`|of the diameter|unit length|normals"
    r"|rigid motion",
    re.IGNORECASE,
)


def members():
    """Yields every public function, class, method and property."""
    for name, item in PUBLIC:
        yield name, item
        if inspect.isclass(item) and not issubclass(item, (Exception, Warning)):
            for member, value in vars(item).items():
                if not member.startswith("_"):
                    static = isinstance(value, staticmethod)
                    yield f"{name}.{member}", value.__func__ if static else value


@pytest.mark.parametrize(("name", "item"), list(members()))
def test_every_public_item_is_documented(name, item):
    text = inspect.getdoc(item)
    assert text and (text[0].isupper() or text[0] == '"') and "." in text, name
    if inspect.isgetsetdescriptor(item) or not callable(item):
        return
    parameters = inspect.signature(item).parameters if has_signature(item) else []
    for parameter in set(parameters) - {"self", "args", "kwargs"}:
        documented = re.split(r"(?:Parameters|Attributes)\n----------\n", text)
        found = len(documented) == 2 and parameter in documented[1]
        assert found, f"{name}: {parameter} is not documented"


def has_signature(item):
    try:
        inspect.signature(item)
    except ValueError:
        return False
    return True


def entries(text):
    """Returns (name and type, description) of the parameters and returned values."""
    section = r"^(?:Parameters|Attributes|Returns)\n-+\n(.*?)(?=^\w[\w ]*\n-{3,}$|\Z)"
    found = []
    for body in re.findall(section, text, re.MULTILINE | re.DOTALL):
        found += re.findall(r"^(\S.*)\n((?:^(?:[ ]{4}.*)?\n?)*)", body, re.MULTILINE)
    return found


def test_every_array_documents_its_shape_and_its_unit():
    seen = 0
    for name, item in members():
        text = inspect.getdoc(item) + "\n"
        pose = name.split(".")[-1].startswith("T_")
        if inspect.isgetsetdescriptor(item):
            arrays = [(text, "")] if "shape" in text or pose else []
        else:
            arrays = [entry for entry in entries(text) if "array" in entry[0]]
        for head, description in arrays:
            place, entry = f"{name}: {head.strip()}", head + description
            assert re.search(r"shape \(\w+,|\(H, W\)", head), f"{place}: no shape"
            assert UNITS.search(entry) or "covariance" in head.lower(), f"{place}: no unit"
            if re.match(r"T_\w+", head) or pose:
                assert re.search(r"\((N, )?4, 4\)", head), f"{place}: a pose is (4, 4)"
                assert "meters" in entry, f"{place}: a pose is in meters"
            seen += 1
    assert seen > 50


def test_every_returned_number_documents_its_unit():
    for name, item in members():
        if callable(item) and not inspect.isclass(item):
            for head, description in entries(inspect.getdoc(item) + "\n"):
                if head == "float":
                    unit = re.search(r"[Mm]eters|[Pp]ixels|mean over|χ²", inspect.getdoc(item))
                    assert unit, name


def test_the_package_parses_as_the_oldest_python_it_supports():
    files = [*(PACKAGE / "python").rglob("*.py"), *(PACKAGE / "examples").glob("*.py")]
    assert len(files) >= 8
    for file in files:
        ast.parse(file.read_text(encoding="utf-8"), str(file), feature_version=(3, 9))
    assert 'requires-python = ">=3.9"' in (PACKAGE / "pyproject.toml").read_text()


def test_the_examples_run():
    examples = [(f"hybrid_icp.{name}", item) for name, item in members()]
    ran = 0
    for name, item in [("hybrid_icp", hi), *examples]:
        text = item.__doc__ or ""
        test = doctest.DocTestParser().get_doctest(inspect.cleandoc(text), {}, name, None, None)
        if test.examples:
            runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
            result = runner.run(test)
            assert result.failed == 0, name
            ran += result.attempted
    assert ran > 40
