"""Figures for print: their panels, their size, and sentences on curves that coincide."""

from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from matplotlib.figure import Figure

from coupled.authority.compare import Flight, compare, fly_and_judge, judge
from coupled.authority.figures import rows
from coupled.authority.maps import LossMap
from coupled.errors import InputError
from coupled.flight.manoeuvre import Configuration
from coupled.flight.runfile import read_run
from coupled.plots.campaign import draw_sweep
from coupled.plots.flights import draw_comparison
from coupled.plots.layout import Layout, layout_of
from coupled.plots.maps import draw_losses
from coupled.plots.saving import save
from coupled.record.record import Record
from tests.support.commands import coupled

BEND, SPEED = "rig.controls.column.loader.bend_m_per_N", "rig.flight.calibrated_airspeed_m_per_s"
CONFIGURATIONS: tuple[Configuration, ...] = (
    "rigid",
    "uncompensated",
    "deflection only",
    "compensated",
)


@pytest.fixture(scope="module")
def flights() -> list[Flight]:
    """Return a pull with three configurations, and the same again as another case."""
    case = replace(read_run("appendix-c")[0], duration_s=2.0, configurations=CONFIGURATIONS)
    return list(compare([replace(case, label="a"), replace(case, label="b")]))


@pytest.mark.parametrize(
    ("size", "inches"),
    [("8.5x6cm", (3.3465, 2.3622)), ("85 x 60 mm", (3.3465, 2.3622)), ("3×2in", (3.0, 2.0))],
)
def test_a_size_is_read_in_three_units(size: str, inches: tuple[float, float]) -> None:
    assert layout_of(size=size).size_in == pytest.approx(inches, abs=1e-4)


@pytest.mark.parametrize("size", ["8.5x6", "8.5cm", "axbcm", "1.2.3x4cm", "0x4in", "8x6m", "9e9"])
def test_what_is_no_size_is_refused(size: str) -> None:
    with pytest.raises(InputError, match="--size"):
        layout_of(size=size)


def test_a_file_has_the_size_asked_for(flights: list[Flight], tmp_path: Path) -> None:
    figure = draw_comparison(flights, "si", layout_of("surface,force", size="8.5x6cm"))
    save(figure, tmp_path / "f.png")
    wide, high = struct.unpack(">II", (tmp_path / "f.png").read_bytes()[16:24])
    assert (wide / 300 * 2.54, high / 300 * 2.54) == pytest.approx((8.5, 6.0), abs=0.02)
    save(figure, tmp_path / "f.svg")
    assert 'width="240.9' in (tmp_path / "f.svg").read_text()  # points
    sizes = [
        float(label.get_fontsize()) for axes in figure.axes for label in axes.get_xticklabels()
    ]
    assert 6.0 <= min(sizes) <= max(sizes) <= 7.5


def test_letters_and_labels_of_print_lie_within_it(flights: list[Flight], tmp_path: Path) -> None:
    figure = draw_comparison(flights, "si", layout_of("surface,force", size="8.5x6cm"))
    save(figure, tmp_path / "f.png")
    for axes in figure.axes:
        for text in (axes.xaxis.label, axes.yaxis.label, axes.title):
            box = text.get_window_extent()
            assert box.x0 >= -1 and box.y0 >= -1, text.get_text()
            assert box.x1 <= figure.bbox.width + 1 and box.y1 <= figure.bbox.height + 1


def test_named_panels_alone_are_drawn_in_their_order(flights: list[Flight]) -> None:
    figure = draw_comparison(flights, "si", Layout(("force", "surface")))
    drawn = [axes.get_ylabel() for axes in figure.axes if axes.get_ylabel()]
    assert drawn == ["pilot's force, N", "elevator command, % of travel"]
    with pytest.raises(InputError, match="surfaces: no such panel; did you mean surface"):
        draw_comparison(flights, "si", Layout(("surfaces",)))


def test_overlaid_cases_share_their_axes(flights: list[Flight]) -> None:
    apart = draw_comparison(flights, "si", Layout(("surface",)))
    over = draw_comparison(flights, "si", Layout(("surface",), overlay=True))
    assert len(apart.axes) == 2 and len(over.axes) == 1
    assert len(over.axes[0].lines) == sum(len(axes.lines) for axes in apart.axes)
    assert "From strong to pale: a; b." in over.get_suptitle()


def test_curves_that_coincide_are_named(flights: list[Flight]) -> None:
    """Rigid, with the deflection correction, and with both the surface goes as asked."""
    title = " ".join(draw_comparison(flights).get_suptitle().split())
    assert "coincide" not in title
    bent = [flight for flight in flights if flight.configuration == "uncompensated"]
    alike = [replace(bent[0], configuration=name) for name in ("rigid", "compensated")]
    same = " ".join(draw_comparison([*bent[:1], *alike]).get_suptitle().split())
    said = "the curves of uncompensated, rigid and compensated coincide."
    assert f"Surface: {said}" in same and f"Force: {said}" in same


