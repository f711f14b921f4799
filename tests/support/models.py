"""Copies of packaged JSBSim models with edited aerodynamics."""

from __future__ import annotations

import shutil
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from pathlib import Path

from coupled.flight.airframe import packaged_models


def edited_model(
    folder: Path, model: str, edit: Callable[[ET.Element], None], models: Path | None = None
) -> Path:
    """Copy a model into a folder of models, with its <aerodynamics> edited; return that folder."""
    copy = folder / model
    shutil.copytree((models or packaged_models()[model]) / model, copy)
    tree = ET.parse(copy / f"{model}.xml")
    aerodynamics = tree.getroot().find("aerodynamics")
    assert aerodynamics is not None
    edit(aerodynamics)
    tree.write(copy / f"{model}.xml")
    return folder


def multiplied(factors: Mapping[str, float]) -> Callable[[ET.Element], None]:
    """Return an edit that scales functions, selected by the ends of their names."""

    def edit(aerodynamics: ET.Element) -> None:
        for end, factor in factors.items():
            found = [f for f in aerodynamics.iter("function") if f.get("name", "").endswith(end)]
            assert len(found) == 1, (end, [f.get("name") for f in aerodynamics.iter("function")])
            product = found[0].find("product")
            assert product is not None
            ET.SubElement(product, "value").text = repr(factor)

    return edit


def scaled_term(name: str, factor: float) -> Callable[[ET.Element], None]:
    """Return an edit that multiplies the one function of a name, whatever its form."""

    def edit(aerodynamics: ET.Element) -> None:
        (function,) = (f for f in aerodynamics.iter("function") if f.get("name") == name)
        inside = [part for part in function if part.tag != "description"]
        for part in inside:
            function.remove(part)
        product = ET.SubElement(function, "product")
        ET.SubElement(product, "value").text = repr(factor)
        product.extend(inside)

    return edit
