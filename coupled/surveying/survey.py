"""Search of the trim of a JSBSim model, and test flights that find how its controls move.

The first speed to try is that at which the wing carries the weight at a moderate lift coefficient,

    V = √(2·W/(ρ₀·S·C_L)),

by the wing's area and the empty weight in the model's own file; then faster and slower ones, and
other heights. Each try is JSBSim's own full trim, as for a rig. A state is preferred in which the
aircraft, hands off for some seconds, neither meets the ground nor turns over.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from coupled.errors import InputError, nearest
from coupled.files import read_bytes
from coupled.flight.aircraft import make_aircraft
from coupled.flight.airframe import packaged_models
from coupled.flight.directcontrols import check_direct_controls
from coupled.flight.modeltext import UnreadableModelError, parsed
from coupled.record.channels import CONTROL_NAMES, PITCH, ROLL, ControlName
from coupled.resources import aircraft_folder, shipped_rigs
from coupled.rig.parameters import Flight, SurfaceProperties
from coupled.schema import load_toml
from coupled.units import DEGREE_rad, FOOT_m

FRAME_s = 1.0 / 120.0
_LIFT = (0.4, 0.25, 0.6, 0.15, 0.9, 0.08, 1.3)  # lift coefficients at the empty weight, in order
_ALTITUDES_m = (1500.0, 300.0, 5000.0, 9000.0, 15000.0)
_SPEEDS_m_per_s = (50.0, 90.0, 30.0, 140.0, 20.0, 220.0)  # of a model without a wing area
_DENSITY_kg_per_m3 = 1.225
_TO_kg = {"LBS": 0.45359237, "KG": 1.0, "SLUG": 14.5939}
_TO_m2 = {"FT2": FOOT_m**2, "M2": 1.0}
_GEAR_UP = {"gear/gear-cmd-norm": 0.0}
_HOLDS_s = 5.0
_LONGEST_s = 12.0  # largest time for one model
_TURNED_rad = 0.5
_STILL = "does not move its"  # of `check_direct_controls`
_ANGLE = re.compile(r"fcs/.*pos-(rad|deg)")
_STEP, _MOVED_rad = 0.05, 1e-4  # of a command, and of a surface that follows it
_MOST_SURFACES = 4


@dataclass(frozen=True)
class Surveyed:
    """The results for a model; SI.

    `flight` is a state in which it trims and `holds` whether it keeps this state hands off; without
    one, `why` is the reason. `controls` are those that a rig can move; `lacking` has the reasons
    for the others.
    """

    model: str
    flight: Flight | None
    holds: bool = False
    why: str = ""
    controls: tuple[ControlName, ...] = ()
    lacking: tuple[str, ...] = ()
    slowest: float = 0.0  # least calibrated airspeed at that height, m/s
    fastest: float = 0.0
    mass_kg: float = 0.0  # empty
    rigs: tuple[str, ...] = ()

    @property
    def direct(self) -> bool:
        """Whether the controls move their surfaces at once."""
        return self.flight is None or self.flight.direct_controls

    def as_dict(self) -> dict[str, object]:
        """Return the results by name as JSON data."""
        flight = self.flight
        return {
            "model": self.model,
            "trims": flight is not None,
            "altitude_m": flight.altitude if flight else None,
            "calibrated_airspeed_m_per_s": flight.calibrated_airspeed if flight else None,
            "holds": self.holds,
            "why_not": self.why,
            "controls": list(self.controls),
            "direct_controls": self.direct if self.controls else None,
            "lacking": list(self.lacking),
            "rigs": list(self.rigs),
        }


class ModelFile(NamedTuple):
    """A model's main file: the folder of all models, the model's own, and its file there.

    `file` is empty for a file with the name of its folder.
    """

    home: Path
    model: str
    file: str = ""

    @property
    def label(self) -> str:
        """The model's name, and its file's if that differs."""
        return f"{self.model}/{self.file}" if self.file else self.model

    @property
    def path(self) -> Path:
        """The main file."""
        return self.home / self.model / f"{self.file or self.model}.xml"

    @property
    def own(self) -> bool:
        """Whether it is the user's own, which a rig finds by its `model_folder` only."""
        return known_models().get(self.model) != self.home


