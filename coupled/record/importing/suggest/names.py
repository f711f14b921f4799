"""The content of a column's name: its channel, its unit, and whether it is certain.

A name is divided into words at its signs and capitals. A word may name a control, a quantity, or a
unit.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

from coupled.record.channels import ControlName, channel
from coupled.record.importing.mapping import CHANNELS, own_unit
from coupled.units import SPELLINGS, parse_unit, usual_unit


def _set(text: str) -> frozenset[str]:
    return frozenset(text.split())


CONTROLS: dict[ControlName, frozenset[str]] = {
    "column": _set(
        "column col stick yoke elev elevator pitch lon longitudinal knueppel steuersaeule"
    ),
    "wheel": _set("wheel whl aileron ail roll lat lateral handrad"),
    "pedals": _set("pedals pedal ped rudder rud yaw dir directional pedale"),
}
# Words of a setpoint: a force column with one of them is proposed only if there is no other.
COMMANDS = _set("cmd command commanded target setpoint ref soll")
COMMANDS |= _set("demand demanded desired reference")
QUANTITIES = {
    "modifying_force": _set("fmod modifying"),
    "force": _set("force frc f load loadcell lc pull gauge newton lbf kraft"),
    "computed": _set("computed servo actuator control stell aktor antrieb") | COMMANDS,
    "deflection": _set("deflection defl grip hand handle true actual measured state sensor")
    | _set("griff ist"),
}
# Words for transducers of position, which identify the end only if no other word does.
DEVICES = {"computed": _set("encoder enc pot lvdt"), "deflection": _set("laser")}
ENDS = ("computed", "deflection")
PLACES = _set("position pos angle disp displacement travel weg winkel lage")  # of either end
# A motion's channel by any of these sets of words, the longest match first.
MOTION = {
    "dynamic_pressure_Pa": "qbar|q bar|qc|dynamic pressure|dyn press|impact pressure",
    "true_airspeed_m_per_s": "tas|true airspeed|airspeed true|vtas|vt",
    "altitude_m": "altitude|alt|height",
    "load_factor": "nz|load factor|loadfactor|g load|normal acceleration",
    "pitch_rate_rad_per_s": "pitch rate|q rate|q",
    "roll_rate_rad_per_s": "roll rate|p rate|p",
    "yaw_rate_rad_per_s": "yaw rate|r rate|r",
    "alpha_rad": "alpha|aoa|angle of attack",
    "sideslip_rad": "beta|sideslip|aos",
    "pitch_rad": "theta|pitch|pitch attitude|pitch angle",
    "roll_rad": "phi|bank|roll|roll attitude|roll angle|bank angle",
    "heading_rad": "psi|heading|hdg",
    "elevator_rad": "elevator|elevator position|elevator deflection|de",
    "aileron_rad": "aileron|aileron position|aileron deflection|da",
    "rudder_rad": "rudder|rudder position|rudder deflection|dr",
}
# Short names of surfaces; in other units than an angle's they are a control's.
SHORT = {"elev": "elevator_rad", "ail": "aileron_rad", "rud": "rudder_rad"}
TIME = _set("time timestamp stamp clock utc date datetime elapsed sec seconds")
TIME |= _set("zeit uhrzeit zeitstempel datum")
TORQUE = _set("torque moment nm")
# German words of one, of which the last part is a quantity: `Handkraft`, `Istwert`.
COMPOUND = re.compile(r"(?<=[a-z]{3})(kraft|weg|winkel|moment|wert)(?![a-z])")
UMLAUTS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss"})
# Words of names that have a load or a state but are no part of a control.
COMPUTER = _set(
    "cpu cpuload gpu ram memory mem bus network net disk battery thread task process queue"
)
# A symbol with a prefix, as in `F_kN`, whose capital begins no word of its own.
_BRACKET = re.compile(r"[\[({<]\s*([^\])}>]+?)\s*[\])}>]\s*$")
_PREFIXED = re.compile(r"(?<![A-Za-z])([a-z]{1,2}(?:N|Pa|Nm))\W*$")


@dataclass(frozen=True)
class Reading:
    """The content of a name. `channel` is "time", a record's channel, or "" if it has none.

    `sure` is false if the control or the meaning is ambiguous, as that of a time which has only
    the unit of one; `either_end`: it is a position of the grip or the computed one. `commanded`: a
    force with a word of a setpoint; `by_device`: only a transducer's name identifies the end.
    """

    channel: str
    unit: str = ""
    sure: bool = True
    either_end: bool = False
    commanded: bool = False
    by_device: bool = False


def words_of(name: str) -> list[str]:
    """Return the words of a name in lower case: `ColPos_in` is col, pos, in."""
    spaced = re.sub(r"([a-z0-9])([A-Z])", r"\1 \2", name)
    plain = unicodedata.normalize("NFC", spaced).lower().translate(UMLAUTS)
    return re.findall(r"[a-z]+|\d+", COMPOUND.sub(r" \1", plain))


def read_name(name: str, listed_unit: str = "", log: str = "") -> Reading:
    """Return the reading of a column's name, with the log's unit and the log's own name."""
    if name in CHANNELS:
        return Reading(name, usual_unit(listed_unit) or own_unit(name))
    stem, unit = _unit(name)
    unit = usual_unit(listed_unit) or unit
    words = words_of(stem)
    timed = _is(unit, "s")
    if set(words) & {*TIME, "t"} and "rate" not in words and (timed or not unit):
        return Reading("time", unit, timed or bool(set(words) & TIME))
    text = " ".join(words)
    for found, spellings in MOTION.items():
        if text in spellings.split("|") or any(
            f" {spelling} " in f" {text} " for spelling in spellings.split("|") if " " in spelling
        ):
            return Reading(found, unit)
    if field := _motion_of_field(name):
        return Reading(field, unit, sure=False)
    if text in SHORT and (not unit or _is(unit, "rad")):
        return Reading(SHORT[text], unit)
    moved = _moved(words, unit, words_of(log))
    return moved or Reading("time" if timed else "", unit, not timed)