def table(alike: bool) -> pl.DataFrame:
    losses = {"uncompensated": 1.0, "gradient only": 1.0 if alike else 1.2, "compensated": 0.0}
    found = [
        {BEND: bend, SPEED: speed, "configuration": name, "loss": factor * bend * speed}
        for name, factor in losses.items()
        for bend in (1e-5, 2e-5, 4e-5)
        for speed in (60.0, 90.0)
    ]
    return pl.DataFrame(found).with_columns(pl.lit("").alias("ended_early"))


def test_lines_of_a_sweep_that_coincide_are_named() -> None:
    said = "Authority lost: uncompensated and gradient only coincide."
    for alike in (True, False):
        title = draw_sweep(table(alike), [BEND, SPEED], ["loss"], "bends").get_suptitle()
        assert (said in " ".join(title.split())) is alike


def test_configurations_of_a_sweep_are_overlaid_by_style() -> None:
    drawn = draw_sweep(table(False), [BEND, SPEED], ["loss"], layout=Layout(overlay=True))
    assert len(drawn.axes) == 1
    assert [line.get_linestyle() for line in drawn.axes[0].lines] == ["-"] * 2 + ["--"] * 2 + [
        ":"
    ] * 2
    names = [text.get_text() for text in drawn.legends[0].get_texts()]
    assert names == ["60", "90", "uncompensated", "gradient only", "compensated"]


def test_panels_that_are_not_there_are_refused_before_a_flight(tmp_path: Path) -> None:
    done = coupled(tmp_path, "compare", "appendix-c", "--panels", "surfaces")
    assert done.returncode == 2 and "surface" in done.stderr
    done = coupled(tmp_path, "sweep", "sensitivity", "--panels", "loss")
    assert done.returncode == 2 and "--panels" in done.stderr
    assert not list(tmp_path.iterdir())


def one_map(configuration: Any, loss: np.ndarray) -> LossMap:
    sides = np.linspace(0.0, 1000.0, 21), np.linspace(0.01, 0.2, 20)
    return LossMap("column", configuration, *sides, loss)


def drawn_map(flown: np.ndarray) -> Figure:
    """Return the figure of a loss that grows with q̄, 80 % near neutral; and none elsewhere."""
    loss = np.repeat(np.linspace(0.0, 0.4, 21)[:, None], 20, axis=1)
    loss[:, 0] = 0.8
    maps = [one_map("uncompensated", loss), one_map("compensated", 0.0 * loss)]
    return draw_losses("rig", {"column": maps}, {"column": flown})


def test_a_map_has_the_colours_of_what_was_flown() -> None:
    flown = np.array([[0.0, 500.0, 500.0, 0.0], [0.0, 0.0, 0.2, 0.2]])
    for points, most in ((flown, 20.0), (np.empty((2, 0)), 40.0)):
        [mesh] = drawn_map(points).axes[0].collections
        assert mesh.get_clim() == pytest.approx((0.0, most))


def test_a_map_without_any_loss_is_a_sentence() -> None:
    figure = drawn_map(np.empty((2, 0)))
    titles = [axes.get_title() for axes in figure.axes if axes.get_visible()]
    assert [title for title in titles if title] == ["column, uncompensated"]
    assert "Nothing is lost on column, compensated." in figure.get_suptitle()


def test_an_aircraft_that_dives_in_is_shown_as_such() -> None:
    case = replace(read_run("pull-up-t37")[0], duration_s=2.0)
    whole = fly_and_judge(case)
    peak = whole.outcome.peak_rate_rad_per_s
    assert peak is not None and peak > 0.01
    record = whole.record
    data = record.data.copy()
    rate = record.channels.index("pitch_rate_rad_per_s")
    data[:, rate] = -np.abs(data[:, rate])
    ended = {"reason": "the aircraft met the ground", "time_s": float(record.time_s[-1])}
    dive = Record(record.channels, data, dict(record.manifest) | {"ended_early": ended})
    dives = replace(whole, configuration="rigid", record=dive, outcome=judge(case, "rigid", dive))
    cells = dict(rows([whole, dives]))
    assert cells["peak pitch rate, °/s"][1] == "–"
    assert cells["flight ended early, s"] == ["–", f"{record.time_s[-1]:.1f}"]
    assert "flight ended early, s" not in dict(rows([whole]))
    axes = draw_comparison([dives]).axes[1]
    assert [text.get_text() for text in axes.texts] == ["met the ground"]
    assert [line.get_marker() for line in axes.lines][-1] == "x"
