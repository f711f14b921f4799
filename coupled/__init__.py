"""Fly a JSBSim aircraft through a compliant control loader; calibrate it; diagnose its gaps.

    import coupled

    rig = coupled.load_rig("t37").changed({"controls.column.loader.play_m": 1e-3})
    flight = coupled.fly(rig, column=coupled.Step(force_N=50), duration_s=8)
    flight.record.plot("column_force_N", "pitch_rad")
    table = coupled.compare(rig, column=coupled.Clamp(deflection_m=0.03), duration_s=8)
    found = coupled.diagnose("t37", flight.record)

Load
    load_rig        a rig file, or a shipped rig by name: `Rig`
    new_rig         a draft rig for a JSBSim aircraft; `rig.save` writes it
    models          JSBSim's aircraft: where each trims, how its controls move
    terms           the named functions of an aircraft's aerodynamics, with their shares
    load_run        a run file, or a shipped run by name: a `Manoeuvre` for each case
    read_record     a record of CSV or Parquet: `Record`
    write_record    the reverse, with a manifest
    import_log      a log of your own, by a map of its columns

Fly
    fly             one flight: `.record`, `.outcome`, `.ended_early`
    compare         rigid, uncompensated, each correction, both: `.loss(…)`, `.to_polars()`
    check           runs compared with their expectations
    sweep           a run over values of its parameters, to one table
    Session         a flight in steps: each `step` flies one frame and returns the `State`

Pilots, on `column`, `wheel` or `pedals`
    Step Ramp Doublet ThreeTwoOneOne FrequencySweep ForceTable     a force over time
    Clamp                                                          a held deflection
    Attitude Track                                                 a closed loop
    a function of the `State` that returns a force in N            your own

Calibrate and diagnose
    plan            the readings to take; `bench` simulates readings
    calibrate       S1, S2, S3 and K from readings; `with_calibration` sets them in a rig
    diagnose        the faulty stages of a rig from records: which effect, of which size
    fit             a nominal rig to records of the healthy machine

Analyse and export
    map_authority   authority lost over q̄ and deflection, stick force per g and per knot
    stability       where a rig is stable, over K·G_T
    document        forces and control checks of 14 CFR Part 60
    export          a rig's loader as JSBSim systems
    export_fmu      a control's loader as an FMU

Results display themselves in a notebook. Each has `.report(file)`, most have `.plot()`,
`.to_polars()` and `.to_pandas()`.

Data
    Rig Manoeuvre PressureProfile Record InputError

All is in SI; a name ends in its unit. A pull, right wheel and right pedal are positive. Input that
cannot be used raises InputError: one line with file, key and correction.

Where things are: `coupled.rig` the loader and its equations, `coupled.flight` the aircraft and
pilots, `coupled.record` channels and files, `coupled.authority` lost authority, `coupled.campaign`
many flights, `coupled.calibration`, `coupled.gap` the diagnosis, `coupled.blind` its trials.
Names are loaded when they are first used: `import coupled` takes no time.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from coupled.version import __version__ as __version__

if TYPE_CHECKING:
    from coupled.api.analyses import map_authority, stability
    from coupled.api.benches import bench, plan
    from coupled.api.documents import document
    from coupled.api.exports import export, export_fmu
    from coupled.api.flights import compare, fly, load_run
    from coupled.api.gaps import diagnose, fit
    from coupled.api.records import import_log, read_record, write_record
    from coupled.api.rigs import load_rig, models, new_rig, terms
    from coupled.api.sessions import Session
    from coupled.calibration.calibrate import calibrate
    from coupled.calibration.calibrated import with_calibration
    from coupled.campaign.check import check
    from coupled.campaign.sweep import sweep
    from coupled.errors import InputError
    from coupled.flight.manoeuvre import Manoeuvre, PressureProfile
    from coupled.flight.pilot import (
        Attitude,
        Clamp,
        Doublet,
        ForceTable,
        FrequencySweep,
        Ramp,
        Step,
        ThreeTwoOneOne,
        Track,
    )
    from coupled.flight.state import State
    from coupled.record.record import Record
    from coupled.rig.rig import Rig

__all__ = [
    "Attitude",
    "Clamp",
    "Doublet",
    "ForceTable",
    "FrequencySweep",
    "InputError",
    "Manoeuvre",
    "PressureProfile",
    "Ramp",
    "Record",
    "Rig",
    "Session",
    "State",
    "Step",
    "ThreeTwoOneOne",
    "Track",
    "bench",
    "calibrate",
    "check",
    "compare",
    "diagnose",
    "document",
    "export",
    "export_fmu",
    "fit",
    "fly",
    "import_log",
    "load_rig",
    "load_run",
    "map_authority",
    "models",
    "new_rig",
    "plan",
    "read_record",
    "stability",
    "sweep",
    "terms",
    "with_calibration",
    "write_record",
]

_HOMES = {
    "coupled.api.analyses": ("map_authority", "stability"),
    "coupled.api.benches": ("bench", "plan"),
    "coupled.api.documents": ("document",),
    "coupled.api.exports": ("export", "export_fmu"),
    "coupled.api.flights": ("compare", "fly", "load_run"),
    "coupled.api.gaps": ("diagnose", "fit"),
    "coupled.api.records": ("import_log", "read_record", "write_record"),
    "coupled.api.rigs": ("load_rig", "models", "new_rig", "terms"),
    "coupled.api.sessions": ("Session",),
    "coupled.calibration.calibrate": ("calibrate",),
    "coupled.calibration.calibrated": ("with_calibration",),
    "coupled.campaign.check": ("check",),
    "coupled.campaign.sweep": ("sweep",),
    "coupled.errors": ("InputError",),
    "coupled.flight.manoeuvre": ("Manoeuvre", "PressureProfile"),
    "coupled.flight.pilot": (
        *("Attitude", "Clamp", "Doublet", "ForceTable", "FrequencySweep"),
        *("Ramp", "Step", "ThreeTwoOneOne", "Track"),
    ),
    "coupled.flight.state": ("State",),
    "coupled.record.record": ("Record",),
    "coupled.rig.rig": ("Rig",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used."""
    if name not in _HOME_OF:
        raise AttributeError(f"module 'coupled' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOME_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names, loaded or not."""
    return sorted({*globals(), *__all__})
