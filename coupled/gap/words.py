"""A diagnosis in the two or three sentences that an engineer can repeat."""

from __future__ import annotations

from typing import Any, cast


def in_words(diagnosis: dict[str, Any], control: str) -> str:
    """Return the two or three sentences that an engineer can repeat."""
    verdict, effects = diagnosis["verdict"], diagnosis["effects"]
    guilty = [stage for stage, found in diagnosis["stages"].items() if found.get("guilty")]
    if verdict == "no_gap":
        unjudged = [stage for stage, found in diagnosis["stages"].items() if "gap" not in found]
        but = f" Not judged: {', '.join(unjudged)}." if unjudged else ""
        within = "every stage that could be judged stays within its noise"
        return f"No gap in the {control}: {within}.{but}"
    named = "; ".join(_one_in_words(effect) for effect in effects)
    shrink = diagnosis["shrink"]
    share = f" It closes {100 * shrink['closed']:.0f} % of the gap." if "closed" in shrink else ""
    if verdict == "unexplained":
        also = f" Found nevertheless: {named}." if effects else ""
        return f"A gap in the {', '.join(guilty)} that no effect of the library explains.{also}"
    rivals = "; ".join(" or ".join(group) for group in diagnosis["rivals"])
    doubt = f" The record cannot tell {rivals}." if verdict == "ambiguous" else ""
    return f"The gap lies in the {', '.join(guilty)}: {named}.{share}{doubt}"


def _one_in_words(effect: dict[str, Any]) -> str:
    numbers = ", ".join(
        f"{name} {found['value']:.4g}"
        + (
            f" ({found['low']:.4g} to {found['high']:.4g})"
            if found["low"] is not None and found["high"] is not None
            else ""
        )
        for name, found in effect["parameters"].items()
    )
    name = cast(str, effect["name"]).replace("_", " ")
    return f"{name}, {numbers}" if numbers else name
