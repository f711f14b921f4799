"""Type checks of the arguments of public functions, by their annotations.

`public` marks a function, or a class with its constructor and its public methods. A call whose
arguments do not fit the annotations raises InputError, or TypeError if it does not fit the
signature; both name the function and the argument, and the valid types. The function itself checks
values (a range, an existing file).
"""

from __future__ import annotations

import inspect
import sys
import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from functools import cache, wraps
from numbers import Integral, Real
from os import PathLike, fspath
from pathlib import Path
from typing import (
    Annotated,
    Any,
    Literal,
    TypeVar,
    Union,
    Unpack,
    cast,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

from coupled.errors import InputError, listed, nearest, shown_value

T = TypeVar("T")
MARK = "__checked__"
_PLAIN: dict[Any, str] = {
    str: "text",
    bool: "True or False",
    int: "a whole number",
    float: "a number",
    type(None): "None",
    PathLike: "a path",
    Path: "a path",
    Callable: "a function",
    dict: "a table",
}


def public(thing: T) -> T:
    """Return a function that checks its arguments, or a class whose functions do."""
    if isinstance(thing, type):
        for name, member in list(vars(thing).items()):
            if name == "__init__" or not name.startswith("_"):
                _check_member(thing, name, member)
        return thing
    function: Any = thing
    return cast(T, _checked(function, f"coupled.{function.__qualname__}"))


def checks_itself(function: T) -> T:
    """Mark a function that checks its arguments itself, since it is called in every frame."""
    setattr(function, MARK, True)
    return function


def _check_member(owner: type, name: str, member: Any) -> None:
    """Make a function of a class check its arguments; other members are unchanged."""
    kind = type(member) if isinstance(member, (classmethod, staticmethod)) else None
    function = member.__func__ if kind else member
    # Functions that a library adds to a class, as pydantic does, check their arguments themselves.
    if not isinstance(function, types.FunctionType) or function.__module__ != owner.__module__:
        return
    if getattr(function, MARK, False):
        return
    own = "" if name == "__init__" else f".{name}"
    checked = _checked(function, f"coupled.{owner.__name__}{own}")
    setattr(owner, name, kind(checked) if kind else checked)


def _checked(function: types.FunctionType, name: str) -> Callable[..., Any]:
    signature = inspect.signature(function)

    @wraps(function)
    def call(*given: Any, **named: Any) -> Any:
        try:
            bound = signature.bind(*given, **named)
        except TypeError as error:
            variadic = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
            named_ones = [n for n, p in signature.parameters.items() if p.kind not in variadic]
            takes = [each for each in named_ones if each != "self"]
            raise TypeError(f"{name}: {error}; it takes {', '.join(takes) or 'nothing'}") from None
        for parameter, hint in hints_of(function).items():
            if parameter in bound.arguments:
                _check(bound.arguments[parameter], hint, name, signature.parameters[parameter])
        return function(*given, **named)

    setattr(call, MARK, True)
    return call


@cache
def hints_of(function: types.FunctionType) -> dict[str, Any]:
    """Return {parameter: annotation} of the annotated parameters of a function."""
    written = {n: a for n, a in function.__annotations__.items() if n != "return"}
    # Parameters only, since the return type may be imported for type checkers only.
    holder = types.SimpleNamespace(__annotations__=written)
    return get_type_hints(holder, function.__globals__, None, include_extras=True)


def _check(value: Any, hint: Any, name: str, parameter: inspect.Parameter) -> None:
    """Raise InputError if an argument, or one of several, does not fit."""
    if parameter.kind is inspect.Parameter.VAR_POSITIONAL:
        checks = [(parameter.name, each, hint) for each in value]
    elif parameter.kind is inspect.Parameter.VAR_KEYWORD:
        table = get_args(hint)[0] if get_origin(hint) is Unpack else None
        known = get_type_hints(table, include_extras=True) if is_typeddict(table) else {}
        checks = [(key, each, known.get(key, Any)) for key, each in value.items()]
    else:
        checks = [(parameter.name, value, hint)]
    for key, each, wanted in checks:
        if not fits(each, wanted):
            raise InputError(name, key, f"is {shown_value(each)}; {_remedy(each, wanted)}")


def _remedy(value: Any, hint: Any) -> str:
    words = [word for option in _options(hint) for word in _words(option)]
    if isinstance(value, str) and words:
        return nearest(value, words)
    return f"give {described(hint)}"


def _words(hint: Any) -> tuple[str, ...]:
    """Return the words that a literal allows."""
    literal = get_origin(hint) is Literal
    return tuple(w for w in get_args(hint) if isinstance(w, str)) if literal else ()


def _options(hint: Any) -> Iterator[Any]:
    """Yield the alternatives of a union, or the annotation itself."""
    alias = getattr(get_origin(hint) or hint, "__value__", None)  # as of numpy.NDArray
    if alias is not None:
        yield from _options(alias)
    elif get_origin(hint) is Annotated:
        yield from _options(get_args(hint)[0])
    elif get_origin(hint) in (Union, types.UnionType):
        for one in get_args(hint):
            yield from _options(one)
    else:
        yield hint


def fits(value: Any, hint: Any) -> bool:
    """Return whether a value and its items have the annotated types."""
    return any(_fits_one(value, option) for option in _options(hint))


def _fits_one(value: Any, hint: Any) -> bool:
    origin, inner = get_origin(hint) or hint, get_args(hint)
    test = _TESTS.get(origin)
    if test is not None:
        return test(value, inner)
    if not isinstance(origin, type) or origin in (object, Any):
        return True
    if isinstance(value, str) and origin is not str:
        return False  # a text is a sequence as well
    return isinstance(value, origin) and _holds(value, origin, inner)


_TESTS: dict[Any, Callable[[Any, tuple[Any, ...]], bool]] = {
    Literal: lambda value, inner: any(type(value) is type(x) and value == x for x in inner),
    Callable: lambda value, _: callable(value),
    int: lambda value, _: isinstance(value, Integral) and not isinstance(value, bool),
    float: lambda value, _: _is_number(value),
    PathLike: lambda value, _: isinstance(value, PathLike) and isinstance(fspath(value), str),
}


def _is_number(value: Any) -> bool:
    """Return whether a value is a number that a float can represent."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return False
    return not isinstance(value, Integral) or abs(int(value)) <= sys.float_info.max


def _holds(value: Any, origin: type, inner: tuple[Any, ...]) -> bool:
    """Return whether the items of a container have the annotated types."""
    if not inner:
        return True
    if issubclass(origin, Mapping):
        return all(fits(k, inner[0]) and fits(v, inner[1]) for k, v in value.items())
    if origin is tuple and inner[-1] is not Ellipsis:
        return len(value) == len(inner) and all(map(fits, value, inner))
    return not issubclass(origin, (Sequence, AbstractSet)) or all(fits(x, inner[0]) for x in value)


def described(hint: Any) -> str:
    """Return a description of the values that fit an annotation."""
    options = list(_options(hint))
    alone = [one for one in options if not _is_container(one)]
    found = list(dict.fromkeys(map(_described_one, alone)))
    for one in options:
        if _is_container(one):
            found.append(_described_container(one, alone))
    *others, last = sorted(found, key=lambda words: words == "None")
    return f"{', '.join(others)} or {last}" if others else last


def _is_container(hint: Any) -> bool:
    origin = get_origin(hint)
    kinds = (Mapping, Sequence, AbstractSet)
    return isinstance(origin, type) and issubclass(origin, kinds) and bool(get_args(hint))


def _described_container(hint: Any, alone: Sequence[Any]) -> str:
    """Return a description of a container; `alone` are the alternatives that are no container."""
    held = list(_options(get_args(hint)[-1]))
    if held[-1] is Ellipsis:
        held = list(_options(get_args(hint)[0]))
    known = bool(alone) and all(one in alone for one in held)
    table = issubclass(get_origin(hint) or object, Mapping)
    if held == [Any]:
        return "a table" if table else "a list"
    if known:
        return "a table of such by name" if table else "a list of such"
    inner = described(get_args(hint)[1 if table else 0])
    inner = f"({inner})" if len(held) > 1 else inner.removeprefix("a ").removeprefix("an ")
    keys = f"{_described_one(get_args(hint)[0])}: " if table else ""
    return f"a table {{{keys}{inner}}}" if table else f"a list of {inner}"


def _described_one(hint: Any) -> str:
    origin = get_origin(hint) or hint
    if origin is Literal:
        return f"one of {listed(map(str, get_args(hint)))}"
    if plain := _PLAIN.get(origin):
        return plain
    if not isinstance(origin, type):
        return "a value"
    said: str = getattr(origin, "_WANTED", f"{_article(origin.__name__)} {origin.__name__}")
    return said


def _article(word: str) -> str:
    return "an" if word[0] in "AEIOU" else "a"
