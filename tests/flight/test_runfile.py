"""Run files and force tables: each fault in one line, before anything flies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from coupled.errors import InputError
from coupled.flight.manoeuvre import CONFIGURATIONS, configure
from coupled.flight.pilot import edges, read_force_table
from coupled.flight.runfile import read_run
from coupled.resources import shipped_runs
from tests.support.rigs import K_REPORT, bench

RUN = """
name = "test"
card = "A test."
rig = "report-column"
duration_s = 4.0

[pilot.column]
kind = "step"
force_N = 30.0
"""


@pytest.mark.parametrize("name", list(shipped_runs()))
def test_every_shipped_run_reads_and_has_a_card(name: str) -> None:
    cases = read_run(name)
    assert cases[0].name == name
    assert len(cases[0].card.split()) > 12


@pytest.mark.parametrize(
    ("old", "new", "key", "says"),
    [
        ("duration_s = 4.0", "duration_s = 0.0", "duration_s", "greater than 0"),
        ("duration_s", "duration_min", "duration_min", "give duration_s instead"),
        ('"report-column"', '"report-colum"', "rig", "did you mean report-column?"),
        ('"report-column"', '"no/such.toml"', "rig", "there is no such rig file"),
        ('kind = "step"', 'kind = "stepp"', "pilot.column.kind", "did you mean step?"),
        ("force_N = 30.0", "force_lb = 30.0", "pilot.column.force_lb", "give force_N"),
        ("force_N = 30.0", "force_N = nan", "pilot.column.force_N", "finite"),
        (
            "force_N = 30.0",
            "force_N = 30.0\nstart_s = 4.0",
            "pilot.column.start_s",
            "is 4; give less than duration_s = 4, when the run ends",
        ),
        (
            'kind = "step"\nforce_N = 30.0',
            'kind = "table"\ntime_s = [5.0, 6.0]\nforce_N = [0.0, 9.0]',
            "pilot.column.time_s",
            "is 5; give less than duration_s = 4",
        ),
        (
            "force_N = 30.0\n",
            'force_N = 30.0\n[[case]]\nlabel = "a"\npilot = { "column.start_s" = 9.0 }\n',
            "case[0].pilot.column.start_s",
            "is 9; give less than duration_s = 4",
        ),
        ("[pilot.column]", "[pilot.wheel]", "pilot.wheel", "the rig has no wheel"),
        ("[pilot.column]", "[pilots.column]", "pilots", "did you mean pilot?"),
        (
            'kind = "step"\nforce_N = 30.0',
            'kind = "clamp"\ndeflection_m = 0.2',
            "pilot.column.deflection_m",
            "beyond the control's travel",
        ),
        (
            "force_N = 30.0\n",
            'force_N = 30.0\n[[case]]\nlabel = "a"\nrig = { "frame_rate_hz" = 60.0 }\n',
            "frame_rate_hz",
            "frame_rate_Hz",
        ),
        (
            "force_N = 30.0\n",
            'force_N = 30.0\n[[case]]\nlabel = "a"\npilot = { "pedals.force_N" = 60.0 }\n',
            "case[0].pilot.pedals.force_N",
            "no such pilot",
        ),
        (
            "force_N = 30.0\n",
            "force_N = 30.0\n[bench]\ntime_s = [0.0]\ndynamic_pressure_Pa = [1.0]\n",
            "bench",
            "has an aircraft",
        ),
        (
            "duration_s = 4.0\n",
            'duration_s = 4.0\nconfigurations = ["stiff"]\n',
            "configurations",
            "'rigid'",
        ),
    ],
)
def test_a_fault_is_one_line_with_its_key(
    tmp_path: Path, old: str, new: str, key: str, says: str
) -> None:
    path = tmp_path / "run.toml"
    assert old in RUN
    path.write_text(RUN.replace(old, new))
    with pytest.raises(InputError) as caught:
        read_run(str(path))
    assert key in str(caught.value)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "time_s,column_force_N\n0,0\n1,\n2,3\n",
            "row 3 holds no finite number",
        ),
        ("time_s,column_force_N\n0,0\n1,x\n", "row 3"),
        ("time_s,column_force_N\n0,0\n2,1\n1,1\n", "must rise: row 4"),
        ("time_s,force\n0,0\n1,1\n", "no such column; known: force, time_s"),
        ("time_s,column_force_N\n0,0\n", "at least two rows"),
        (
            "time_s,column_force_N\n" + "".join(f"{t / 10},1\n" for t in range(30) if t != 17),
            "gap of 0.2 s after row 18",
        ),
        ("", "is not a table"),
    ],
)
def test_force_tables_have_no_gaps(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "force.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_force_table(path, "column_force_N")
    assert says in str(caught.value)
    assert str(path) in str(caught.value)


def test_edges_go_to_each_level_over_the_rise() -> None:
    t = np.linspace(0.0, 4.0, 401)
    signal = edges(t, [(1.0, 2.0), (3.0, -1.0)], 0.5)
    assert signal[[0, 100, 125, 150, 300, 325, 400]] == pytest.approx([0, 0, 1, 2, 2, 0.5, -1])
    steps = edges(t, [(1.0, 2.0)], 0.0)
    assert set(steps) == {0.0, 2.0}


def test_the_five_configurations_differ_in_their_corrections_only() -> None:
    made = {name: configure(bench(), name).controls["column"] for name in CONFIGURATIONS}
    bends = {name: control.loader.bend for name, control in made.items()}
    assert bends == dict.fromkeys(CONFIGURATIONS, K_REPORT) | {"rigid": 0.0}
    on = {n: (c.compensation.deflection, c.compensation.gradient) for n, c in made.items()}
    assert on["compensated"] == (True, True)
    assert on["deflection only"] == (True, False)
    assert on["gradient only"] == (False, True)
    assert on["uncompensated"] == on["rigid"] == (False, False)
