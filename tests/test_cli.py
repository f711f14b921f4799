"""The command line as its users meet it: outputs, exit codes, and nothing written on a fault."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import polars as pl
import pytest

from coupled.cli import app
from coupled.cli.order import PANELS, name_of
from coupled.plots.saving import save
from coupled.record.channels import record_channels
from coupled.record.record import read_record
from coupled.resources import shipped_rigs, shipped_sweeps
from tests.support.commands import ROOT, coupled, coupled_anew, files
from tests.support.runs import SHORT


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "short.toml").write_text(SHORT)
    return tmp_path


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["compare", "short.toml", "--no-figure"], 0),
        (["check", "short.toml"], 2),
        (["fly", "short.toml", "-o", "a.xls"], 2),
        (["compare", "short.toml", "--no-figure", "--panels", "surface"], 2),
        (["nonsense"], 2),
    ],
    ids=lambda given: given[0] if isinstance(given, list) else str(given),
)
def test_a_command_in_a_process_of_its_own_prints_the_same(
    folder: Path, words: list[str], code: int
) -> None:
    """Most tests run a command in their own process; a new process prints the same."""
    here, anew = coupled(folder, *words), coupled_anew(folder, *words)
    assert (here.returncode, here.stdout, here.stderr) == (code, anew.stdout, anew.stderr)
    assert anew.returncode == code


def test_every_command_stands_under_a_head_of_the_help() -> None:
    listed = {name for names in PANELS.values() for name in names}
    registered = {name_of(info) for info in [*app.registered_commands, *app.registered_groups]}
    assert registered <= listed
    heads = [info.rich_help_panel for info in app.registered_commands]
    assert list(dict.fromkeys(heads)) == [head for head in PANELS if head in heads]  # none twice


def test_help_has_examples_and_takes_no_physics_to_show(folder: Path) -> None:
    for words in ([], ["compare"], ["fly"], ["plot"], ["runs"]):
        done = coupled(folder, *words, "--help")
        assert done.returncode == 0
        assert done.stderr == ""
    assert "Examples" in coupled(folder, "compare", "--help").stdout
    code = "import sys, coupled.cli; print([m for m in ('numba', 'jsbsim', 'matplotlib', 'polars')"
    code += " if m in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, timeout=60
    )
    assert done.stdout.strip() == "[]"


def test_compare_writes_figure_and_json(folder: Path) -> None:
    (folder / "a").mkdir()
    done = coupled(folder, "compare", "short.toml", "--figure", "a/b.pdf", "--json", "t.json")
    assert done.returncode == 0, done.stderr
    assert files(folder) == {"short.toml", "a/b.pdf", "t.json"}
    assert (folder / "a/b.pdf").read_bytes().startswith(b"%PDF")
    table = json.loads((folder / "t.json").read_text())
    assert [row["configuration"] for row in table] == ["rigid", "compensated"]
    assert table[0]["control"] == "column"
    assert table[0]["force_N"] == pytest.approx(40.0)
    printed = coupled(folder, "compare", "short.toml", "--no-figure", "--json", "-")
    assert json.loads(printed.stdout) == table


def test_fly_writes_a_record_that_other_tools_read(folder: Path) -> None:
    done = coupled(folder, "fly", "short.toml", "-o", "r.parquet", "--configuration", "rigid")
    assert done.returncode == 0, done.stderr
    assert files(folder) == {"short.toml", "r.parquet", "r.manifest.json"}
    frame = pl.read_parquet(folder / "r.parquet")
    assert tuple(frame.columns) == record_channels(["column"], flown=True)
    assert frame.height == 240
    manifest = json.loads((folder / "r.manifest.json").read_text())
    assert manifest["rig"]["controls"]["column"]["loader"]["bend_m_per_N"] == 0.0
    drawn = coupled(folder, "plot", "r.parquet")
    assert drawn.returncode == 0, drawn.stderr
    assert (folder / "r.png").read_bytes().startswith(b"\x89PNG")


def test_a_force_is_said_to_move_the_hand_further(folder: Path) -> None:
    """The surface gets of 40 N what it gets on the rigid rig, and the hand goes further by K·F."""
    run = SHORT.replace('"rigid", "compensated"', '"rigid", "uncompensated"')
    (folder / "push.toml").write_text(run)
    done = coupled(folder, "compare", "push.toml", "--no-figure", "--json", "t.json")
    assert done.returncode == 0, done.stderr
    rigid, bent = json.loads((folder / "t.json").read_text())
    further = 1000.0 * 0.1778 * (bent["hand_travel_norm"] - rigid["hand_travel_norm"])
    assert further == pytest.approx(1000.0 * 9.136e-5 * 40.0, rel=0.02)  # K·F
    [row] = [line for line in done.stdout.splitlines() if "hand's travel, mm" in line]
    shown = [float(cell) for cell in row.split()[-2:]]
    assert shown[1] - shown[0] == pytest.approx(further, abs=0.11)
    said = " ".join(done.stdout.split())
    assert f"the hand moves {shown[1]:.0f} mm instead of {shown[0]:.0f} mm" in said
    assert "the surface moves about as far, but" in said
    clamped = run.replace('kind = "step"\n', 'kind = "clamp"\n').replace(
        "force_N = 40.0", "deflection_m = 0.02"
    )
    (folder / "clamp.toml").write_text(clamped)
    done = coupled(folder, "compare", "clamp.toml", "--no-figure")
    assert "hand's travel, mm" in done.stdout
    assert "holds a force" not in done.stdout


@pytest.mark.parametrize(
    "words",
    [
        ("compare", "short.toml", "--figure", "figuers/a.png"),
        ("fly", "short.toml", "-o", "figuers/a.csv"),
        ("fly", "short.toml", "--json", "figuers/a.json"),
        ("bench", "-o", "figuers/a.csv"),
        ("document", "-o", "figuers/doc"),
        ("sweep", "recovery", "--folder", "figuers/sweep"),
    ],
)
def test_a_mistyped_folder_is_not_made(folder: Path, words: tuple[str, ...]) -> None:
    (folder / "figures").mkdir()
    done = coupled(folder, *words)
    assert done.returncode == 2
    assert "there is no folder figuers; did you mean figures?" in done.stderr
    assert not (folder / "figuers").exists()
    assert files(folder) == {"short.toml"}


def test_the_folder_out_and_a_command_s_own_are_made(folder: Path) -> None:
    assert coupled(folder, "fly", "short.toml", "-o", "out/new/a.csv").returncode == 0
    assert coupled(folder, "new", "run", "runs/a.toml").returncode == 2
    assert files(folder) == {"short.toml", "out/new/a.csv", "out/new/a.manifest.json"}


def test_hints_tell_names_with_commas_apart_and_know_a_name_without_its_unit(folder: Path) -> None:
    done = coupled(folder, "fly", "pull-up-t37", "--case", "none of them")
    assert 'known: "110 kt, 2.0 kPa", "200 kt, 6.5 kPa", "300 kt, 14.5 kPa"' in done.stderr
    done = coupled(folder, "fly", "pull-up-t37", "--case", "110 kt, 2 kPa")
    assert 'did you mean "110 kt, 2.0 kPa"?' in done.stderr
    expected = '\n[[expect]]\nchannel = "pitch_rate"\nmost = 1.0\n'
    (folder / "rate.toml").write_text(SHORT + expected)
    done = coupled(folder, "check", "rate.toml")
    assert "did you mean pitch_rate_rad_per_s?" in done.stderr


@pytest.mark.slow
def test_a_figure_is_the_same_bytes_again(tmp_path: Path, folder: Path) -> None:
    assert coupled(folder, "fly", "short.toml", "-o", "r.csv").returncode == 0
    record = read_record(folder / "r.csv")
    for suffix in ("png", "pdf", "svg"):
        for name in ("one", "two"):
            save(record.plot(title="r"), tmp_path / f"{name}.{suffix}")
        one, two = (tmp_path / f"{name}.{suffix}" for name in ("one", "two"))
        assert one.read_bytes() == two.read_bytes(), suffix


def test_a_flight_that_ends_early_says_so_and_exits_with_1(folder: Path) -> None:
    text = SHORT.replace("force_N = 40.0", "force_N = -80.0").replace("= 2.0", "= 30.0")
    text += '\n[[case]]\nlabel = "low"\nrig = { "flight.altitude_m" = 60.0 }\n'
    (folder / "short.toml").write_text(text)
    done = coupled_anew(folder, "fly", "short.toml", "-o", "r.csv")
    assert done.returncode == 1
    assert "ended early: the aircraft met the ground at" in done.stderr
    assert json.loads((folder / "r.manifest.json").read_text())["ended_early"]["time_s"] > 0.5
    assert len(read_record(folder / "r.csv")) > 60
    both = coupled(folder, "compare", "short.toml", "--no-figure")
    assert both.returncode == 1
    assert "ended early" in both.stdout


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["compare", "nothing"], "nothing: is no shipped run; known: appendix-c"),
        (["compare", "nothing.toml"], "nothing.toml: there is no such run file"),
        (["compare", "short.toml", "--figure", "a.bmp"], "a.bmp: a figure ends in .png"),
        (["compare", str(shipped_rigs()["t37"])], "t37.toml: is a rig file; give a run"),
        (["document", "short.toml"], "short.toml: is a run file; give a rig"),
        (["fly", "short.toml", "-o", "a.xls"], "a.xls: a record ends in .csv or .parquet"),
        (["fly", "short.toml", "--case", "x"], "--case: no case 'x'; known: short"),
        (["compare", "short.toml", "--case", "x"], "--case: no case 'x'; known: short"),
        (["fly", "short.toml", "--configuration", "rigd"], "did you mean rigid?"),
        (["plot", "short.toml"], "a record ends in .csv or .parquet"),
        (["plot", "none.csv"], "none.csv: cannot be read"),
    ],
)
def test_bad_input_is_one_line_exit_2_and_nothing_written(
    folder: Path, words: list[str], says: str
) -> None:
    done = coupled(folder, *words)
    assert done.returncode == 2
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    assert says in done.stderr
    assert done.stdout == ""
    assert files(folder) == {"short.toml"}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a,b\n1,2\n", "time_s: is missing"),
        ("time_s,a\n0,x\n", "a: row 2 holds 'x', which is no number"),
        ("time_s,a\n1,1\n0,1\n", "time_s: must rise from row to row"),
        ("", "is not a table"),
    ],
)
def test_a_table_that_is_not_a_record_is_refused(folder: Path, text: str, says: str) -> None:
    (folder / "r.csv").write_text(text)
    done = coupled(folder, "plot", "r.csv")
    assert (done.returncode, done.stdout) == (2, "")
    assert says in done.stderr
    assert done.stderr.count("\n") == 1


RIG = "aircraft/T37/report-column.toml"
HOSTILE = [
    ("run", "", ""),
    ("run", 'name = "short"', 'name = "../esc"'),
    ("run", 'name = "short"', 'name = "x\\u0000y"'),
    ("run", 'kind = "step"', 'kind = ["step"]'),
    ("run", "force_N = 40.0", "force_N = 1e308"),
    ("run", "force_N = 40.0", "force_N = 1e9"),
    ("run", "force_N = 40.0", "force_N = " + "9" * 5000),
    ("run", "force_N = 40.0", "force_N = " + "[" * 5000),
    ("run", "force_N = 40.0", "k" * 100_000 + " = 1"),
    ("run", 'kind = "step"\nstart_s = 0.2', 'kind = "sweep"\nduration_s = 1.0\nhigh_Hz = 70.0'),
    ("run", "duration_s = 2.0", 'duration_s = 2.0\nrecord_properties = ["../..//["]'),
    ("run", "duration_s = 2.0", 'duration_s = 2.0\nrecord_properties = ["aero"]'),
    ("run", '"compensated"]', '"rigid"]'),
    ("run", "force_N = 40.0", 'force_N = 40.0\n[[case]]\nlabel = "a"\n[[case]]\nlabel = "a"'),
    (
        "run",
        "force_N = 40.0",
        'force_N = 40.0\n[[case]]\nlabel = "a"\nrig = { flight.altitude_m = 2000.0 }',
    ),
    (
        "run",
        "force_N = 40.0",
        'force_N = 40.0\n[[case]]\nlabel = "a"\nrig = { "frame_rate_Hz.x" = 1.0 }',
    ),
    (
        "run",
        "force_N = 40.0",
        'force_N = 40.0\n[[case]]\nlabel = "a"\npilot = { "column.force_lb" = 1.0 }',
    ),
    ("run", 'kind = "step"\nstart_s = 0.2\nforce_N = 40.0', 'kind = "table"\nfile = "*.csv"'),
    ("rig", '"gear/gear-cmd-norm"', '"Gear up"'),
    ("rig", '"gear/gear-cmd-norm"', '"fcs/throttle-cmd-norm[-1]"'),
    ("rig", '"gear/gear-cmd-norm"', '"simulation/do_simple_trim"'),
    ("rig", '"gear/gear-cmd-norm"', '"ic/h-sl-ft"'),
    ("rig", '"gear/gear-cmd-norm"', '"aero/qbar-psf"'),
    ("rig", 'model = "T37"', 'model = "ball"'),
    ("rig", 'model = "T37"', 'model = "global5001"'),
    ("rig", "altitude_m = 1500.0", "altitude_m = -500.0"),
    ("rig", "mass_kg = 4.0", "mass_kg = 1e308"),
    ("rig", "mass_kg = 4.0", "mass_kg = 0x" + "f" * 4000),
]


@pytest.mark.parametrize(
    ("which", "old", "new"), HOSTILE, ids=[str(i) for i in range(len(HOSTILE))]
)
def test_hostile_files_are_refused_with_one_line_a_fault(
    folder: Path, which: str, old: str, new: str
) -> None:
    """Found by trying: each of these once died, hung, or wrote where it should not."""
    (folder / "t.csv").write_text("time_s,column_force_N\n0,0\n1,1\n")
    rig = (ROOT / RIG).read_text(encoding="utf-8")
    run = SHORT.replace('"report-column"', '"rig.toml"')
    if old == "":
        run, old = "\ufeffname = 3", "\ufeff"
    assert old in {"run": run, "rig": rig}[which]
    run, rig = (
        (run.replace(old, new or old), rig) if which == "run" else (run, rig.replace(old, new))
    )
    (folder / "short.toml").write_text(run, encoding="utf-8")
    (folder / "rig.toml").write_text(rig, encoding="utf-8")
    before = files(folder.parent)
    done = coupled(folder, "fly", "short.toml")
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("error: "), done.stderr
    assert all(line.startswith("error: ") for line in done.stderr.splitlines())
    assert len(done.stderr) < 700
    assert done.stdout == ""
    assert files(folder.parent) == before


@pytest.mark.parametrize(
    "words",
    [
        ["fly", "short.toml", "-o", "short.toml/r.csv"],
        ["fly", "short.toml", "--json", "."],
        ["fly", "short.toml", "-o", "r.csv", "--json", "r.csv"],
        ["fly", "short.toml", "--json", "short.toml"],
        ["compare", "short.toml", "--figure", "short.toml/x.png"],
        ["compare", "a" * 5000 + ".toml"],
        ["plot", "."],
        ["fit", ".", "--rig", "bench"],
        ["fit", "", "--rig", "bench"],
        ["blind", "make", "."],
        ["blind", "make", "new", "--key", "."],
        ["blind", "score", "x", "--key", "."],
        ["stability", "bench", "-o", "."],
        ["fly", "short.toml", "--nonsense"],
        ["nonsense"],
        ["runs", "--json", "."],
    ],
    ids=lambda words: " ".join(words)[:40],
)
def test_wrong_arguments_are_refused_before_the_flight(folder: Path, words: list[str]) -> None:
    done = coupled(folder, *words)
    assert done.returncode == 2
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    assert files(folder) == {"short.toml"}


def test_a_dollar_sign_is_a_word_and_a_bracket_a_file(folder: Path) -> None:
    text = SHORT + '\n[[case]]\nlabel = "$\\\\foo{$ [red]x"\n'
    (folder / "short.toml").write_text(text)
    done = coupled(folder, "compare", "short.toml")
    assert done.returncode == 0, done.stderr
    assert coupled(folder, "fly", "short.toml", "-o", "r[1].csv").returncode == 0
    assert coupled(folder, "plot", "r[1].csv", "--figure", "$x.png").returncode == 0


def test_the_units_option_changes_tables_and_not_files(folder: Path) -> None:
    words = ("compare", "short.toml", "--no-figure", "--json", "t.json")
    si, us = coupled(folder, *words), coupled(folder, *words, "--units", "us")
    assert us.returncode == 0, us.stderr
    kept = json.loads((folder / "t.json").read_text())
    assert kept[0]["force_N"] == pytest.approx(40.0)
    assert "force needed, N" in si.stdout
    [row] = [line for line in us.stdout.splitlines() if "force needed, lb" in line]
    assert [float(cell) for cell in row.split()[-2:]] == [9.0, 9.0]  # 40 N are 8.99 lb
    assert "hand's travel, in" in us.stdout
    expected = SHORT + '\n[[expect]]\nmeasure = "force_N"\nmost = 44.4822\n'
    (folder / "held.toml").write_text(expected)
    assert "≤ 10 lb" in coupled(folder, "check", "held.toml", "--units", "us").stdout
    assert "≤ 44.48 N" in coupled(folder, "check", "held.toml").stdout
    refused = coupled(folder, "compare", "short.toml", "--units", "uk")
    assert refused.returncode == 2
    assert "'--units': 'uk' is not one of 'si', 'us'" in refused.stderr


def test_a_shell_completes_commands() -> None:
    environment = {
        **os.environ,
        "_COUPLED_COMPLETE": "complete_bash",
        "COMP_WORDS": "coupled new r",
        "COMP_CWORD": "2",
    }
    script = "import sys; sys.argv = ['coupled']; from coupled.__main__ import command; command()"
    done = subprocess.run(
        [sys.executable, "-c", script], check=False, env=environment, capture_output=True, text=True
    )
    assert {"run", "readings"} <= set(done.stdout.split()), done
    assert "sweep" not in done.stdout


@pytest.mark.parametrize("columns", [30, 44, 60, 80, 120])
def test_a_narrow_terminal_cuts_no_number(folder: Path, columns: int) -> None:
    words = ("compare", "short.toml", "--no-figure")
    wide = coupled(folder, *words, columns=120).stdout
    [row] = [line for line in wide.splitlines() if "force needed, N" in line]
    numbers = row.split()[-2:]
    shown = coupled(folder, *words, columns=columns).stdout
    assert "…" not in shown
    assert max(len(line) for line in shown.splitlines()) <= columns
    # A narrow column wraps the label, not the numbers.
    after = re.split(r"^ *force\b", shown, maxsplit=1, flags=re.MULTILINE)[-1]
    assert [word for word in after.split() if word in numbers][:2] == numbers


@pytest.mark.parametrize("words", [(), ("new",)])
def test_a_command_that_is_left_out_gets_the_help_alone(
    folder: Path, words: tuple[str, ...]
) -> None:
    done = coupled(folder, *words)
    assert (done.returncode, done.stderr) == (0, "")
    assert "Usage: coupled" in " ".join(done.stdout.split())


def test_shipped_sweeps_are_listed_with_the_runs(folder: Path) -> None:
    printed = coupled(folder, "runs").stdout
    assert "sweeps: " + ", ".join(shipped_sweeps()) in " ".join(printed.split())
