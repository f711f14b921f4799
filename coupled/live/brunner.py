"""The address of a Brunner loader, `cls2sim://HOST:PORT?WORD=VALUE&…`, parsed and checked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from urllib.parse import parse_qsl, urlsplit

import numpy as np

from coupled.errors import InputError, nearest
from coupled.live.cls2sim import External, Version2
from coupled.live.link import Link
from coupled.live.transport import Given, Transport
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig

_WORDS = ("protocol", "transport", "counts_per_N", "turn", "profile_N_per_d", "scale")


def open_cls2sim(url: str, rig: Rig) -> Link:
    """Return the loader at `cls2sim://HOST:PORT?WORD=VALUE&…`; raises InputError.

    `protocol` is `external` (default) or `v2`; `transport` is `udp` or `tcp`.
    """
    parts = urlsplit(url)
    try:
        port = parts.port
    except ValueError:
        port = None
    if not parts.hostname or port is None:
        raise InputError("--loader", "", f"is {url!r}; give cls2sim://HOST:PORT?counts_per_N=…")
    words = dict(parse_qsl(parts.query, keep_blank_values=True))
    for word in words:
        if word not in _WORDS:
            raise InputError("--loader", word, f"is not known; {nearest(word, _WORDS)}")
    protocol = words.get("protocol", "external")
    kinds = {"external": ("udp", External), "v2": ("tcp", Version2)}
    if protocol not in kinds:
        raise InputError("--loader", "protocol", f"is {protocol!r}; {nearest(protocol, kinds)}")
    usual, kind = kinds[protocol]
    transport = words.get("transport", usual)
    if transport not in ("udp", "tcp") or (protocol == "v2" and transport == "udp"):
        raise InputError("--loader", "transport", f"is {transport!r}; give {usual}")
    given = _given(words, rig, protocol)
    name = f"cls2sim://{parts.hostname}:{port}"
    return kind(name, Transport(transport, parts.hostname, port, name), rig, given)


def _given(words: Mapping[str, str], rig: Rig, protocol: str) -> Given:
    turn = frozenset(filter(None, words.get("turn", "").split(",")))
    for control in turn:
        if control not in rig.controls:
            hint = nearest(control, rig.controls)
            raise InputError("--loader", "turn", f"no control {control!r}; {hint}")
    counts = _number(words, "counts_per_N", "no source gives the unit of a force; measure it")
    if protocol == "external":
        return Given(counts, turn)
    if "pedals" in rig.controls:
        problem = "no source that we have gives the rudder's bit of v2; fly the others"
        raise InputError("--loader", "pedals", problem)
    for name, data in rig.controls.items():
        if data.schedule.force is not None:
            _check_profile(data, str(name))
        if data.schedule.second_gradient or data.loader.breakout:
            problem = "v2 scales one gradient; it has no second one and no breakout to order"
            raise InputError("--loader", str(name), problem)
    profile = _number(words, "profile_N_per_d", "the gradient of the loader's own force profile")
    scale = _number(words, "scale", "the scale factor at which the profile has that gradient")
    return Given(counts, turn, profile, scale)


def _check_profile(data: Control, name: str) -> None:
    """Refuse a curve that is not the loader's own force profile times a factor over q̄.

    Within 1 % of the largest force at each q̄, less than a step of the scale factor.
    """
    force = np.array(data.schedule.force)
    shape = force[np.argmax(np.abs(force).max(axis=1))]
    scaled = np.outer(force @ shape / (shape @ shape), shape)
    if np.any(np.abs(force - scaled) > 0.01 * np.abs(force).max(axis=1, keepdims=True)):
        problem = "v2 scales one force profile; give a curve whose rows are proportional"
        raise InputError("--loader", name, problem)
    if data.compensation.gradient and data.compensation.bend > 0.0:
        problem = "v2 scales a force profile over δc, which compensation.gradient would bend;"
        raise InputError("--loader", name, f"{problem} give false")


def _number(words: Mapping[str, str], word: str, why: str) -> float:
    if word not in words:
        raise InputError("--loader", word, f"is missing: {why} (docs/live.md says how)")
    try:
        value = float(words[word])
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or value == 0.0 or abs(value) > 1e9:
        raise InputError("--loader", word, f"is {words[word]!r}; give a number other than 0")
    return value
