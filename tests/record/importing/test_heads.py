"""Logs of JSBSim, FlightGear and X-Plane, recognised by their headers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import jsbsim
import numpy as np
import pytest

from coupled.errors import InputError
from coupled.record.importing.convert import import_log
from tests.support.commands import coupled

DEG = np.pi / 180.0
DIRECTIVE = """<?xml version="1.0"?>
<output name="own.csv" type="CSV" rate="120">
{blocks}
<property>accelerations/Nz</property>
<property caption="mine">attitude/theta-deg</property>
{properties}
</output>"""
BLOCKS = "<aerosurfaces>ON</aerosurfaces><rates>ON</rates><velocities>ON</velocities>"
BLOCKS += "<position>ON</position><coefficients>ON</coefficients>"
PROPERTIES = {
    "pitch_rate_rad_per_s": "velocities/q-rad_sec",
    "elevator_rad": "fcs/elevator-pos-rad",
    "pitch_rad": "attitude/theta-rad",
    "alpha_rad": "aero/alpha-rad",
    "heading_rad": "attitude/psi-rad",
    "roll_rate_rad_per_s": "velocities/p-rad_sec",
}


def flown(folder: Path, blocks: str, properties: Sequence[str]) -> dict[str, np.ndarray]:
    """Fly a B747 for two seconds with a log of its own; return {channel: as JSBSim held it}."""
    listed = "".join(f"<property>{name}</property>" for name in properties)
    (folder / "out.xml").write_text(DIRECTIVE.format(blocks=blocks, properties=listed))
    fdm = jsbsim.FGFDMExec(None)
    fdm.set_debug_level(0)
    fdm.load_model("B747")
    fdm.set_output_path(str(folder))
    fdm.set_output_directive(str(folder / "out.xml"))
    fdm["ic/vc-kts"], fdm["ic/h-sl-ft"], fdm["ic/psi-true-deg"] = 290.0, 10_000.0, 40.0
    fdm.set_dt(1.0 / 120.0)
    fdm.run_ic()
    rows = []
    for frame in range(240):
        fdm["fcs/elevator-cmd-norm"] = -0.2 * np.sin(frame / 20.0)
        fdm["fcs/aileron-cmd-norm"] = 0.1 * np.sin(frame / 15.0)
        fdm.run()
        rows.append([fdm[name] for name in PROPERTIES.values()])
    del fdm  # closes its file
    return dict(zip(PROPERTIES, np.array(rows).T, strict=True))


@pytest.mark.parametrize("properties", [(), tuple(PROPERTIES.values())], ids=["blocks", "paths"])
def test_a_csv_file_of_jsbsim_is_imported_without_a_map(
    tmp_path: Path, properties: tuple[str, ...]
) -> None:
    truth = flown(tmp_path, "" if properties else BLOCKS, properties)
    record, account = import_log(next(tmp_path.glob("*.csv")))
    assert account.clock.frame_rate_Hz == 120.0
    rows = len(record)
    assert rows > 230
    for name, values in truth.items():
        best = min(
            float(np.max(np.abs(record[name][late : 200 + late] - values[:200]))) for late in (0, 1)
        )
        assert best < 1e-4 * max(float(np.ptp(values)), 0.01), name
    assert abs(float(record["load_factor"][1]) - 1.0) < 0.5
    assert list(record.manifest["inputs_sha256"]) == [next(tmp_path.glob("*.csv")).name]


@pytest.mark.parametrize("mark", [",", "\t", ";", " "])
def test_the_row_before_jsbsims_trim_is_left_out(tmp_path: Path, mark: str) -> None:
    head = "Time,/fdm/jsbsim/attitude/theta-rad,/fdm/jsbsim/fcs/elevator-pos-rad"
    angles = [0.0, *(0.05 + 1e-4 * np.sin(0.3 * np.arange(59)))]
    for first, rows in ((0.0, 59), (0.05, 60)):
        angles[0] = first
        lines = [f"{i / 60.0:.6f},{angle:.9f},0.0{i}" for i, angle in enumerate(angles)]
        (tmp_path / "log.csv").write_text("\n".join([head, *lines]).replace(",", mark) + "\n")
        record, account = import_log(tmp_path / "log.csv")
        assert len(record) == rows
        left_out = "the first row is from before JSBSim's trim, and is left out"
        assert (left_out in account.warnings) == (rows == 59)
        assert record["pitch_rad"][0] == pytest.approx(0.05)


def test_short_rows_below_a_head_of_jsbsim_are_refused(tmp_path: Path) -> None:
    rows = [f"{0.1 * i:.1f},100" for i in range(9)]
    (tmp_path / "log.csv").write_text("\n".join(["Time,q bar (psf),Alpha (deg)", *rows]) + "\n")
    with pytest.raises(InputError, match=r"log\.csv: Alpha \(deg\): is empty"):
        import_log(tmp_path / "log.csv")


def test_flightgears_log_has_seconds_and_property_paths(tmp_path: Path) -> None:
    time = 12.5 + np.arange(120) / 60.0
    theta = 3.0 * np.sin(time)
    head = "Time,/orientation/pitch-deg,/orientation/q-body,/fdm/jsbsim/aero/qbar-psf,Rudder"
    head += ",/controls/engines/engine/throttle,/controls/engines/engine[1]/throttle"
    head += ",/fdm/jsbsim/fcs/flap-pos-norm,/controls/flight/flaps"
    rows = [
        f"{t:.6g},{p:.6f},{3 * DEG * np.cos(t):.8f},21.5,0,0.7,0.6,0.1,0.2"
        for t, p in zip(time, theta, strict=True)
    ]
    (tmp_path / "fg_log.csv").write_text("\n".join([head, *rows]) + "\n")
    record, account = import_log(tmp_path / "fg_log.csv")
    np.testing.assert_allclose(record["pitch_rad"], theta * DEG, atol=1e-7)
    np.testing.assert_allclose(record["pitch_rate_rad_per_s"], 3 * DEG * np.cos(time), atol=1e-7)
    np.testing.assert_allclose(record["dynamic_pressure_Pa"], 21.5 * 47.88025898)
    assert account.unmapped == ("Rudder", "/fdm/jsbsim/fcs/flap-pos-norm")
    levers = {"throttle_norm": 0.7, "throttle_1_norm": 0.6, "flap_norm": 0.2}
    assert {name: float(record[name][0]) for name in levers} == levers


def test_flightgears_own_titles_number_each_part_of_a_path(tmp_path: Path) -> None:
    """As SGPropertyNode::getPath writes them; a switch is in words, as getStringValue."""
    head = "Time,/orientation[0]/pitch-deg[0],/fdm[0]/jsbsim[0]/aero[0]/qbar-psf[0]"
    head += ",/controls[0]/engines[0]/engine[0]/throttle[0]"
    head += ",/controls[0]/engines[0]/engine[1]/throttle[0]"
    head += ",/controls[0]/gear[0]/gear-down[0],/gear[0]/gear[0]/position-norm[0]"
    head += ",/surface-positions[0]/flap-pos-norm[0],/surface-positions[0]/spoilers-pos-norm[0]"
    down = ["true"] * 60 + ["false"] * 60
    rows = [
        f"{k / 60:.6g},{3 * np.sin(k / 60):.6f},21.5,0.7,0.6,{word},1,0.2,0"
        for k, word in enumerate(down)
    ]
    (tmp_path / "fg_log.csv").write_text("\n".join([head, *rows]) + "\n")
    record, account = import_log(tmp_path / "fg_log.csv")
    assert record["pitch_rad"] == pytest.approx(3 * DEG * np.sin(np.arange(120) / 60), abs=1e-7)
    assert record["dynamic_pressure_Pa"] == pytest.approx(21.5 * 47.88025898)
    assert record["gear_norm"].tolist() == [1.0] * 60 + [0.0] * 60
    levers = {"throttle_norm": 0.7, "throttle_1_norm": 0.6, "flap_norm": 0.2, "spoiler_norm": 0.0}
    assert {name: float(record[name][0]) for name in levers} == levers
    assert account.unmapped == ("/gear[0]/gear[0]/position-norm[0]",)


def test_a_lever_in_other_words_is_refused(tmp_path: Path) -> None:
    rows = [f"{k / 60:.6g},{k % 7},{'up' if k else 'true'}" for k in range(120)]
    head = "Time,/orientation/pitch-deg,/controls/gear/gear-down"
    (tmp_path / "fg_log.csv").write_text("\n".join([head, *rows]) + "\n")
    with pytest.raises(InputError, match=r"gear-down: row 2 holds 'true', which is no number"):
        import_log(tmp_path / "fg_log.csv")


def xplane(rows: int = 100) -> str:
    time = np.arange(rows) / 50.0
    names = ["_real,_time", "_totl,_time", "Vtrue,_ktas", "pitch,__deg", "_roll,__deg"]
    names += ["elev1,__deg", "elev1,__deg", "____Q,rad/s", "p-alt,ftMSL", "Gload,norml"]
    lines = ["", "|".join(f"   {name} " for name in names) + "|"]
    for t in time:
        cells = [t + 9.0, t + 100.0, 250.0, 2.0 * np.sin(t), -t, 1.0, 1.0, 0.3, 5000.0, 1.0]
        lines.append("|".join(f" {cell:12.5f} " for cell in cells) + "|")
    return "\n".join(lines) + "\n"


def test_xplanes_data_txt_gives_what_its_head_settles(tmp_path: Path) -> None:
    (tmp_path / "Data.txt").write_text(xplane())
    record, account = import_log(tmp_path / "Data.txt")
    assert account.clock.frame_rate_Hz == 50.0
    np.testing.assert_allclose(record["true_airspeed_m_per_s"], 250.0 * 1852.0 / 3600.0)
    np.testing.assert_allclose(record["pitch_rad"], 2.0 * DEG * np.sin(record.time_s), atol=1e-6)
    np.testing.assert_allclose(record["altitude_m"], 1524.0)
    assert "pitch_rate_rad_per_s" not in record.channels
    assert "____Q,rad/s" in account.unmapped


def test_the_command_says_whose_log_it_is_or_asks_for_a_map(tmp_path: Path) -> None:
    (tmp_path / "Data.txt").write_text(xplane())
    done = coupled(tmp_path, "import", "Data.txt", "-o", "r.csv")
    assert done.returncode == 0, done.stderr
    assert "map: built in for X-Plane, recognised by the log's header" in done.stdout
    (tmp_path / "own.csv").write_text("T,F\n0,1\n1,2\n2,3\n")
    refused = coupled(tmp_path, "import", "own.csv", "-o", "q.csv")
    assert (refused.returncode, refused.stderr.count("\n")) == (2, 1)
    assert "give --map, or --suggest" in refused.stderr
    assert not (tmp_path / "q.csv").exists()


@pytest.mark.parametrize("content", [b"", bytes(99), b"Time,/a\n", b"Time\n1\n", b"\xff\xfe|,\n"])
def test_an_unknown_header_is_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "log.csv").write_bytes(content)
    with pytest.raises(InputError, match=r"log\.csv"):
        import_log(tmp_path / "log.csv")
