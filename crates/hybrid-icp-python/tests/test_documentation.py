"""Every public item has a docstring with shapes and units, and its examples run."""

import doctest
import inspect

import pytest

import hybrid_icp as hi
from hybrid_icp import bop

PUBLIC = [(name, getattr(module, name)) for module in (hi, bop) for name in module.__all__]


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


def test_matrices_say_their_shape_and_lengths_their_unit():
    for name, item in members():
        if name.split(".")[-1].startswith("T_"):
            text = inspect.getdoc(item)
            assert "(4, 4)" in text and "metres" in text, name


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
