"""From the options of the command line to a live flight: run or rig, loader, hand."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from dataclasses import replace

from coupled.api.rigs import load_rig
from coupled.errors import InputError, nearest
from coupled.flight.manoeuvre import Manoeuvre, PressureProfile
from coupled.flight.runfile import read_run
from coupled.live.brunner import open_cls2sim
from coupled.live.hands import LiveHand
from coupled.live.link import Link, split_address
from coupled.live.udp import UdpLink
from coupled.rig.rig import Rig

LONGEST_s = 7200.0  # of a flight, as of a run
HANDS = ("pilot", "page", "stick")


def check_installed(package: str, what: str) -> None:
    """Raise InputError, with the command to install it, if a package of the extra is missing."""
    if importlib.util.find_spec(package) is None:
        problem = f"needs {package}, which is not installed: pip install 'coupled[live]'"
        raise InputError(what, "", problem)


def open_link(url: str, rig: Rig, lockstep: bool, deflection: bool) -> Link | None:
    """Return the loader at `url`, or None for the simulated one; raises InputError.

    `deflection`: a loader of the open protocol measures δ.
    """
    if url == "sim":
        return None
    if url.startswith("cls2sim://"):
        return open_cls2sim(url, rig)
    scheme, host, port = split_address(url)
    if scheme == "udp":
        return UdpLink(host, port, rig, deflection, lockstep)
    raise InputError("--loader", "", f"is {url!r}; {nearest(scheme, ('sim', 'udp', 'cls2sim'))}")


def run_live(run: str, case: str, duration_s: float | None, hand: str) -> Manoeuvre:
    """Return the case of a run that is flown live; by default the first.

    `duration_s` replaces the run's; `hand` is `pilot` for the run's own, otherwise every control
    has a live hand. Raises InputError.
    """
    _check(duration_s, hand)
    cases: Mapping[str, Manoeuvre] = {each.label: each for each in read_run(run)}
    if case and case not in cases:
        raise InputError(run, "--case", f"no case {case!r}; {nearest(case, cases)}")
    flown = cases[case] if case else next(iter(cases.values()))
    if duration_s is not None:
        flown = replace(flown, duration_s=duration_s)
    if hand != "pilot":
        flown = replace(flown, pilots=dict.fromkeys(flown.rig.controls, LiveHand()))
    return flown


def rig_live(rig: str, duration_s: float | None) -> Manoeuvre:
    """Return a rig with a live hand on each control, to be flown until it is stopped.

    It ends after `duration_s`, by default two hours. A bench has the middle q̄ of its schedule.
    Raises InputError.
    """
    _check(duration_s, "page")
    loaded, bench = load_rig(rig), None
    if loaded.flight is None:
        pressures = next(iter(loaded.controls.values())).schedule.dynamic_pressure
        middle = 0.5 * (pressures[0] + pressures[-1])
        bench = PressureProfile(time_s=[0.0], dynamic_pressure_Pa=[middle])
    pilots = dict.fromkeys(loaded.controls, LiveHand())
    longest = LONGEST_s if duration_s is None else duration_s
    return Manoeuvre(loaded, pilots, longest, bench=bench, name=f"{loaded.name}-live")


def _check(duration_s: float | None, hand: str) -> None:
    if hand not in HANDS:
        raise InputError("--hand", "", f"is {hand!r}; {nearest(hand, HANDS)}")
    if duration_s is not None and not 0.0 < duration_s <= LONGEST_s:
        problem = f"is {duration_s:g} s; give more than 0, at most {LONGEST_s:g}"
        raise InputError("--duration", "", problem)
