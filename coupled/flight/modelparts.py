"""Parts of a JSBSim model's forces and moments, each scaled by a factor k in the model's XML.

A part is one of five kinds. `Scaled` is the part due to one quantity x: in each function F of an
axis it is F(x) − F(x₀), so that

    F ← k·F(x) + (1 − k)·F(x₀),

for any form of F: a product has its coefficient scaled, a table its values less that at x₀.
Functions outside the axis to which F refers are copied with x₀ for x. `Whole` is all functions of
an axis, and `Term` one function by its name: F ← k·F. `Thrust` is the force and moment F of all
engines, to which external reactions add (k − 1)·F. `Constant` is a coefficient k that is
added along an axis: k·q̄·S of a force, k·q̄·S·c̄ of a moment.

At the neutral k (1, of a constant 0) the model equals the filed one to the bit. k and x₀ are
properties, set after loading.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol
from xml.etree import ElementTree

from coupled.errors import nearest
from coupled.flight.modeltext import ModelText, axis_of, named_functions

Element = ElementTree.Element
FORCE = ("aero/qbar-psf", "metrics/Sw-sqft")  # q̄·S, lbf
MOMENT = (*FORCE, "metrics/cbarw-ft")  # q̄·S·c̄, lbf·ft
LATERAL_MOMENT = (*FORCE, "metrics/bw-ft")  # q̄·S·b, lbf·ft


class NothingToScaleError(Exception):
    """A model lacks a part; `name` is the part's key, `lacking` the missing thing and a remedy."""

    def __init__(self, name: str, lacking: str) -> None:
        super().__init__(lacking)
        self.name, self.lacking = name, lacking


def _none_of(quantity: str) -> str:
    return f"no {quantity} that could be scaled; leave it at 1"


class Part(Protocol):
    """A part of a model's forces and moments that a factor can scale."""

    @property
    def name(self) -> str:
        """The key of its factor in a rig's `flight` section."""

    @property
    def neutral(self) -> float:
        """The factor of the filed model."""

    def settings(self, factor: float) -> dict[str, float]:
        """Return the properties that scale the part, with their values for a factor."""

    def make_scalable(self, model: ModelText) -> None:
        """Write the properties into a model's text. Raises NothingToScaleError."""


@dataclass(frozen=True)
class Scaled:
    """The part of the aerodynamics due to one quantity.

    `properties` are JSBSim's names of the `quantity`, of which a model may use any; `axes` are
    those in which its part is scaled, by default all.
    """

    name: str
    quantity: str
    properties: tuple[str, ...]
    axes: tuple[str, ...] = ()
    neutral: float = 1.0

    @property
    def factor(self) -> str:
        """The property of k."""
        return f"coupled/{self.name}/factor"

    @property
    def rest(self) -> str:
        """The property of 1 − k."""
        return f"coupled/{self.name}/rest"

    def held(self, name: str) -> str:
        """Return the property of x₀ for one of `properties`."""
        return f"coupled/{self.name}/held-{self.properties.index(name)}"

    def settings(self, factor: float) -> dict[str, float]:
        """Return the properties of k and 1 − k with their values."""
        return {self.factor: factor, self.rest: 1.0 - factor}

    def make_scalable(self, model: ModelText) -> None:
        """Scale F(x) − F(x₀) in each function of the axes that depends on the quantity."""
        aerodynamics = model.section("aerodynamics")
        if aerodynamics is None or not _scale_dependent(aerodynamics, self):
            raise NothingToScaleError(self.name, _none_of(self.quantity))


@dataclass(frozen=True)
class Whole:
    """All functions of some axes of the aerodynamics."""

    name: str
    quantity: str
    axes: tuple[str, ...]
    neutral: float = 1.0

    def settings(self, factor: float) -> dict[str, float]:
        """Return the property of k with its value."""
        return {f"coupled/{self.name}/factor": factor}

    def make_scalable(self, model: ModelText) -> None:
        """Multiply each function of the axes by k."""
        aerodynamics = model.section("aerodynamics")
        axes = [] if aerodynamics is None else aerodynamics.findall("axis")
        found = [f for a in axes if axis_of(a) in self.axes for f in a.findall("function")]
        if aerodynamics is None or not found:
            raise NothingToScaleError(self.name, _none_of(self.quantity))
        _multiply(aerodynamics, found, self)