def known_models() -> dict[str, Path]:
    """Return the available models, packaged and our own: {name: folder of all models}."""
    own = aircraft_folder()
    ours = {f.name: own for f in own.iterdir() if (f / f"{f.name}.xml").is_file()}
    return dict(sorted({**packaged_models(), **ours}.items(), key=lambda one: one[0].lower()))


def chosen_models(words: Sequence[str]) -> list[ModelFile]:
    """Return some models, or all known models.

    A word is a known model, a model's file, its folder, or a folder of models, of which all are
    returned. Raises InputError for other words.
    """
    known = known_models()
    if not words:
        return [ModelFile(home, name) for name, home in known.items()]
    return list(dict.fromkeys(each for word in words for each in _models_of(word, known)))


def chosen_model(word: str) -> ModelFile:
    """Return the one model of a word. Raises InputError for a folder of several models."""
    found = chosen_models([word])
    main = [each for each in found if not each.file and each.model == Path(word).resolve().name]
    if len(found) > 1 and not main:
        labels = ", ".join(each.label for each in found[:5])
        raise InputError(word, "", f"holds {len(found)} models; name the file of one: {labels}")
    return (main or found)[0]


def _models_of(word: str, known: Mapping[str, Path]) -> list[ModelFile]:
    if word in known:
        return [ModelFile(known[word], word)]
    name, _, file = word.partition("/")
    if name in known and (packaged := ModelFile(known[name], name, file)).path.is_file():
        return [packaged]
    try:
        path = Path(word).resolve()
        if path.is_file() and path.suffix == ".xml":
            return [model_file(path)]
        found = _models_in(path) or [each for f in sorted(path.iterdir()) for each in _models_in(f)]
    except (OSError, ValueError):  # no folder, or an impossible name
        found = []
    if not found:
        problem = f"is no JSBSim model and no folder of one (NAME/NAME.xml); {nearest(word, known)}"
        raise InputError(word, "", problem)
    return found


def _models_in(folder: Path) -> list[ModelFile]:
    """Return the models of one folder: the file with its name first, then other main files."""
    if not folder.is_dir():
        return []
    files = sorted(folder.glob("*.xml"), key=lambda file: (file.stem != folder.name, file.name))
    return [model_file(f) for f in files if f.stem == folder.name or _is_main(f)]


def model_file(path: Path) -> ModelFile:
    """Return the model of a main file."""
    folder = path.parent
    return ModelFile(folder.parent, folder.name, "" if path.stem == folder.name else path.stem)


def _is_main(file: Path) -> bool:
    """Return whether a file is a model's main file, by its root."""
    try:
        return parsed(read_bytes(file), file.name).tag == "fdm_config"
    except (InputError, UnreadableModelError):
        return False


def rigs_by_model() -> dict[str, list[str]]:
    """Return the shipped rigs of each model."""
    found: dict[str, list[str]] = {}
    for name, path in shipped_rigs().items():
        if model := load_toml(path).get("flight", {}).get("model"):
            found.setdefault(model, []).append(name)
    return found


