"""Expressions that become JSBSim functions.

Written with Python's operators, an expression is the tree of a `<function>`. A property is
`prop("aero/qbar-psf")`, a number a `<v>`. Constants are evaluated at once, so that an effect with a
neutral value leaves no term.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

_LINE = 96  # largest length of an element on one line


@dataclass(frozen=True)
class Expr:
    """An element of a JSBSim function: its tag, and either text or parts."""

    tag: str
    parts: tuple[Expr, ...] = ()
    text: str = ""

    @property
    def number(self) -> float | None:
        """The value of a constant, None for any other expression."""
        return float(self.text) if self.tag == "v" else None

    def __add__(self, other: Value) -> Expr:
        return total(self, other)

    def __radd__(self, other: Value) -> Expr:
        return total(other, self)

    def __sub__(self, other: Value) -> Expr:
        a, b = self.number, as_expr(other).number
        if a is not None and b is not None:
            return as_expr(a - b)
        if b == 0.0:
            return self
        return Expr("difference", (self, as_expr(other)))

    def __rsub__(self, other: Value) -> Expr:
        return as_expr(other) - self

    def __mul__(self, other: Value) -> Expr:
        return times(self, other)

    def __rmul__(self, other: Value) -> Expr:
        return times(other, self)

    def __truediv__(self, other: Value) -> Expr:
        a, b = self.number, as_expr(other).number
        if a == 0.0:
            return self
        if a is not None and b is not None:
            return as_expr(a / b)
        return self if b == 1.0 else Expr("quotient", (self, as_expr(other)))

    def __rtruediv__(self, other: Value) -> Expr:
        return as_expr(other) / self

    def __neg__(self) -> Expr:
        return times(-1.0, self)

    def lines(self, indent: str = "") -> list[str]:
        """Return the element's XML, a list of lines."""
        if self.tag == "table":
            rows = [indent + "  " + line for line in self.text.split("\n")]
            return [f"{indent}<table>", *rows, f"{indent}</table>"]
        if not self.parts:
            return [f"{indent}<{self.tag}>{self.text}</{self.tag}>"]
        inner = [line for part in self.parts for line in part.lines(indent + "  ")]
        short = "".join(line.strip() for line in inner)
        if len(indent) + len(short) + 2 * len(self.tag) + 5 <= _LINE and "<table>" not in short:
            return [f"{indent}<{self.tag}>{short}</{self.tag}>"]
        return [f"{indent}<{self.tag}>", *inner, f"{indent}</{self.tag}>"]


Value = Expr | float | int


def as_expr(value: Value) -> Expr:
    """Return a number as a constant; an expression unchanged."""
    if isinstance(value, Expr):
        return value
    if not math.isfinite(value):
        raise ValueError(f"{value} is no number that JSBSim could read")
    return Expr("v", text=repr(float(value)))


def prop(name: str) -> Expr:
    """Return a property."""
    return Expr("p", text=name)


def total(*terms: Value) -> Expr:
    """Return a sum; constants are evaluated, nested sums are flattened."""
    known, rest = 0.0, list[Expr]()
    for term in map(as_expr, terms):
        for part in term.parts if term.tag == "sum" else (term,):
            if part.number is None:
                rest.append(part)
            else:
                known += part.number
    if known != 0.0 or not rest:
        rest.append(as_expr(known))
    return rest[0] if len(rest) == 1 else Expr("sum", tuple(rest))


def times(*factors: Value) -> Expr:
    """Return a product; constants are evaluated, nested products are flattened."""
    known, rest = 1.0, list[Expr]()
    for factor in map(as_expr, factors):
        for part in factor.parts if factor.tag == "product" else (factor,):
            if part.number is None:
                rest.append(part)
            else:
                known *= part.number
    if known == 0.0 or not rest:
        return as_expr(known)
    if known != 1.0:
        rest.insert(0, as_expr(known))
    return rest[0] if len(rest) == 1 else Expr("product", tuple(rest))


def _known(tag: str, of: Callable[..., float]) -> Callable[..., Expr]:
    def made(*values: Value) -> Expr:
        parts = tuple(map(as_expr, values))
        numbers = [part.number for part in parts if part.number is not None]
        return as_expr(of(*numbers)) if len(numbers) == len(parts) else Expr(tag, parts)

    return made


least = _known("min", min)
most = _known("max", max)
size = _known("abs", abs)
exponential = _known("exp", math.exp)
cosine = _known("cos", math.cos)
sine = _known("sin", math.sin)
below = _known("floor", math.floor)
remainder = _known("fmod", math.fmod)
less = _known("lt", lambda a, b: float(a < b))
greater = _known("gt", lambda a, b: float(a > b))
equal = _known("eq", lambda a, b: float(a == b))


def either(condition: Value, then: Value, otherwise: Value) -> Expr:
    """Return `then` if the condition is not 0, else `otherwise`."""
    test = as_expr(condition)
    if test.number is not None:
        return as_expr(then if test.number != 0.0 else otherwise)
    a, b = as_expr(then), as_expr(otherwise)
    return a if a == b else Expr("ifthen", (test, a, b))


def within(value: Value, low: Value, high: Value) -> Expr:
    """Return a value limited to two bounds."""
    return least(most(value, low), high)


def looked_up(at: Expr, points: Sequence[float], values: Sequence[float]) -> Expr:
    """Return a table over a property, linear between its rows and constant beyond."""
    if len(set(values)) == 1:
        return as_expr(values[0])
    rows = "\n".join(f"  {x!r} {y!r}" for x, y in zip(points, values, strict=True))
    head = f'<independentVar lookup="row">{at.text}</independentVar>'
    return Expr("table", text=f"{head}\n<tableData>\n{rows}\n</tableData>")