@dataclass(frozen=True)
class Term:
    """One function of the aerodynamics, by its name in the model."""

    function: str
    neutral: float = 1.0

    @property
    def name(self) -> str:
        """The key of its factor."""
        return f"terms.{self.function}"

    def settings(self, factor: float) -> dict[str, float]:
        """Return the property of k with its value."""
        return {f"coupled/terms/{self.function}/factor": factor}

    def make_scalable(self, model: ModelText) -> None:
        """Multiply the function by k."""
        aerodynamics = model.section("aerodynamics")
        known = {} if aerodynamics is None else named_functions(aerodynamics)
        if aerodynamics is None or not known:
            raise NothingToScaleError(self.name, "no named aerodynamic functions; leave it out")
        if self.function not in known:
            hint = f"no aerodynamic function {self.function!r}; {nearest(self.function, known)}"
            raise NothingToScaleError(self.name, hint)
        _multiply(aerodynamics, [known[self.function]], self)


@dataclass(frozen=True)
class Thrust:
    """The force and moment of all engines."""

    name: str = "thrust"
    neutral: float = 1.0

    def settings(self, factor: float) -> dict[str, float]:
        """Return the property of k − 1 with its value."""
        return {f"coupled/{self.name}/more": factor - 1.0}

    def make_scalable(self, model: ModelText) -> None:
        """Add external reactions: k − 1 times the engines' force and moment."""
        if model.section("propulsion") is None:
            raise NothingToScaleError(self.name, _none_of("thrust"))
        made = ElementTree.fromstring(_thrust_reactions(*self.settings(1.0)))
        reactions = model.section("external_reactions")
        if reactions is None:
            model.root.append(made)
        else:
            reactions[:0] = list(made)


@dataclass(frozen=True)
class Constant:
    """A constant coefficient of a force or moment along an axis, which is added.

    `unit` are the properties by whose product it is multiplied.
    """

    name: str
    axis: str
    unit: tuple[str, ...]
    neutral: float = 0.0

    def settings(self, factor: float) -> dict[str, float]:
        """Return the property of the coefficient with its value."""
        return {f"coupled/{self.name}/coefficient": factor}

    def make_scalable(self, model: ModelText) -> None:
        """Add a function to the axis: the coefficient times its unit."""
        aerodynamics = model.section("aerodynamics")
        axes = [] if aerodynamics is None else aerodynamics.findall("axis")
        axis = next((one for one in axes if axis_of(one) == self.axis), None)
        if aerodynamics is None or axis is None:
            raise NothingToScaleError(self.name, f"no {self.axis} axis; leave it at 0")
        product = ElementTree.SubElement(ElementTree.SubElement(axis, "function"), "product")
        for name in (*self.unit, *self.settings(self.neutral)):
            ElementTree.SubElement(product, "property").text = name
        _declare(aerodynamics, self.settings(self.neutral))


def _multiply(aerodynamics: Element, functions: Sequence[Element], part: Part) -> None:
    """Make each function k times its value."""
    (factor,) = part.settings(1.0)
    for function in functions:
        product = Element("product")
        ElementTree.SubElement(product, "property").text = factor
        _enclose(function, product, product)
    _declare(aerodynamics, part.settings(1.0))


def _enclose(function: Element, whole: Element, inside: Element) -> list[Element]:
    """Put a function's terms into `inside`, and `whole` in their place; return the terms."""
    terms = [part for part in function if part.tag != "description"]
    for term in terms:
        function.remove(term)
    inside.extend(terms)
    function.append(whole)
    return terms


def _declare(section: Element, values: Mapping[str, float]) -> None:
    """Declare properties with their values at the head of a section."""
    for place, (name, value) in enumerate(values.items()):
        declared = Element("property", {"value": f"{value:g}"})
        declared.text = name
        section.insert(place, declared)