def survey(model: ModelFile, *, speeds: bool = False) -> Surveyed:
    """Return the results for a model.

    With `speeds` the range of speeds is found as well. Failures of the model are in the result.
    """
    home = model.home
    known = not model.own and not model.file
    rigs = tuple(rigs_by_model().get(model.model, ())) if known else ()
    mass = _mass_kg(model.path)
    ended_s = time.monotonic() + _LONGEST_s
    found, why = None, ""
    for flight in _tries(model):
        problem = _trims(flight, home)
        if not problem:
            holds = _holds(flight, home)
            if found is None or holds:
                found = (flight, holds)
            if holds:
                break
        else:  # the first state is the most likely one, so its reason is reported
            found_out = problem.partition("calibrated_airspeed_m_per_s = ")[2].partition(": ")[2]
            why = why or found_out.partition("; choose")[0] or problem
        if time.monotonic() > ended_s:
            break
    if found is None:
        return Surveyed(model.label, None, why=why, rigs=rigs, mass_kg=mass)
    flight, holds = found
    flight, controls, lacking = _controls(flight, home)
    slowest = fastest = flight.calibrated_airspeed
    if speeds and controls:
        slowest, fastest = speed_range(flight, home, controls)
    return Surveyed(
        *(model.label, flight, holds, "", controls, lacking),
        *(slowest, fastest, mass, rigs),
    )


def surveyed(word: str, model: ModelFile, airframe_only: bool = False) -> Surveyed:
    """Return the results for a model for a draft rig; `word` names it in errors.

    Raises InputError if it does not trim or, unless `airframe_only`, has no control for a rig.
    """
    found = survey(model, speeds=not airframe_only)
    if found.flight is None:
        raise InputError(word, "", f"does not trim wherever it was tried: {found.why}")
    if not found.controls and not airframe_only:
        problem = f"has no control that a rig could move: {found.lacking[0]}"
        problem += "; --airframe-only writes its aircraft: add a control, with the model's own"
        problem += " command_property and surface_property"
        raise InputError(word, "", problem)
    return found


def _tries(model: ModelFile) -> Iterator[Flight]:
    """Yield states to try, the most likely first, with a retractable gear up."""
    speeds, folder = _likely_speeds(model.path), str(model.home) if model.own else ""
    places = [(i + 2 * j, v, h) for i, v in enumerate(speeds) for j, h in enumerate(_ALTITUDES_m)]
    gear: dict[str, float] | None = None
    for _, speed, altitude in sorted(places):
        flight = Flight(
            model=model.model,
            folder=folder,
            model_file=model.file,
            altitude=altitude,
            calibrated_airspeed=speed,
        )
        if gear is None:
            raised = flight.model_copy(update={"properties": _GEAR_UP})
            problem = _trims(raised, model.home)
            fixed = "has no property" in problem or "sets it itself" in problem
            gear = {} if fixed else _GEAR_UP
        yield flight.model_copy(update={"properties": gear})


def _likely_speeds(file: Path) -> Sequence[float]:
    area, mass = _quantity(file, "wingarea", _TO_m2), _mass_kg(file)
    if area <= 0.0 or mass <= 0.0:
        return _SPEEDS_m_per_s
    loading = 2.0 * 9.80665 * mass / (_DENSITY_kg_per_m3 * area)
    return [round(math.sqrt(loading / lift), 1) for lift in _LIFT]


def _mass_kg(file: Path) -> float:
    return _quantity(file, "emptywt", _TO_kg)


def _quantity(file: Path, tag: str, units: dict[str, float]) -> float:
    """Return a number of a model's file in SI, 0 if it is missing."""
    try:
        element = parsed(read_bytes(file), file.name).find(f".//{tag}")
        if element is None:
            return 0.0
        first = next(iter(units.values()))
        return float(element.text or 0.0) * units.get(element.get("unit", "").upper(), first)
    except (InputError, ValueError, UnreadableModelError):
        return 0.0


def _trims(flight: Flight, home: Path) -> str:
    """Return why a model does not trim, or an empty string."""
    try:
        make_aircraft(flight, FRAME_s, ("column",), [home], "model")
    except InputError as error:
        return error.problem
    return ""


def _holds(flight: Flight, home: Path) -> bool:
    """Return whether a trimmed aircraft keeps its attitude, hands off, for some seconds."""
    aircraft = make_aircraft(flight, FRAME_s, ("column", "wheel"), [home], "model")
    start = aircraft.motion()
    for _ in range(round(_HOLDS_s / FRAME_s)):
        aircraft.step((0.0, 0.0, 0.0))
        if aircraft.trouble():
            return False
    now = aircraft.motion()
    turned = max(abs(now[at] - start[at]) for at in (PITCH, ROLL))
    return math.isfinite(turned) and turned < _TURNED_rad


