"""Every public item has a docstring with shapes and units, and its examples run."""

import ast
import doctest
import inspect
import re

import pytest

import hybrid_icp as hi
from conftest import ROOT
from hybrid_icp import bop

PUBLIC = [(name, getattr(module, name)) for module in (hi, bop) for name in module.__all__]
PACKAGE = ROOT / "crates" / "hybrid-icp-python"

#: What an array may be of: lengths, image positions, angles, or what has no unit and says what it is.
UNITS = re.compile(r"metre|pixel|radian|\bm²|units?\b|\bbool\b|indices|`unit`|of the diameter|unit length|normals|rigid motion", re.IGNORECASE)


def members():
    """Every public function, class, method and property."""
    for name, item in PUBLIC:
        yield name, item
        if inspect.isclass(item) and not issubclass(item, (Exception, Warning)):
            for member, value in vars(item).items():
                if not member.startswith("_"):
                    yield f"{name}.{member}", value.__func__ if isinstance(value, staticmethod) else value


@pytest.mark.parametrize(("name", "item"), list(members()))
def test_every_public_item_is_documented(name, item):
    text = inspect.getdoc(item)
    assert text and (text[0].isupper() or text[0] == '"') and "." in text, name
    if inspect.isgetsetdescriptor(item) or not callable(item):
        return
    parameters = [p for p in inspect.signature(item).parameters if p not in ("self", "args", "kwargs")] if has_signature(item) else []
    for parameter in parameters:
        documented = text.split("Parameters\n----------\n")
        assert len(documented) == 2 and parameter in documented[1], f"{name}: {parameter} is not documented"


def has_signature(item):
    try:
        inspect.signature(item)
    except ValueError:
        return False
    return True


def entries(text):
    """What a docstring says of parameters and returned values: (name and type, description)."""
    found = []
    for section in re.findall(r"^(?:Parameters|Returns)\n-+\n(.*?)(?=^\w[\w ]*\n-{3,}$|\Z)", text, re.MULTILINE | re.DOTALL):
        found += re.findall(r"^(\S.*)\n((?:^(?:[ ]{4}.*)?\n?)*)", section, re.MULTILINE)
    return found


def test_every_array_says_its_shape_and_its_unit():
    seen = 0
    for name, item in members():
        text = inspect.getdoc(item) + "\n"
        if inspect.isgetsetdescriptor(item):
            said = [(text, "")] if "shape" in text or name.split(".")[-1].startswith("T_") else []
        else:
            said = [entry for entry in entries(text) if "array" in entry[0]]
        for head, description in said:
            assert re.search(r"shape \(\w+,|\(H, W\)", head), f"{name}: {head.strip()}: no shape"
            assert UNITS.search(head + description) or "covariance" in head.lower(), f"{name}: {head.strip()}: no unit"
            if re.match(r"T_\w+", head) or name.split(".")[-1].startswith("T_"):
                assert re.search(r"\((N, )?4, 4\)", head), f"{name}: {head.strip()}: a pose is (4, 4)"
                assert "metres" in head + description, f"{name}: {head.strip()}: a pose is in metres"
            seen += 1
    assert seen > 50


def test_every_number_that_is_a_length_says_so():
    """What is returned as a float has a unit, or says of what it is a share."""
    for name, item in members():
        if callable(item) and not inspect.isclass(item):
            for head, description in entries(inspect.getdoc(item) + "\n"):
                if head == "float":
                    assert re.search(r"[Mm]etres|[Pp]ixels|mean over|χ²", inspect.getdoc(item)), name


def test_the_package_is_written_in_the_python_that_it_is_for():
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
            result = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(test)
            assert result.failed == 0, name
            ran += result.attempted
    assert ran > 40
