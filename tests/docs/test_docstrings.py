"""Docstrings of public things say what CONTRIBUTING.md asks of them.

Public is every name of `amoeboid`, every method and property of its classes, and every function of
the closed forms.
"""

import ast
import dataclasses
import inspect
import re
from functools import cache
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from pkgutil import iter_modules

import amoeboid
from amoeboid import closed_forms

ITEMS = Path(__file__).parents[1] / "paper" / "items.toml"
SHAPE = re.compile(r"\((?:\.\.\.|\d*[A-Za-z_]\w*|\d+)(?: [+*-] \w+)?,(?: ?[^()]+)?\)")
DIMENSION = re.compile(r"\[([^\]\[]*)\]")
SYMBOLS = r"[LTMN](?:\^\d)?(?: [LTMN](?:\^\d)?)*"
DIMENSIONS = re.compile(rf"(?:1|{SYMBOLS})(?:/(?:[LTMN](?:\^\d)?|\({SYMBOLS}\)))?")
# words that say what a shape or a unit would: the result has those of something else
SHAPE_WORDS = re.compile(r"broadcast|shape of|\bnumber\b", re.IGNORECASE)
UNIT_WORDS = re.compile(r"\bunits?\b|\bdegrees\b|\bseconds\b|^Whether|^Where|^One word")
LABEL = re.compile(r"(?:SI|main text)\s((?:`[A-Za-z]\w*`(?:, | and )?)+)")
SOURCE = re.compile(r"\b(?:SI|main text)\s`|docs/|tests/|Derived|figure \d|\bl-th\b")
NO_FORMULAS = {"points", "roots", "summary"}  # what formulas take, use and print
# arguments that mean the same everywhere: docs/reference/index.rst explains them
EVERYWHERE = {"self", "cls", "ax", "progress", "watch"}
# types that do not say what an argument is; those of this package do
UNTELLING = {"Any", "Array", "ArrayLike", "Callable", "Iterable", "Mapping", "None", "Sequence"}


@cache
def labels():
    """The labels of the paper's equations, tables and figures."""
    return set(re.findall(r"`(\w+)`", ITEMS.read_text(encoding="utf-8")))


def public_functions():
    """(path, function) of every function, method and property."""
    for name in amoeboid.__all__:
        thing = getattr(amoeboid, name)
        if inspect.isfunction(thing):
            yield f"amoeboid.{name}", thing
        elif inspect.isclass(thing):
            yield from ((f"amoeboid.{name}.{m}", f) for m, f in methods(thing))
    for module in theory_modules():
        for name, thing in vars(module).items():
            own = inspect.isfunction(thing) and thing.__module__ == module.__name__
            if own and not name.startswith("_"):
                yield f"{module.__name__}.{name}", thing


def theory_modules():
    return [
        import_module(f"amoeboid.closed_forms.{found.name}")
        for found in iter_modules(closed_forms.__path__)
    ]


def methods(cls):
    """Name and function of the public methods and properties, also of bases of this package."""
    for name in dir(cls):
        home = next((base for base in cls.__mro__ if name in vars(base)), object)
        if name.startswith("_") or not home.__module__.startswith("amoeboid"):
            continue
        found = vars(home)[name]
        function = getattr(found, "__func__", None) or getattr(found, "fget", None)
        function = function or getattr(found, "func", None) or found
        if inspect.isfunction(function):
            yield name, function


def public_classes():
    for name in amoeboid.__all__:
        if inspect.isclass(getattr(amoeboid, name)):
            yield f"amoeboid.{name}", getattr(amoeboid, name)


FUNCTIONS = dict(public_functions())
CLASSES = dict(public_classes())


def doc_of(thing):
    return inspect.getdoc(thing) or ""


def returned(function):
    return str(inspect.signature(function).return_annotation)


@cache
def definitions(file):
    """The classes and functions of a file by their first line, that of a decorator if any."""
    tree = ast.parse(Path(file).read_text(encoding="utf-8"))
    kinds = ast.ClassDef | ast.FunctionDef
    found = [node for node in ast.walk(tree) if isinstance(node, kinds)]
    return {min(n.lineno for n in (node, *node.decorator_list)): node for node in found}


def raised(function):
    """Names of the errors that a function raises itself."""
    code = inspect.unwrap(function).__code__
    for node in ast.walk(definitions(code.co_filename)[code.co_firstlineno]):
        called = node.exc if isinstance(node, ast.Raise) else node
        if not (isinstance(called, ast.Call) and isinstance(called.func, ast.Name)):
            continue
        if isinstance(node, ast.Raise):
            yield called.func.id
        elif called.func.id.startswith("refuse_"):
            yield "InvalidInput"


def telling(annotation):
    """Whether a type says what an argument or a field is: a class of this package."""
    return set(re.findall(r"\b[A-Z]\w+", str(annotation))) - UNTELLING