def _controls(
    flight: Flight, home: Path
) -> tuple[Flight, tuple[ControlName, ...], tuple[str, ...]]:
    """Return the flight with its controls, those that a rig can move, and the others' reasons."""
    asked, led, lacking = _led(flight, home)
    still = [each.partition(":")[0] for each in lacking if _STILL in each]
    own = {control: _moving_angles(flight, home, control) for control in still}
    surfaces = {
        control: SurfaceProperties(position=names) for control, names in own.items() if names
    }
    if not surfaces:
        return asked, led, lacking
    return _led(flight.model_copy(update={"surfaces": surfaces}), home)


def _led(flight: Flight, home: Path) -> tuple[Flight, tuple[ControlName, ...], tuple[str, ...]]:
    """Return the results of `_controls` for the surface properties of the flight."""
    for direct in (True, False):
        asked = flight.model_copy(update={"direct_controls": direct})
        led, lacking = list[ControlName](), list[str]()
        for control in CONTROL_NAMES:
            try:
                check_direct_controls(asked, FRAME_s, (control,), (home,), "model")
                led.append(control)
            except InputError as error:
                reason = error.problem.removeprefix(f"{flight.model} ")
                reason = reason.removeprefix("has no direct controls: it ")
                lacking.append(f"{control}: {reason.partition(';')[0]}")
        if "column" in led:
            return asked, tuple(led), tuple(lacking)
    return asked, (), tuple(lacking)


def _moving_angles(flight: Flight, home: Path, control: str) -> list[str]:
    """Return the model's own positions in rad or deg that a control's command moves.

    Empty if they differ, as those of a surface and its tab do.
    """

    def angles(command: float) -> dict[str, float]:
        aircraft = make_aircraft(flight, FRAME_s, (control,), [home], "model")
        for _ in range(round(1.0 / FRAME_s)):
            aircraft.step((command, 0.0, 0.0))
        reads = {name: aircraft.reader(name) for name in aircraft.names() if _ANGLE.fullmatch(name)}
        return {name: read() for name, read in reads.items() if read is not None}

    still, moved = angles(0.0), angles(-_STEP)
    by_rad = {
        name: (moved[name] - place) * (DEGREE_rad if name.endswith("deg") else 1.0)
        for name, place in still.items()
    }
    found = [name for name, by in by_rad.items() if abs(by) > _MOVED_rad]
    found = [
        name
        for name in found
        if f"{name.removesuffix('deg')}rad" not in found or name.endswith("rad")
    ]
    alike = all(math.isclose(by_rad[name], by_rad[found[0]], rel_tol=1e-3) for name in found)
    return found if alike and len(found) <= _MOST_SURFACES else []


def speed_range(
    flight: Flight, home: Path, controls: tuple[ControlName, ...]
) -> tuple[float, float]:
    """Return the least and the greatest calibrated airspeed, m/s, at which a model flies.

    At both it trims and responds to each of the controls. The search starts at the speed of the
    flight, in steps of a tenth; `home` is the folder of all models.
    """
    slowest, fastest = (_furthest(flight, home, controls, step) for step in (0.9, 1.1))
    return slowest, fastest


def _furthest(flight: Flight, home: Path, controls: tuple[ControlName, ...], step: float) -> float:
    """Return the speed furthest from a trimmed one at which it still trims and responds.

    The search multiplies the speed by `step`.
    """
    speed = flight.calibrated_airspeed
    for _ in range(15):
        further = round(speed * step, 1)
        there = flight.model_copy(update={"calibrated_airspeed": further})
        try:
            check_direct_controls(there, FRAME_s, controls, (home,), "model")
        except InputError:
            break
        speed = further
    return speed
