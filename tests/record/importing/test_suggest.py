"""A map proposed for an unknown log: certain values are filled in, others are marked."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import polars as pl
import pytest
from nptdms import ChannelObject, TdmsWriter
from scipy import io as scipy_io

from coupled.errors import InputError
from coupled.record.channels import record_channels
from coupled.record.importing.convert import import_log
from coupled.record.importing.mapping import own_unit
from coupled.record.importing.suggest.dialect import guess_layout
from coupled.record.importing.suggest.names import read_name
from coupled.record.importing.suggest.propose import Proposal, propose
from coupled.resources import shipped_rigs
from coupled.rig.rigfile import read_rig
from coupled.units import POUND_N
from tests.support.commands import coupled, files
from tests.support.logs import FORCE_N, GOOD, DEFLECTION_m, TIME_s

SHARED = Path(__file__).parents[4] / "shared" / "real" / "so101" / "raw" / "friction_gravity"


def proposed(path: Path, rig: str = "") -> tuple[Proposal, dict[str, Any]]:
    proposal = propose([path], read_rig(shipped_rigs()[rig]) if rig else None)
    return proposal, tomllib.loads(proposal.text)


@pytest.mark.parametrize(
    ("name", "channel", "unit"),
    [
        ("FORCE_LB", "column_force_N", "lbf"),
        ("wheelForce [daN]", "wheel_force_N", "daN"),
        ("stick_pos_mm", "column_deflection_m", "mm"),
        ("Pedal encoder", "pedals_computed_m", ""),
        ("column_modifying_force_N", "column_modifying_force_N", "N"),
        ("Pitch Rate (deg/s)", "pitch_rate_rad_per_s", "deg/s"),
        ("q_deg_s", "pitch_rate_rad_per_s", "deg/s"),
        ("QBAR", "dynamic_pressure_Pa", ""),
        ("True Airspeed [kt]", "true_airspeed_m_per_s", "kt"),
        ("elevator_deg", "elevator_rad", "deg"),
        ("ELEV [deg]", "elevator_rad", "deg"),
        ("AIL", "aileron_rad", ""),
        ("ELEV [lbf]", "column_force_N", "lbf"),
        ("Nz", "load_factor", ""),
        ("timestamp", "time", ""),
        ("Time (ms)", "time", "ms"),
        ("torque_Nm", "", ""),
        ("cpuload.load", "", ""),
        ("Mode", "", ""),
        ("hand grip", "column_deflection_m", ""),
        ("Force_kN", "column_force_N", "kN"),
        ("coil_force_mN", "column_force_N", "mN"),
        ("load daN", "column_force_N", "daN"),
        ("Force_uN", "column_force_N", ""),
        ("qbar_kPa", "dynamic_pressure_Pa", "kPa"),
        ("grip_um", "column_deflection_m", "um"),
        ("Kraft", "column_force_N", ""),
        ("Knüppelkraft [daN]", "column_force_N", "daN"),
        ("Griffweg (mm)", "column_deflection_m", "mm"),
        ("Weg Soll [mm]", "column_computed_m", "mm"),
        ("Handradwinkel [deg]", "wheel_deflection_rad", "deg"),
        ("Drehmoment_Nm", "", ""),
        ("rig.qbar_psf", "dynamic_pressure_Pa", "psf"),
        ("/air.tas [kt]", "true_airspeed_m_per_s", "kt"),
        ("state.alpha", "alpha_rad", ""),
        ("cmd.theta", "", ""),
        ("stick.roll_deg", "", "deg"),
        ("attitude.q", "", ""),
        ("stick pitch", "", ""),
    ],
)
def test_a_channel_and_its_unit_are_recognised_by_name(name: str, channel: str, unit: str) -> None:
    found = read_name(name)
    assert (found.channel, found.unit) == (channel, unit)


def test_every_channel_of_a_record_is_known_by_its_own_name() -> None:
    for name in record_channels(["column", "wheel", "pedals"], flown=True)[1:]:
        assert read_name(name).channel == name
        assert read_name(name).unit == own_unit(name)


GERMAN = {"delimiter": ";", "decimal": ","}


@pytest.mark.parametrize(
    ("name", "made", "layout"),
    [
        ("log.csv", GOOD, {}),
        ("log.tsv", GOOD.replace(",", "\t"), {"delimiter": "\t"}),
        ("log.txt", GOOD.replace(",", "  "), {"delimiter": " "}),
        ("log.csv", GOOD.replace(",", ";").replace(".", ","), GERMAN),
        ("log.csv", "Rig 7\ntest 3\n" + GOOD, {"skip_rows": 2}),
        ("log.csv", "# made by x\n# and y\n" + GOOD, {"comment": "#"}),
        ("log.csv", GOOD.replace("\n", "\nms,lbf,in\n", 1), {"units_row": True}),
        ("log.csv", GOOD.partition("\n")[2], {"header": False}),
        (
            "log.csv",
            GOOD.replace("0,", "n/a,", 1).replace("D\n", "D\n0,1,2\n"),
            {"missing": ["n/a"]},
        ),
    ],
)
def test_the_layout_of_a_file_is_detected(
    tmp_path: Path, name: str, made: str, layout: dict[str, Any]
) -> None:
    (tmp_path / name).write_text(made)
    found = guess_layout(tmp_path / name)
    plain = {"delimiter": ",", "decimal": ".", "comment": "", "skip_rows": 0, "header": True}
    plain |= {"units_row": False, "missing": []}
    assert {key: getattr(found, key) for key in plain} == {**plain, **layout}


def test_utf_16_and_latin_1_are_detected(tmp_path: Path) -> None:
    for encoding in ("utf-16", "latin-1"):
        (tmp_path / "log.csv").write_bytes(GOOD.replace("F", "F°", 1).encode(encoding))
        assert guess_layout(tmp_path / "log.csv").encoding == encoding


def test_a_proposal_without_questions_imports_as_it_is(tmp_path: Path) -> None:
    table = {
        "t": TIME_s,
        "column force [lbf]": FORCE_N / 4.4482216152605,
        "column encoder [mm]": 1e3 * DEFLECTION_m,
        "QBAR_psf": np.full(TIME_s.size, 100.0),
    }
    pl.DataFrame(table).write_csv(tmp_path / "log.csv")
    proposal, _ = proposed(tmp_path / "log.csv")
    assert proposal.questions == ()
    (tmp_path / "map.toml").write_text(proposal.text)
    record, _ = import_log(tmp_path / "log.csv", tmp_path / "map.toml")
    np.testing.assert_allclose(record["column_force_N"], FORCE_N, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(record["column_computed_m"], DEFLECTION_m, rtol=1e-9, atol=1e-12)
    assert record["dynamic_pressure_Pa"][0] == pytest.approx(4788.03, rel=1e-5)


def test_an_open_unit_is_asked_and_its_map_refused(tmp_path: Path) -> None:
    pl.DataFrame({"t": TIME_s, "column force": FORCE_N}).write_csv(tmp_path / "log.csv")
    proposal, table = proposed(tmp_path / "log.csv")
    assert table["channels"]["column_force_N"]["unit"] == "?"
    assert "N or daN or lbf" in proposal.questions[0]
    (tmp_path / "map.toml").write_text(proposal.text)
    with pytest.raises(InputError, match=r'map.toml: channels.column_force_N.unit: "\?" is a q'):
        import_log(tmp_path / "log.csv", tmp_path / "map.toml")


def test_a_rigs_travel_settles_what_size_alone_leaves_open(tmp_path: Path) -> None:
    inches = {"t": TIME_s, "column encoder": 5.0 * np.sin(TIME_s)}  # or centimetres
    pl.DataFrame(inches).write_csv(tmp_path / "log.csv")
    assert proposed(tmp_path / "log.csv")[1]["channels"]["column_computed_m"]["unit"] == "?"
    travel = read_rig(shipped_rigs()["737"]).controls["column"].travel
    assert 0.05 < travel < 0.5
    _, table = proposed(tmp_path / "log.csv", "737")
    assert table["channels"]["column_computed_m"]["unit"] in ("?", "in", "cm")
    millimetres = {"t": TIME_s, "column encoder": 900.0 * travel * np.sin(TIME_s)}
    pl.DataFrame(millimetres).write_csv(tmp_path / "log.csv")
    _, table = proposed(tmp_path / "log.csv", "737")
    assert table["channels"]["column_computed_m"]["unit"] == "mm"


def test_signs_and_counts_are_asked_and_not_guessed(tmp_path: Path) -> None:
    counts = np.rint(10.0 * FORCE_N)
    table = {
        "t": TIME_s,
        "wheel load": np.where(counts < 0, 1024 - counts, counts),
        "column force [N]": -FORCE_N,
        "column encoder [m]": DEFLECTION_m,
    }
    pl.DataFrame(table).write_csv(tmp_path / "log.csv")
    proposal, found = proposed(tmp_path / "log.csv")
    assert found["channels"]["wheel_force_N"]["sign_bit"] == "?"
    assert found["channels"]["wheel_force_N"]["unit"] == "?"
    assert found["channels"]["column_force_N"]["sign"] == "?"
    assert any("fit 10" in question for question in proposal.questions)
    assert any("moves against column encoder" in question for question in proposal.questions)


def test_two_logs_of_a_robot_arm_are_mapped(tmp_path: Path) -> None:
    files = [SHARED / "control.csv", SHARED / "state_motor.csv"]
    if not SHARED.exists():
        head = {"control.csv": "timestamp,positions", "state_motor.csv": "timestamp,positions"}
        files = [tmp_path / name for name in head]
        for file in files:
            rows = [f'{20_000 * k},"[0.1, {0.01 * (k % 9)}]"' for k in range(200)]
            file.write_text(head[file.name] + "\n" + "\n".join(rows))
    text = propose(files).text
    table = tomllib.loads(text)
    clock = {"from": "timestamp", "unit": "us"}
    assert table["clock"] in (clock, clock | {"frame_rate_Hz": 50.0})
    assert table["channels"]["column_computed_m"]["from"] == "positions"
    assert table["channels"]["column_deflection_m"]["log"] == "state_motor.csv"
    assert table["channels"]["column_deflection_m"]["element"] == "?"


def test_rows_that_come_unevenly_are_given_a_rate(tmp_path: Path) -> None:
    steps = np.random.default_rng(1).integers(18_000, 22_000, 400)
    force = np.sin(np.arange(400))
    rows = [f"{t},{f:.6f}" for t, f in zip(np.cumsum(steps), force, strict=True)]
    (tmp_path / "log.csv").write_text("time_us,column_force_N\n" + "\n".join(rows))
    proposal, table = proposed(tmp_path / "log.csv")
    assert table["clock"] == {"from": "time_us", "unit": "us", "frame_rate_Hz": 50.0}
    (tmp_path / "map.toml").write_text(proposal.text)
    _, account = import_log(tmp_path / "log.csv", tmp_path / "map.toml")
    assert account.clock.frame_rate_Hz == 50.0


def test_dates_that_come_unevenly_are_counted_in_seconds(tmp_path: Path) -> None:
    times = np.cumsum(np.random.default_rng(1).integers(18_000, 22_000, 400))
    rows = [f"2026-03-01 12:00:{t / 1e6:09.6f},{np.sin(t):.6f}" for t in times]
    (tmp_path / "log.csv").write_text("date,column_force_N\n" + "\n".join(rows))
    _, table = proposed(tmp_path / "log.csv")
    assert table["clock"] == {"from": "date", "date": "iso", "frame_rate_Hz": 50.0}


def test_a_file_that_is_not_a_log_is_refused(tmp_path: Path) -> None:
    for content in ("", "a,b\n", "hello world of words\n" * 9, "x,y\n" + "1,2\n" * 9):
        (tmp_path / "log.csv").write_text(content)
        with pytest.raises(InputError, match=r"log.csv"):
            propose([tmp_path / "log.csv"])


@pytest.mark.parametrize("kind", ["mat", "h5"])
def test_a_file_of_one_matrix_is_refused_with_how_to_read_it(tmp_path: Path, kind: str) -> None:
    rows = np.column_stack([TIME_s, FORCE_N, DEFLECTION_m])
    path = tmp_path / f"log.{kind}"
    if kind == "mat":
        scipy_io.savemat(path, {"data": rows})
    else:
        with h5py.File(path, "w") as file:
            file["data"] = rows
    with pytest.raises(InputError, match=r"data: .* x 3 numbers.* log.matrix and log.names"):
        propose([path])


@pytest.mark.parametrize("kind", ["h5", "tdms"])
def test_a_gain_in_the_file_is_asked_about(tmp_path: Path, kind: str) -> None:
    """Before, the map had no question about the scale, and the import refused it."""
    path, step = tmp_path / f"log.{kind}", {"wf_increment": 1.0 / 60.0}
    named = {"time_s": TIME_s, "force_N": FORCE_N / 2.5, "column_computed_m": DEFLECTION_m}
    gains = {"force_N": {"gain": 2.5, **step}, "time_s": {"scale": 1e-3}}
    if kind == "h5":
        with h5py.File(path, "w") as file:
            for name, values in named.items():
                file[name] = values
                file[name].attrs.update(gains.get(name, {}))
    else:
        del named["time_s"]
        with TdmsWriter(path) as writer:
            writer.write_segment(
                [ChannelObject("g", n, v, gains.get(n, step)) for n, v in named.items()]
            )
    proposal, table = proposed(path)
    force, clock = table["channels"]["column_force_N"], table["clock"]
    asked = [question for question in proposal.questions if "the file gives" in question]
    assert len(asked) == (2 if kind == "h5" else 1)
    assert force["scale"] == "?"
    assert (clock.get("unit") == "?") is (kind == "h5")
    text = proposal.text.replace('scale = "?"', "scale = 2.5")
    if kind == "h5":
        (tmp_path / "map.toml").write_text(text.replace('unit = "?"', "", 1))
        with pytest.raises(InputError, match=r"time_s: the file gives scale = 0.001, .*clock.unit"):
            import_log(path, tmp_path / "map.toml")
        text = text.replace('unit = "?"', 'unit = "s"', 1)
    (tmp_path / "map.toml").write_text(text)
    record, _ = import_log(path, tmp_path / "map.toml")
    np.testing.assert_allclose(record["column_force_N"], FORCE_N, rtol=1e-9)


def test_without_a_header_a_column_that_rises_evenly_may_be_the_time(tmp_path: Path) -> None:
    rows = zip(1e3 * TIME_s, FORCE_N, DEFLECTION_m, strict=True)
    (tmp_path / "log.txt").write_text("\n".join("  ".join(map(str, row)) for row in rows))
    proposal, table = proposed(tmp_path / "log.txt")
    assert table["clock"] == {"from": "?", "unit": "ms"}
    assert proposal.questions[0].startswith('clock.from: "1" rises evenly')


@pytest.mark.parametrize("name", ["log.csv", "log.mat"])
def test_where_no_name_says_anything_all_is_asked(tmp_path: Path, name: str) -> None:
    """A file without a header, and a MATLAB file of a, b and c."""
    time = np.arange(60) / 50.0
    columns = {"a": np.sin(time), "b": 40.0 * np.cos(time), "c": np.zeros(60)}
    if name.endswith(".csv"):
        rows = zip(*columns.values(), strict=True)
        (tmp_path / name).write_text("\n".join(",".join(map(str, row)) for row in rows))
    else:
        scipy_io.savemat(tmp_path / name, columns)
    proposal, table = proposed(tmp_path / name, "report-column")
    force, place = (table["channels"][f"column_{q}"] for q in ("force_N", "computed_m"))
    assert force == place == {"from": "?", "unit": "?"}
    asked = next(one for one in proposal.questions if "which column is the force?" in one)
    assert "(15.2 to 40)" in asked
    assert '"c"' not in asked and '"3"' not in asked
    assert any(one.startswith("clock.rate_Hz") for one in proposal.questions)
    with pytest.raises(InputError):
        (tmp_path / "map.toml").write_text(proposal.text)
        import_log(tmp_path / name, tmp_path / "map.toml")


def test_the_command_writes_a_map_and_asks(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(GOOD.replace("F", "FORCE_LB", 1))
    done = coupled(tmp_path, "import", "log.csv", "--suggest", "map.toml")
    assert done.returncode == 0, done.stderr
    assert "column_force_N  FORCE_LB" in done.stdout
    assert (tmp_path / "map.toml").exists()
    neither = coupled(tmp_path, "import", "log.csv")
    assert neither.returncode == 2
    assert "--suggest" in neither.stderr
    before = files(tmp_path)
    for wrong in (
        ["--suggest", "log.csv"],
        ["--suggest", "m.txt"],
        ["--suggest", "m", "--map", "m"],
    ):
        done = coupled(tmp_path, "import", "log.csv", *wrong)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert files(tmp_path) == before


def two_places(first: str, second: str, yields_m_per_N: float) -> dict[str, np.ndarray]:
    """Return a log whose second place yields to a pull that is logged as negative."""
    noise = 2e-6 * np.random.default_rng(5).standard_normal(TIME_s.size)
    more_m = DEFLECTION_m + yields_m_per_N * FORCE_N + noise
    table = {"t": TIME_s, "stick load [N]": -FORCE_N, first: DEFLECTION_m, second: more_m}
    return {name: np.asarray(values) for name, values in table.items()}


@pytest.mark.parametrize(
    ("names", "yields", "computed", "asked"),
    [
        (("A pos [m]", "B pos [m]"), 1e-4, "A pos [m]", False),
        (("A pos [m]", "B pos [m]"), -1e-4, "B pos [m]", False),
        (("A pos [m]", "B pos [m]"), 0.0, "", True),
        (("Act pos [m]", "Grip LVDT [m]"), 0.0, "Act pos [m]", False),
        (("Grip LVDT [m]", "Act pos [m]"), 0.0, "Act pos [m]", False),
        (("Encoder [m]", "Grip [m]"), 1e-4, "Encoder [m]", False),
        (("Encoder [m]", "Grip [m]"), -1e-4, "", True),
        (("Act pos [m]", "Grip LVDT [m]"), -1e-4, "", True),
        (("Motor pos [m]", "Handle pos [m]"), -1e-4, "", True),
        (("LVDT1 [m]", "LVDT2 [m]"), 1e-4, "LVDT1 [m]", False),
        (("LVDT1 [m]", "LVDT2 [m]"), -1e-4, "LVDT2 [m]", False),
        (("LVDT1 [m]", "LVDT2 [m]"), 0.0, "", True),
        (("Handle encoder [m]", "Motor encoder [m]"), 0.0, "Motor encoder [m]", False),
        (("stick pos [m]", "stick pos demand [m]"), 0.0, "stick pos demand [m]", False),
    ],
)
def test_two_places_are_told_apart_by_name_or_by_force_or_asked(
    tmp_path: Path, names: tuple[str, str], yields: float, computed: str, asked: bool
) -> None:
    pl.DataFrame(two_places(*names, yields)).write_csv(tmp_path / "log.csv")
    _, table = proposed(tmp_path / "log.csv")
    found = {
        key: table["channels"][f"column_{key}_m"]["from"] for key in ("computed", "deflection")
    }
    if asked:
        assert found == {"computed": "?", "deflection": "?"}
    else:
        other = next(name for name in names if name != computed)
        assert found == {"computed": computed, "deflection": other}


def test_a_place_alone_whose_end_is_open_is_asked(tmp_path: Path) -> None:
    pl.DataFrame({"t": TIME_s, "pos [m]": DEFLECTION_m}).write_csv(tmp_path / "log.csv")
    proposal, table = proposed(tmp_path / "log.csv")
    assert table["channels"]["column_deflection_m"]["from"] == "?"
    assert "channels.column_computed_m" in proposal.questions[0]


def test_two_columns_of_one_name_are_both_listed(tmp_path: Path) -> None:
    lines = GOOD.replace("T,F,D", "T,grip force [lbf],grip force [lbf]", 1)
    (tmp_path / "log.csv").write_text(lines)
    proposal, _ = proposed(tmp_path / "log.csv")
    assert proposal.mapped == {"column_force_N": "grip force [lbf]#1"}
    assert proposal.unmapped == ("grip force [lbf]#2",)


@pytest.mark.parametrize("other", ["Stick Force Cmd", "Kraft Sollwert", "force sensor ok", "Force"])
def test_a_measured_force_comes_before_a_commanded_one_and_a_switch(
    tmp_path: Path, other: str
) -> None:
    wrong = {
        "force sensor ok": np.where(np.sin(TIME_s) > 0.0, 1.0, 0.0),
        "Force": np.ones(TIME_s.size),
    }
    table = {
        "t [s]": TIME_s,
        f"{other} [N]": wrong.get(other, 1.1 * FORCE_N),
        "Kraft Istwert [N]": FORCE_N,
        "Grip [m]": DEFLECTION_m,
    }
    pl.DataFrame(table).write_csv(tmp_path / "log.csv")
    proposal, _ = proposed(tmp_path / "log.csv")
    assert proposal.mapped["column_force_N"] == "Kraft Istwert [N]"


@pytest.mark.parametrize(
    ("below", "dropped"),
    [
        ([";Motor;Encoder", "[s];[N];[m]"], ["2-3"]),
        (["a;b;c", "d;e;f", "[s];[N];[m]"], ["2-4"]),
        (["s;N;m", ";Motor;Encoder"], ["3"]),
    ],
)
def test_further_rows_of_the_header_are_left_out(
    tmp_path: Path, below: list[str], dropped: list[str]
) -> None:
    numbers = np.column_stack([TIME_s, FORCE_N, DEFLECTION_m])
    rows = [";".join(f"{cell:.9f}" for cell in row).replace(".", ",") for row in numbers]
    text = "\n".join(["t;column force [N];column encoder [m]", *below, *rows, ""])
    (tmp_path / "log.csv").write_text(text)
    proposal, table = proposed(tmp_path / "log.csv")
    assert proposal.questions == ()
    assert table["clock"]["drop_rows"] == dropped
    assert "missing" not in table["log"]
    (tmp_path / "map.toml").write_text(proposal.text)
    record, _ = import_log(tmp_path / "log.csv", tmp_path / "map.toml")
    np.testing.assert_allclose(record["column_force_N"], FORCE_N, atol=1e-6)


@pytest.mark.parametrize("remark", ["", "Remark: bench 3, run 7\n"])
@pytest.mark.parametrize("case", [str.upper, str.lower])
def test_units_below_the_header_are_used_in_any_case_and_below_a_remark(
    tmp_path: Path, remark: str, case: Callable[[str], str]
) -> None:
    """Of 0.6 mm of travel the size alone would make inches."""
    numbers = np.column_stack([TIME_s, FORCE_N / POUND_N, 6e-4 * np.sin(TIME_s) * 1e3])
    rows = [",".join(f"{cell:.9f}" for cell in row) for row in numbers]
    head = f"Time,Stick load,Grip travel\n{remark}{case('s,lbf,mm')}"
    (tmp_path / "log.csv").write_text("\n".join([head, *rows, ""]))
    proposal, table = proposed(tmp_path / "log.csv")
    units = {name: channel["unit"] for name, channel in table["channels"].items()}
    assert units == {"column_force_N": "lbf", "column_deflection_m": "mm"}
    (tmp_path / "map.toml").write_text(proposal.text)
    record, account = import_log(tmp_path / "log.csv", tmp_path / "map.toml")
    np.testing.assert_allclose(record["column_force_N"], FORCE_N, atol=1e-6)
    assert not [line for line in account.warnings if "the log itself" in line]


@pytest.mark.parametrize(
    ("name", "stated", "says"),
    [
        ("Grip", "V", "the log states 'V', no known unit: m or mm"),
        ("Grip", "Zoll", "the log states 'Zoll', no known unit: m or mm"),
        ("Grip_mm", "m", "the log states 'm', the name mm"),
        ("Grip_mm", "mm", ""),
        ("Grip_mm", "V", ""),
        ("Grip", "-", ""),
        ("Grip [V]", "", "the log states 'V', no known unit: m or mm"),
        ("Grip (Zoll)", "", "the log states 'Zoll', no known unit: m or mm"),
        ("Grip [m]", "", ""),
    ],
)
def test_a_unit_that_the_log_leaves_open_is_asked_and_not_guessed_from_the_size(
    tmp_path: Path, name: str, stated: str, says: str
) -> None:
    numbers = np.column_stack([TIME_s, FORCE_N, 0.3 * np.sin(TIME_s)])
    rows = [",".join(f"{cell:.9f}" for cell in row) for row in numbers]
    head = [f"Time,Load [N],{name}", *([f"s,N,{stated}"] if stated else [])]
    (tmp_path / "log.csv").write_text("\n".join([*head, *rows, ""]))
    questions = [each for each in proposed(tmp_path / "log.csv")[0].questions if ".unit" in each]
    assert [says in each for each in questions] == ([True] if says else [])


@pytest.mark.parametrize("form", ["{:.5e} N", "{:,.3f}"])
def test_a_column_of_text_with_a_channels_name_is_left_out_with_the_reason(
    tmp_path: Path, form: str
) -> None:
    force = [form.format(1e3 * each) for each in FORCE_N]
    table = {"t [s]": TIME_s, "Stick load [N]": force, "Grip [m]": DEFLECTION_m}
    pl.DataFrame(table).write_csv(tmp_path / "log.csv")
    proposal, _ = proposed(tmp_path / "log.csv")
    assert "column_force_N" not in proposal.mapped
    text = next(each for each in force if not each.replace(".", "").strip("-").isdigit())
    assert proposal.warnings == (f"Stick load [N]: holds {text!r}, no number, and is left out",)


def test_a_force_in_a_unit_of_torque_is_left_out_with_what_it_needs(tmp_path: Path) -> None:
    table = {"t [s]": TIME_s, "Stick load [daNm]": FORCE_N, "Grip [m]": DEFLECTION_m}
    pl.DataFrame(table).write_csv(tmp_path / "log.csv")
    assert "# Stick load [daNm]  (a torque: with its unit" in proposed(tmp_path / "log.csv")[0].text