def documented(path):
    """What is said of a function: by itself, by what it overrides, by the module of a formula."""
    function = FUNCTIONS[path]
    if path.startswith("amoeboid.closed_forms"):
        return doc_of(function) + doc_of(inspect.getmodule(function))
    name = path.split(".")
    bases = CLASSES[".".join(name[:2])].__mro__ if len(name) == 3 else ()
    own = [dict(methods(base)).get(name[-1]) for base in bases]
    return " ".join([doc_of(function), *(doc_of(each) for each in own if each)])


def short(problems):
    return "\n" + "\n".join(problems)


def test_every_public_name_method_and_property_has_a_docstring():
    bare = [path for path, thing in {**FUNCTIONS, **CLASSES}.items() if not doc_of(thing)]
    assert not bare, short(bare)


def test_docstrings_name_every_argument():
    problems = []
    for path, function in FUNCTIONS.items():
        words = set(re.findall(r"\w+", documented(path)))
        missing = [
            name
            for name, given in inspect.signature(function).parameters.items()
            if name not in words | EVERYWHERE
            and not name.startswith("_")
            and not telling(given.annotation)
        ]
        if missing:
            problems.append(f"{path}: {', '.join(missing)}")
    assert not problems, short(problems)


def test_docstrings_name_every_field():
    problems = []
    for path, cls in CLASSES.items():
        if not dataclasses.is_dataclass(cls):
            continue
        docs = [base.__doc__ or "" for base in cls.__mro__ if base is not object]
        words = set(re.findall(r"\w+", " ".join([*docs, attribute_docs(cls)])))
        missing = [
            f.name
            for f in dataclasses.fields(cls)
            if f.name not in words
            and "doc" not in f.metadata
            and not f.name.startswith("_")
            and not telling(f.type)
        ]
        if missing:
            problems.append(f"{path}: {', '.join(missing)}")
    assert not problems, short(problems)


def attribute_docs(cls):
    """Names of the attributes that have a docstring or a comment of their own."""
    found = []
    for base in cls.__mro__:
        if base.__module__.startswith("amoeboid"):
            file = definitions(inspect.getsourcefile(base))
            (own,) = [node for node in file.values() if node.name == base.__name__]
            for node, after in pairwise(own.body):
                documented = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
                if isinstance(node, ast.AnnAssign) and documented:
                    found.append(f" {node.target.id} ")
    return "".join(found)


def test_docstrings_of_arrays_state_shapes():
    problems = [
        path
        for path, function in FUNCTIONS.items()
        if re.search(r"\bArray\b|NDArray", returned(function))
        and not SHAPE.search(documented(path))
        and not SHAPE_WORDS.search(documented(path))
    ]
    assert not problems, short(problems)


def test_docstrings_of_numbers_state_units():
    problems = []
    for path, function in FUNCTIONS.items():
        doc, kind = documented(path), returned(function)
        numbers = re.fullmatch(r"(float|Array|NDArray.*|tuple\[(float|Array)\b.*)( \| None)?", kind)
        if numbers and not DIMENSION.search(doc) and not UNIT_WORDS.search(doc):
            problems.append(path)
    assert not problems, short(problems)


def test_dimensions_in_docstrings_are_of_length_time_mass_and_filaments():
    problems = [
        f"{path}: [{text}]"
        for path, thing in {**FUNCTIONS, **CLASSES}.items()
        for text in re.findall(r"\[([A-Z0-9^/ ()]*[A-Z][A-Z0-9^/ ()]*)\]", doc_of(thing))
        if not DIMENSIONS.fullmatch(text)
    ]
    assert not problems, short(problems)


def test_docstrings_name_the_errors_that_are_raised():
    problems = []
    for path, function in FUNCTIONS.items():
        doc = doc_of(function)
        missing = sorted({name for name in raised(function) if name not in doc})
        if missing:
            problems.append(f"{path}: {', '.join(missing)}")
    assert not problems, short(problems)


def test_docstrings_of_public_functions_say_what_is_raised():
    problems = [
        name
        for name in amoeboid.__all__
        if inspect.isfunction(getattr(amoeboid, name))
        and "Raises" not in doc_of(getattr(amoeboid, name))
    ]
    assert not problems, short(problems)


def test_formulas_of_the_theory_name_their_source():
    problems = [
        path
        for path, function in FUNCTIONS.items()
        if path.startswith("amoeboid.closed_forms")
        and path.split(".")[2] not in NO_FORMULAS
        and not SOURCE.search(documented(path))
    ]
    assert not problems, short(problems)


def test_labels_of_the_paper_in_docstrings_exist():
    things = {**FUNCTIONS, **CLASSES, **{m.__name__: m for m in theory_modules()}}
    problems = [
        f"{path}: {label}"
        for path, thing in things.items()
        for group in LABEL.findall(doc_of(thing))
        for label in re.findall(r"`(\w+)`", group)
        if label not in labels()
    ]
    assert not problems, short(problems)
