"""Matplotlib's SVG made fit to stand within a page of HTML, beside others."""

from __future__ import annotations

import re
from xml.etree import ElementTree

from coupled.errors import printable

_SVG, _XLINK = "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"
_REFERENCE = re.compile(r"url\(#")


def inline_svg(text: str, prefix: str, label: str) -> str:
    """Return an SVG file's picture without what only a file needs.

    Each id begins with `prefix`, so that no two figures of a page share one; `label` is for those
    who hear the page. Metadata, styles and comments go: they would act on the page, or say when.
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
    """Give ids, and what refers to them, a prefix."""
    target = element.attrib.pop(f"{{{_XLINK}}}href", None)
    if target is not None:  # a part of the picture, or a raster image within it
        inside = target.startswith("#")
        element.set("href", f"#{prefix}{target[1:]}" if inside else target)
    for name, value in element.attrib.items():
        if name == "id":
            element.set(name, prefix + value)
        elif "url(#" in value:
            element.set(name, _REFERENCE.sub(f"url(#{prefix}", value))