def _thrust_reactions(more: str) -> str:
    """Return external reactions that add `more` times the force and moment of the engines.

    The force acts at the origin of the structural frame, so its moment about the centre of gravity
    is taken off.
    """
    arm = [
        "<property>inertia/cg-x-in</property><value>1</value>",
        "<property>inertia/cg-y-in</property><value>-1</value>",
        "<property>inertia/cg-z-in</property><value>1</value>",
    ]

    def crossed(i: int, j: int, sign: int) -> str:
        force = f"<property>forces/fb{'xyz'[j]}-prop-lbs</property>"
        return f"<product><value>{sign / 12.0!r}</value>{arm[i]}{force}</product>"

    def reaction(tag: str, axis: int, value: str) -> str:
        place = '<location unit="IN"><x>0</x><y>0</y><z>0</z></location>'
        way = "".join(f"<{a}>{int(i == axis)}</{a}>" for i, a in enumerate("xyz"))
        return (
            f'<{tag} name="coupled-thrust-{tag}-{"xyz"[axis]}" frame="BODY"><function><product>'
            f"<property>{more}</property>{value}</product></function>"
            f"{place if tag == 'force' else ''}<direction>{way}</direction></{tag}>"
        )

    lines = [f'<external_reactions><property value="0">{more}</property>']
    for axis, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        lines.append(
            reaction("force", axis, f"<property>forces/fb{'xyz'[axis]}-prop-lbs</property>")
        )
        own = f"<property>moments/{'lmn'[axis]}-prop-lbsft</property>"
        lines.append(
            reaction("moment", axis, f"<sum>{own}{crossed(i, j, -1)}{crossed(j, i, 1)}</sum>")
        )
    return "".join([*lines, "</external_reactions>"])


def _scale_dependent(aerodynamics: Element, scaled: Scaled) -> bool:
    """Scale the part due to a quantity; return whether any function depends on it."""
    named = named_functions(aerodynamics)
    found = {name: scaled.held(name) for name in scaled.properties}
    held = dict(found)
    copies: list[Element] = []
    without = set[str]()  # functions independent of the quantity

    def depends(function: Element) -> bool:
        """Return whether a function depends on the quantity; copy the functions in between."""
        hit = False
        for part in function.iter():
            name = _property(part)
            if name in named and name not in held and name not in without:
                without.add(name)
                if depends(named[name]):
                    without.discard(name)
                    held[name] = f"{name}-{scaled.name}-held"
                    copies.append(_held_copy(named[name], held, held[name]))
            hit = hit or name in held
        return hit

    touched = [
        function
        for axis in aerodynamics.findall("axis")
        if not scaled.axes or axis_of(axis) in scaled.axes
        for function in axis.findall("function")
        if depends(function)
    ]
    if not touched:
        return False
    for function in touched:
        _scale(function, scaled, held)
    _declare(aerodynamics, {**scaled.settings(1.0), **dict.fromkeys(found.values(), 0.0)})
    first_axis = list(aerodynamics).index(aerodynamics.findall("axis")[0])
    aerodynamics[first_axis:first_axis] = copies
    return True


def _property(element: Element) -> str:
    """Return the property that an element of a function names, or an empty string."""
    return (element.text or "").strip().removeprefix("-")


def _held_copy(function: Element, held: dict[str, str], name: str = "") -> Element:
    """Return a copy of a function with its references held at x₀."""
    made = copy.deepcopy(function)
    for part in made.iter():
        if (old := _property(part)) in held:
            part.text = (part.text or "").replace(old, held[old])
        part.attrib.pop("name", None)  # of a table; names of properties are unique
    if name:
        made.set("name", name)
    return made


def _scale(function: Element, scaled: Scaled, held: dict[str, str]) -> None:
    """Make a function k times its value, plus 1 − k times that at x₀."""
    total = Element("sum")
    products = [ElementTree.SubElement(total, "product") for _ in range(2)]
    for product, factor in zip(products, (scaled.factor, scaled.rest), strict=True):
        ElementTree.SubElement(product, "property").text = factor
    terms = _enclose(function, total, products[0])
    products[1].extend(_held_copy(term, held) for term in terms)