def _motion_of_field(name: str) -> str:
    """Return the motion that a field of a struct, group or topic is named after, as `air.qbar`.

    Not after one or two letters, such as a quaternion's `q`, nor in a struct of a control or of
    setpoints.
    """
    struct, _, field = name.rpartition(".")
    words = words_of(_unit(field)[0])
    if not struct or set(words_of(struct)) & COMMANDS.union(*CONTROLS.values()):
        return ""
    text = " ".join(words) if len("".join(words)) > 2 else ""
    return next((found for found, known in MOTION.items() if text in known.split("|")), "")


def _unit(name: str) -> tuple[str, str]:
    """Return a name without its unit, and the unit: in brackets, or as the last words."""
    bracket = _BRACKET.search(name)
    if bracket and parse_unit(bracket.group(1)) is not None:
        return name[: bracket.start()], bracket.group(1)
    prefixed = _PREFIXED.search(name)
    if prefixed:
        known = parse_unit(prefixed[1]) is not None
        return name[: prefixed.start()], prefixed[1] if known else ""
    words = words_of(name)
    for count in (3, 2, 1):
        last = " ".join(words[-count:])
        if len(words) > count and last in SPELLINGS:
            return " ".join(words[:-count]), SPELLINGS[last]
    return name, ""


def in_brackets(name: str) -> str:
    """Return the text in brackets at the end of a name, where a unit may be; "" without one."""
    bracket = _BRACKET.search(name)
    return bracket.group(1) if bracket else ""


def _is(unit: str, other: str) -> bool:
    given, own = parse_unit(unit) if unit else None, parse_unit(other)
    return given is not None and own is not None and given.dimension == own.dimension


def _moved(words: list[str], unit: str, log_words: list[str]) -> Reading | None:
    """Return a control's channel, if the words name a control or one of its quantities."""
    present = _singular(words)
    controls = [control for control, names in CONTROLS.items() if present & names]
    if present & COMPUTER or (is_torque(words) and not _is(unit, "N")):
        return None
    quantities = [quantity for quantity, names in QUANTITIES.items() if present & names]
    by_device = not quantities
    quantities = quantities or [q for q, names in DEVICES.items() if present & names]
    by_device &= bool(quantities)
    either = False
    if not quantities and present & PLACES:
        quantities = [q for q in ENDS if set(log_words) & QUANTITIES[q]]
        either = len(quantities) != 1
        quantities = quantities or ["deflection"]
    either |= set(ENDS) <= set(quantities)  # words of both ends
    if not quantities and _is(unit, "N"):
        quantities = ["force"]
    surface = present & {"elevator", "aileron", "rudder"}
    if not quantities or "rate" in present or (surface and "force" not in quantities):
        return None
    if present & {"theta", "phi", "psi", "attitude", "bank", "heading"}:
        return None
    control: ControlName = controls[0] if controls else "column"
    commanded = "force" in quantities[0] and bool(present & COMMANDS)
    sure = len(controls) == 1 and not either and not commanded
    return Reading(channel(control, quantities[0]), unit, sure, either, commanded, by_device)


def is_torque(words: list[str]) -> bool:
    """Tell whether a name is a torque's, which needs an arm to be a force."""
    return bool(_singular(words) & TORQUE)


def _singular(words: list[str]) -> set[str]:
    return {*words, *(word[:-1] for word in words if word.endswith("s") and len(word) > 3)}
