"""Conversion of matplotlib SVG files to SVG elements that can be embedded in an HTML page."""

from __future__ import annotations

import re
from xml.etree import ElementTree

from coupled.errors import printable

_SVG, _XLINK = "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"
_REFERENCE = re.compile(r"url\(#")


def inline_svg(text: str, prefix: str, label: str) -> str:
    """Return the SVG element of a file, with unique ids and without metadata, styles and comments.

    All ids begin with `prefix`, so that figures on one page do not share ids. `label` is the text
    for screen readers. Styles would apply to the whole page; metadata contain the date.
    """
    root = ElementTree.fromstring(text)
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag in (f"{{{_SVG}}}metadata", f"{{{_SVG}}}style"):
                parent.remove(child)
    for element in root.iter():
        element.tag = element.tag.removeprefix(f"{{{_SVG}}}")
        _rename(element, prefix)
    for name in ("width", "height", "version"):
        root.attrib.pop(name, None)
    root.set("role", "img")
    root.set("aria-label", printable(label))
    return ElementTree.tostring(root, encoding="unicode")


def _rename(element: ElementTree.Element, prefix: str) -> None:
    """Add a prefix to the ids of an element and to the references to them."""
    target = element.attrib.pop(f"{{{_XLINK}}}href", None)
    if target is not None:  # a reference within the file, or an embedded raster image
        inside = target.startswith("#")
        element.set("href", f"#{prefix}{target[1:]}" if inside else target)
    for name, value in element.attrib.items():
        if name == "id":
            element.set(name, prefix + value)
        elif "url(#" in value:
            element.set(name, _REFERENCE.sub(f"url(#{prefix}", value))
