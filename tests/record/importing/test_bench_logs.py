"""Logs of benches: constants that no log holds, torques, and JSON."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from coupled.errors import InputError
from coupled.record.importing.convert import import_log
from coupled.record.record import Record

TIME_s = np.arange(200) / 100.0
ANGLE_deg = 20.0 * np.sin(3.0 * TIME_s)
TORQUE_Nm = 4.0 * np.sin(3.0 * TIME_s + 0.2)
ROWS = [
    {"t": float(t), "joint": {"angle": float(a), "torque": float(m)}, "q": [float(a), 7.0]}
    for t, a, m in zip(TIME_s, ANGLE_deg, TORQUE_Nm, strict=True)
]
COLUMNS = list(zip(TIME_s.tolist(), ANGLE_deg.tolist(), TORQUE_Nm.tolist(), strict=True))
MAP = """
[clock]
from = "t"
[channels.wheel_deflection_rad]
from = "joint.angle"
unit = "deg"
[channels.wheel_force_N]
from = "joint.torque"
unit = "N·m"
radius_m = 0.2
[channels.dynamic_pressure_Pa]
value = 0.0
"""


def made(folder: Path, text: str, log_map: str = MAP, name: str = "log.json") -> Record:
    (folder / name).write_text(text)
    (folder / "map.toml").write_text(log_map)
    return import_log(folder / name, folder / "map.toml")[0]


@pytest.mark.parametrize(
    ("text", "name"),
    [
        (json.dumps(ROWS), "log.json"),
        ("\n".join(map(json.dumps, ROWS)), "log.jsonl"),
        ("\n\n".join(map(json.dumps, ROWS)) + "\n", "log.json"),
    ],
)
def test_json_in_a_list_or_a_row_a_line_is_one_record(tmp_path: Path, text: str, name: str) -> None:
    record = made(tmp_path, text, name=name)
    assert record["wheel_deflection_rad"] == pytest.approx(np.deg2rad(ANGLE_deg))
    assert record["wheel_force_N"] == pytest.approx(TORQUE_Nm / 0.2)
    assert not record["dynamic_pressure_Pa"].any()


@pytest.mark.parametrize(
    "around",
    [
        {"rig": "j1", "rows": ROWS},
        {
            "rig": "j1",
            "t": TIME_s.tolist(),
            "joint.angle": ANGLE_deg.tolist(),
            "joint.torque": TORQUE_Nm.tolist(),
        },
    ],
    ids=["rows", "columns"],
)
def test_rows_or_columns_may_have_a_head_beside_them(tmp_path: Path, around: object) -> None:
    record = made(tmp_path, json.dumps(around))
    assert record["wheel_deflection_rad"] == pytest.approx(np.deg2rad(ANGLE_deg))
    assert record["wheel_force_N"] == pytest.approx(TORQUE_Nm / 0.2)


def test_no_cell_replaces_another_of_its_name(tmp_path: Path) -> None:
    rows = [f'{{"t": {t}, "a": {a}, "a": 9.0, "F": {m}}}' for t, a, m in COLUMNS]
    named = MAP.replace("joint.torque", "F").replace("joint.angle", "{}")
    with pytest.raises(InputError, match='a: two columns have this name; give from = "a#1" or'):
        made(tmp_path, "\n".join(rows), named.format("a"))
    record = made(tmp_path, "\n".join(rows), named.format("a#1"))
    assert record["wheel_deflection_rad"] == pytest.approx(np.deg2rad(ANGLE_deg))
    both = json.dumps([{**row, "joint.angle": 0.0} for row in ROWS])
    with pytest.raises(InputError, match=r"joint\.angle: row 1 has two cells of this name"):
        made(tmp_path, both)


def test_a_table_of_columns_and_an_element_of_a_list_are_read(tmp_path: Path) -> None:
    table = {"t": TIME_s.tolist(), "q": [row["q"] for row in ROWS]}
    log_map = '[clock]\nfrom = "t"\n[channels.wheel_deflection_rad]\nfrom = "q"\nunit = "deg"\n'
    record = made(tmp_path, json.dumps(table), log_map + "element = 1\n")
    assert record["wheel_deflection_rad"] == pytest.approx(np.deg2rad(ANGLE_deg))


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('{"t": 0}\n{"t": 1,}\n', "line 2 is no JSON"),
        ('{"t": [0, 1], "F": [2]}', "columns of different lengths: t 2, F 1"),
        ("[1, 2]", "row 1 is no object of columns"),
        ("3", "is no table"),
        ("[" * 100_000, "nests too deeply|line 1 is no JSON"),
        ("[]", "holds no rows"),
    ],
)
def test_json_that_is_no_log_is_refused_by_the_line(tmp_path: Path, text: str, why: str) -> None:
    with pytest.raises(InputError, match=why):
        made(tmp_path, text)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("radius_m = 0.2", "", "is a torque: give radius_m, at which the force acts"),
        ('unit = "deg"', 'unit = "deg"\nradius_m = 0.2', "goes with a force that is logged as a"),
        ("value = 0.0", "", "from: is missing: the column of the log; or give value"),
        ("value = 0.0", 'value = 0.0\nfrom = "t"', "value: and from exclude each other"),
        ("value = 0.0", "value = 0.0\ndelay_s = 0.1", "goes with from, not with value"),
        ("radius_m = 0.2", "radius_m = 0.0", "greater than 0"),
    ],
)
def test_what_does_not_go_together_is_refused(tmp_path: Path, old: str, new: str, why: str) -> None:
    with pytest.raises(InputError, match=why):
        made(tmp_path, json.dumps(ROWS), MAP.replace(old, new))


def test_a_constant_has_a_unit_and_stands_in_the_account(tmp_path: Path) -> None:
    log_map = MAP.replace("value = 0.0", 'value = 2.5\nunit = "kPa"')
    record = made(tmp_path, json.dumps(ROWS), log_map)
    assert np.all(record["dynamic_pressure_Pa"] == 2500.0)
    assert record.manifest is not None
    said = record.manifest["import"]["channels"]["dynamic_pressure_Pa"]
    assert (said["from"], said["doubts"]) == ("value 2500", [])
    with pytest.raises(InputError, match="at least one needs from"):
        made(tmp_path, json.dumps(ROWS), '[clock]\nfrom = "t"\n[channels.load_factor]\nvalue = 1.0')


def test_json_text_of_half_a_character_is_read_and_an_endless_number_refused(
    tmp_path: Path,
) -> None:
    odd = [row | {"note\ud800": "\ud800"} for row in ROWS]
    assert len(made(tmp_path, json.dumps(odd))) == len(ROWS)
    with pytest.raises(InputError, match=r"joint\.torque: row 5 holds no finite number"):
        rows = json.loads(json.dumps(ROWS))
        rows[4]["joint"]["torque"] = 10**400
        made(tmp_path, json.dumps(rows))
