"""The diagnosis of a live flight, in a few words and rows for the page."""

from __future__ import annotations

from typing import Any

from coupled.api.gaps import diagnose
from coupled.errors import InputError
from coupled.live.session import LiveFlight

LEAST_s = 5.0  # of a record that is diagnosed


def diagnosed(flight: LiveFlight) -> dict[str, Any]:
    """Return the diagnosis of the flight since the last change of a switch.

    `summary` is a sentence, `rows` the effects found, in words and numbers.
    """
    start_s = flight.since_s
    record = flight.record.between(start_s, float("inf"))
    if len(record) < 2 or record.time_s[-1] - record.time_s[0] < LEAST_s:
        what = "since the last change of a switch " if start_s > 0.0 else ""
        return {"verdict": "", "summary": f"too short {what}to be judged", "rows": []}
    try:
        found = diagnose(flight.rig, record)
    except InputError as error:
        return {"verdict": "", "summary": f"not judged: {error}", "rows": []}
    rows = [["effect", "stage", "found", "95 % interval", "probability"]]
    for effect in found.effects:
        for one in effect.parameters:
            known = one.low is not None and one.high is not None
            interval = f"{one.low:.4g} to {one.high:.4g}" if known else ""
            shown = f"{one.name} = {one.value:.4g}"
            rows.append([effect.name, effect.place, shown, interval, f"{effect.probability:.2f}"])
    judged = f"Judged from {start_s:g} s on, with the switches as they stood. " if start_s else ""
    return {
        "verdict": found.verdict,
        "summary": judged + found.summary,
        "rows": rows if len(rows) > 1 else [],
    }
