"""A user's own log made a record: units, clocks, gaps, verdicts, and the command."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import io as scipy_io

from coupled.errors import InputError
from coupled.record.importing import plausible
from coupled.record.importing.convert import import_log
from coupled.record.importing.judging import judge
from coupled.record.importing.mapping import CHANNELS, factor_of, own_unit
from coupled.resources import shipped_rigs
from coupled.rig.rigfile import read_rig
from coupled.units import parse_unit, unit_names, units_like
from tests.support.logs import (
    FORCE_N,
    GOOD,
    MAP,
    ROWS,
    DEFLECTION_m,
    TIME_s,
    imported,
    text,
)

# Units


@given(st.sampled_from(CHANNELS), st.data())
def test_a_unit_and_back_is_the_same_number(channel: str, data: st.DataObject) -> None:
    own = parse_unit(own_unit(channel))
    assert own is not None
    name = data.draw(st.sampled_from(units_like(own)))
    value = data.draw(st.floats(-1e6, 1e6, allow_subnormal=False))
    factor = factor_of(channel, name, "map.toml")
    unit = parse_unit(name)
    assert unit is not None
    assert value * factor * own.factor / unit.factor == pytest.approx(value, rel=1e-12)


@given(st.sampled_from(CHANNELS), st.sampled_from(unit_names()))
def test_a_unit_of_another_dimension_is_refused(channel: str, name: str) -> None:
    own, unit = parse_unit(own_unit(channel)), parse_unit(name)
    assert own is not None and unit is not None
    if unit.dimension == own.dimension or (channel == "load_factor" and name in ("1", "%")):
        assert factor_of(channel, name, "m") > 0.0
    else:
        with pytest.raises(InputError, match=own_unit(channel).replace("^", r"\^")):
            factor_of(channel, name, "m")


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        *[("lbf", 4.4482216152605), ("kgf", 9.80665), ("daN", 10.0), ("in", 0.0254)],
        *[("lbf/in", 175.126835246), ("psf", 47.88025898), ("psi", 6894.757293), ("hPa", 100.0)],
        *[("kt", 0.514444444), ("km/h", 0.2777777778), ("ft/s", 0.3048), ("fpm", 0.00508)],
        *[("deg", 0.01745329252), ("[°/s]", 0.01745329252), ("m/s²", 1.0), ("m/s/s", 1.0)],
        *[("lbf/ft^2", 47.88025898), ("N/mm", 1000.0), ("lbf / deg", 254.8643249), ("%", 0.01)],
        *[("d", 86_400.0), ("lbs", 4.4482216152605), ("daNm", 10.0), ("kpm", 9.80665)],
        *[("kgfm", 9.80665), ("lbf.in", 0.112984829)],
    ],
)
def test_units_have_their_published_factors(name: str, factor: float) -> None:
    unit = parse_unit(name)
    assert unit is not None
    assert unit.factor == pytest.approx(factor, rel=1e-9)


# What a map makes of a log


def test_units_signs_and_clock_give_the_record_back(tmp_path: Path) -> None:
    record, account = imported(tmp_path)
    assert record.channels == ("time_s", "column_force_N", "column_computed_m")
    assert account.clock.method == "rows as they are"
    assert account.clock.frame_rate_Hz == 60.0
    np.testing.assert_array_equal(record.time_s, np.arange(ROWS) / 60.0)
    np.testing.assert_allclose(record["column_force_N"], FORCE_N, rtol=1e-10)
    np.testing.assert_allclose(record["column_computed_m"], DEFLECTION_m, rtol=1e-10)
    assert [c.doubts for c in account.channels.values()] == [(), ()]
    assert account.channels["column_force_N"].noise == pytest.approx(0.1, rel=0.15)


def test_scale_and_offset_are_in_the_logs_unit(tmp_path: Path) -> None:
    scaled = MAP.replace('unit = "in"', 'unit = "in"\nscale = 2.0\noffset = -0.5')
    record, _ = imported(tmp_path, log_map=scaled)
    expected = 2.0 * DEFLECTION_m - 0.5 * 0.0254
    np.testing.assert_allclose(record["column_computed_m"], expected, atol=1e-12)


@pytest.mark.slow
def test_every_format_gives_the_same_record(tmp_path: Path) -> None:
    first, _ = imported(tmp_path)
    frame = pl.read_csv(io.BytesIO(GOOD.encode()))
    frame.write_parquet(tmp_path / "log.parquet")
    vectors = {name: frame[name].to_numpy()[:, None] for name in frame.columns}
    scipy_io.savemat(tmp_path / "flat.mat", vectors)
    scipy_io.savemat(tmp_path / "old.mat", vectors, format="4")
    scipy_io.savemat(tmp_path / "packed.mat", vectors, do_compression=True)
    scipy_io.savemat(tmp_path / "struct.mat", {"LOG": {"in": vectors}, "f": np.array([[{}]])})
    names = np.array(frame.columns, dtype=object)
    table = {"data": frame.to_numpy(), "signals": names}
    scipy_io.savemat(tmp_path / "matrix.mat", table)
    struct = MAP.replace('from = "', 'from = "LOG.in.')
    matrix = '[log]\nmatrix = "data"\n' + MAP
    listed = '[log]\nmatrix = "data"\nnames = ["T", "F", "D"]\n' + MAP
    german = '[log]\ndelimiter = ";"\ndecimal = ","\n' + MAP
    semicolon = "\ufeff" + GOOD.replace(",", ";").replace(".", ",").replace("\n", "\r\n")
    (tmp_path / "german.csv").write_text(semicolon, encoding="utf-8")
    (tmp_path / "tab.tsv").write_text(GOOD.replace(",", "\t"))
    (tmp_path / "space.txt").write_text(GOOD.replace(",", "   "))
    head = "made by a rig\n# a remark\n T , F , D \nms,lbf,[in]\n"
    (tmp_path / "units.csv").write_text(head + GOOD.partition("\n")[2].replace("\n", "\n# x\n", 1))
    units = '[log]\nskip_rows = 1\ncomment = "#"\nunits_row = true\n' + MAP.replace(
        'unit = "in"', ""
    )
    (tmp_path / "bare.csv").write_text(GOOD.partition("\n")[2])
    bare = "[log]\nheader = false\n" + MAP
    for name, number in (("T", "1"), ("F", "2"), ("D", "3")):
        bare = bare.replace(f'"{name}"', f'"{number}"')
    cases = {
        **{"log.parquet": MAP, "flat.mat": MAP, "old.mat": MAP, "packed.mat": MAP},
        **{"struct.mat": struct, "matrix.mat": matrix, "german.csv": german},
        **{"tab.tsv": MAP, "space.txt": '[log]\ndelimiter = " "\n' + MAP},
        **{"units.csv": units, "bare.csv": bare},
    }
    for file, log_map in [*cases.items(), ("matrix.mat", listed)]:
        (tmp_path / "map.toml").write_text(log_map)
        record, _ = import_log(tmp_path / file, tmp_path / "map.toml")
        np.testing.assert_array_equal(record.data, first.data, err_msg=file)


# Clocks


def test_rounded_stamps_leave_every_row_as_it_is(tmp_path: Path) -> None:
    stamps = np.rint(1000.0 * TIME_s)  # 0, 17, 33, 50 ms
    record, account = imported(tmp_path, text(time_ms=stamps))
    assert account.clock.method == "rows as they are"
    assert account.clock.frame_rate_Hz == 60.0
    np.testing.assert_allclose(record["column_force_N"], FORCE_N, rtol=1e-10)


def test_a_jittering_clock_is_interpolated_to_where_the_signal_was(tmp_path: Path) -> None:
    time = TIME_s + np.random.default_rng(5).uniform(-4e-3, 4e-3, ROWS)
    log = text(1000.0 * time, -np.sin(time), np.sin(time))
    wished = MAP.replace('unit = "ms"', 'unit = "ms"\nframe_rate_Hz = 50')
    record, account = imported(tmp_path, log, wished)
    assert account.clock.method == "pchip"
    expected = 4.4482216152605 * np.sin(time[0] + record.time_s)
    assert np.max(np.abs(record["column_force_N"] - expected)) < 1e-3  # h²: flat at the crests
    with pytest.raises(InputError, match=r"unevenly.*frame_rate_Hz = 60"):
        imported(tmp_path, log)


def test_a_step_is_not_overshot(tmp_path: Path) -> None:
    force = np.where(TIME_s > 5.0, -10.0, 0.0)
    wished = MAP.replace('unit = "ms"', 'unit = "ms"\nframe_rate_Hz = 100')
    record, account = imported(tmp_path, text(force=force), wished)
    pounds = record["column_force_N"] / 4.4482216152605
    assert pounds.min() == 0.0
    assert pounds.max() <= 10.0 + 1e-12
    assert "no longer white" in account.warnings[0]


def test_a_delay_is_taken_off_and_a_cut_starts_on_a_row(tmp_path: Path) -> None:
    late = MAP.replace("sign = -1", "sign = -1\ndelay_s = 0.1")
    late = late.replace('unit = "ms"', 'unit = "ms"\nstart_s = 1.99\nend_s = 7.0')
    log = text(force=-np.sin(TIME_s - 0.1) / 4.4482216152605, deflection=np.sin(TIME_s) / 0.0254)
    record, account = imported(tmp_path, log, late)
    assert account.clock.start_s == pytest.approx(2.0)
    assert record.time_s[-1] == pytest.approx(5.0)
    np.testing.assert_allclose(record["column_force_N"], np.sin(2.0 + record.time_s), atol=1e-6)
    np.testing.assert_allclose(record["column_computed_m"], np.sin(2.0 + record.time_s), atol=1e-9)


def test_a_clock_since_1970_keeps_its_digits(tmp_path: Path) -> None:
    ns = 1_750_000_000_000_000_000 + np.rint(1e9 * TIME_s).astype(np.int64)
    columns = {"T": ns, "F": -FORCE_N, "D": DEFLECTION_m}
    frame = pl.DataFrame(columns)
    frame.write_parquet(tmp_path / "ns.parquet")
    frame.with_columns(pl.col("T").cast(pl.Datetime("ns"))).write_parquet(tmp_path / "at.parquet")
    for file in ("ns.parquet", "at.parquet"):
        (tmp_path / "map.toml").write_text(MAP.replace('"ms"', '"ns"'))
        record, account = import_log(tmp_path / file, tmp_path / "map.toml")
        assert account.clock.frame_rate_Hz == 60.0
        assert len(record) == ROWS


def test_missing_rows_and_empty_cells_are_interpolated_and_counted(tmp_path: Path) -> None:
    lines = GOOD.splitlines()
    del lines[100]
    lines[200] = lines[200].rpartition(",")[0] + ","
    record, account = imported(tmp_path, "\n".join(lines))
    assert len(record) == ROWS
    assert account.clock.missing_rows == 1
    assert account.warnings == ("1 missing rows were interpolated",)
    assert account.channels["column_computed_m"].filled_cells == 1
    assert account.channels["column_force_N"].filled_cells == 0
    there = np.arange(ROWS) != 99
    np.testing.assert_allclose(record["column_force_N"][there], FORCE_N[there], rtol=1e-10)
    strict = MAP.replace('unit = "in"', 'unit = "in"\nlongest_gap_rows = 0')
    with pytest.raises(InputError, match="row 201: 1 empty cells"):
        imported(tmp_path, "\n".join(lines), strict)
    strict = MAP.replace('unit = "ms"', 'unit = "ms"\nlongest_gap_rows = 0')
    with pytest.raises(InputError, match=r"row 101: 1 rows are missing after 1.63"):
        imported(tmp_path, "\n".join(lines), strict)


def test_a_heading_is_interpolated_through_north(tmp_path: Path) -> None:
    heading = np.mod(350.0 + 5.0 * TIME_s, 360.0)
    log_map = MAP.replace("column_computed_m", "heading_rad").replace('"in"', '"deg"')
    log_map = log_map.replace('unit = "ms"', 'unit = "ms"\nframe_rate_Hz = 50')
    record, _ = imported(tmp_path, text(deflection=heading), log_map)
    turned = np.rad2deg(np.unwrap(record["heading_rad"]))
    np.testing.assert_allclose(turned, 350.0 + 5.0 * record.time_s, atol=1e-9)


# Verdicts


def doubts(folder: Path, log: str = GOOD, log_map: str = MAP) -> dict[str, list[str]]:
    _, account = imported(folder, log, log_map)
    return {name: list(found.doubts) for name, found in account.channels.items()}


def test_doubts_name_what_is_wrong(tmp_path: Path) -> None:
    inches = DEFLECTION_m / 0.0254
    assert doubts(tmp_path, text(deflection=np.full(ROWS, 0.5)))["column_computed_m"] == [
        "constant"
    ]
    wrong = MAP.replace("sign = -1\n", "")
    assert doubts(tmp_path, log_map=wrong)["column_force_N"] == [
        "moves against the deflection: sign?"
    ]
    bad = inches.copy()
    bad[77] += 1.0
    assert doubts(tmp_path, text(deflection=bad))["column_computed_m"] == ["1 spike"]
    clipped = np.minimum(inches, 1.0)
    assert doubts(tmp_path, text(deflection=clipped))["column_computed_m"] == ["clipped at 0.0254"]
    coarse = np.rint(inches / 0.05) * 0.05
    assert doubts(tmp_path, text(deflection=coarse))["column_computed_m"] == [
        "quantised, step 0.00127"
    ]
    metres = MAP.replace('unit = "in"', 'unit = "m"')
    big = doubts(tmp_path, text(deflection=1000 * inches), metres)
    assert big["column_computed_m"] == ["looks like mm, cm or in"]
    two = MAP + '[channels.column_deflection_m]\nfrom = "D"\nunit = "in"\n'
    assert doubts(tmp_path, log_map=two)["column_deflection_m"] == ["copy of column_computed_m"]
    angle = MAP.replace("column_computed_m", "pitch_rad").replace('"in"', '"rad"')
    assert doubts(tmp_path, text(deflection=5 * inches), angle)["pitch_rad"] == [
        "looks like degrees"
    ]
    less_one = MAP.replace("column_computed_m", "load_factor").replace('"in"', '"g"')
    assert doubts(tmp_path, text(deflection=0.1 * inches), less_one)["load_factor"] == [
        "is 0 in level flight: offset 1?"
    ]


def test_a_control_that_is_moved_fast_says_nothing_of_its_force_s_unit() -> None:
    """A record of a healthy loader, shaken at 2 to 5 Hz, was refused as one in pounds.

    A mass of 4 kg and a damping of 75 N·s/m on 400 N/m.
    """
    t = np.arange(0.0, 10.0, 1.0 / 120.0)
    gradient = np.full(len(t), 400.0)
    for slow, turns in ((True, 0.5), (False, 12.0)):
        moved = 0.05 * np.sin(turns * t)
        inertia = -4.0 * turns**2 * moved
        force = 400.0 * moved + inertia + 75.0 * 0.05 * turns * np.cos(turns * t)
        ratio = plausible.force_ratio(force, moved, gradient)
        assert (ratio is not None) is slow
        if ratio is not None:
            assert ratio == pytest.approx(1.0, rel=0.03)
            assert plausible.in_pounds(plausible.force_ratio(force / 4.448, moved, gradient) or 0.0)


def test_a_heading_that_wraps_has_no_spikes() -> None:
    time_s = np.arange(600) / 60.0
    noise = np.random.default_rng(1).normal(0.0, 5e-4, 600)
    known = {"heading_rad": np.mod(0.02 * np.sin(time_s) + noise, 2.0 * np.pi)}
    assert judge(known, known, time_s, None, "log")["heading_rad"].doubts == ()


def test_a_force_in_pounds_is_seen_against_the_rig(tmp_path: Path) -> None:
    rig = read_rig(shipped_rigs()["report-column"])
    rate = rig.frame_rate
    pressure = rig.controls["column"].schedule.dynamic_pressure[0]
    gradient = rig.controls["column"].schedule.total_gradient[0]
    log = "T,F,D,q\n" + "\n".join(
        f"{1000 * k / rate},{gradient * x / 4.448},{x},{pressure}"
        for k, x in enumerate(0.05 * np.sin(np.arange(900) / rate))
    )
    log_map = MAP.replace("sign = -1", "").replace('"lbf"', '"N"').replace('"in"', '"m"')
    log_map += '[channels.dynamic_pressure_Pa]\nfrom = "q"\nunit = "Pa"\n'
    imported(tmp_path, log, log_map)
    _, account = import_log(tmp_path / "log.csv", tmp_path / "map.toml", rig)
    assert account.channels["column_force_N"].doubts == ("looks like pounds",)
    assert account.channels["dynamic_pressure_Pa"].doubts == ("constant",)
    (tmp_path / "map.toml").write_text(log_map.replace("ms", 'ms"\nframe_rate_Hz = 77\n#"'))
    with pytest.raises(InputError, match="frame_rate_Hz: is 77, the rig's"):
        import_log(tmp_path / "log.csv", tmp_path / "map.toml", rig)
    (tmp_path / "map.toml").write_text(log_map.replace('unit = "m"', 'unit = "m"\nscale = 100'))
    with pytest.raises(InputError, match="is its unit right"):
        import_log(tmp_path / "log.csv", tmp_path / "map.toml", rig)


@pytest.mark.parametrize(
    ("factor", "says"),
    [
        (1.0, None),
        (1.6, None),
        (1 / 4.448, "looks like pounds"),
        (4.448, "was N already, not lbf?"),
        (1 / 9.807, "the force in kgf or daN?"),
        (0.0254, "the deflection in in?"),
        (0.01, "the deflection in cm?"),
        (0.4, "is 0.4 times the spring's force (gradient times deflection): another unit, "),
        (-3.0, "is 3 times the spring's force (gradient times deflection): another unit, "),
    ],
)
def test_a_force_far_from_its_springs_is_in_doubt(factor: float, says: str | None) -> None:
    doubt = plausible.unit_doubt(factor, turned=False)
    assert doubt == says if says is None else says in str(doubt)


def test_a_force_is_held_against_a_schedule_that_is_flat_without_dynamic_pressure(
    tmp_path: Path,
) -> None:
    rig = read_rig(shipped_rigs()["report-column"])
    gradient = rig.controls["column"].schedule.total_gradient[0]
    table = {"controls.column.schedule.dynamic_pressure_Pa": [0.0, 1e4]}
    table["controls.column.schedule.total_gradient_N_per_m"] = [gradient, gradient]
    flat = rig.changed(table)
    moved = 0.05 * np.sin(TIME_s)
    log_map = MAP.replace("sign = -1", "").replace('"lbf"', '"N"').replace('"in"', '"m"')
    log_map = log_map.replace('unit = "ms"', f'unit = "ms"\nframe_rate_Hz = {rig.frame_rate}')
    imported(tmp_path, text(force=0.3 * gradient * moved, deflection=moved), log_map)
    for each, seen in ((flat, True), (rig, False)):
        _, account = import_log(tmp_path / "log.csv", tmp_path / "map.toml", each)
        found = account.channels["column_force_N"].doubts
        assert any("gradient times deflection" in doubt for doubt in found) is seen


def test_a_deflection_that_falls_short_under_force_is_in_doubt(tmp_path: Path) -> None:
    bent = DEFLECTION_m + 1e-4 * FORCE_N
    lines = [f"{1e3 * t:.6f},{f:.9g},{a:.9g},{b:.9g}" for t, f, a, b in
             zip(TIME_s, FORCE_N, DEFLECTION_m, bent, strict=True)]  # fmt: skip
    log_map = MAP.replace("sign = -1", "").replace('"lbf"', '"N"').replace('"in"', '"m"')
    log_map += '[channels.column_deflection_m]\nfrom = "G"\nunit = "m"\n'
    log = "\n".join(["T,F,D,G", *lines])
    assert "column_deflection_m" not in {k for k, v in doubts(tmp_path, log, log_map).items() if v}
    log = "\n".join(["T,F,G,D", *lines])
    assert doubts(tmp_path, log, log_map)["column_deflection_m"] == [
        "falls short of column_computed_m under force: exchanged, or a scale?"
    ]


def test_a_late_sensor_is_no_negative_bend() -> None:
    time = np.arange(0.0, 20.0, 0.01)
    moved = 0.05 * np.sin(2.0 * time)
    late = 0.05 * np.sin(2.0 * (time - 0.02))
    force = 400.0 * moved + 120.0 * np.gradient(moved, time)
    assert plausible.bend_sign(force, moved, late) == 0
    assert plausible.bend_sign(force, moved, late - 1e-4 * force) == -1
    assert plausible.bend_sign(force, moved, late + 1e-4 * force) == 1
    assert plausible.bend_sign(force, moved, moved) == 0


def test_figures_on_white_noise_raise_no_doubt() -> None:
    noise = np.random.default_rng(8).standard_normal(20_000)
    assert plausible.noise_level(noise) == pytest.approx(1.0, rel=0.03)
    assert plausible.noise_level(noise + np.arange(20_000) ** 3) == pytest.approx(1.0, rel=0.03)
    assert plausible.clipped_at(noise) is None
    assert plausible.quantised_step(noise) is None
    assert plausible.quantised_step(np.round(noise, 2)) is None
    assert plausible.spikes(noise) == []


def test_a_sensor_that_saturates_on_both_sides_is_clipped() -> None:
    noisy = np.sin(np.arange(2000) / 60.0) + 1e-3 * np.random.default_rng(1).standard_normal(2000)
    assert plausible.clipped_at(np.clip(noisy, -0.8, 0.8)) == 0.8
    assert plausible.clipped_at(np.clip(noisy, -0.8, 2.0)) == -0.8
    assert plausible.clipped_at(noisy) is None


@pytest.mark.parametrize("row", [0, 7, 599])
def test_a_stale_or_torn_number_is_a_spike_at_either_end(tmp_path: Path, row: int) -> None:
    force = -FORCE_N / 4.4482216152605
    force[row] += 3.0
    _, account = imported(tmp_path, text(force=force))
    assert account.channels["column_force_N"].doubts == ("1 spike",)


def test_a_fast_start_is_no_spike(tmp_path: Path) -> None:
    force = -(FORCE_N[0] + 50.0 * np.sin(np.arange(ROWS) / 8.0)) / 4.4482216152605
    _, account = imported(tmp_path, text(force=force))
    assert not any("spike" in doubt for doubt in account.channels["column_force_N"].doubts)


def test_a_line_may_end_in_more_delimiters_than_the_header(tmp_path: Path) -> None:
    head, *rows = text().splitlines()
    record, _ = imported(tmp_path, "\n".join([head, *(f"{line},," for line in rows)]))
    np.testing.assert_allclose(record["column_force_N"], FORCE_N, rtol=1e-10)


def test_an_evenly_sampled_log_needs_no_time_column(tmp_path: Path) -> None:
    rate = MAP.replace('from = "T"\nunit = "ms"', "rate_Hz = 60")
    record, account = imported(tmp_path, log_map=rate)
    np.testing.assert_allclose(record["column_force_N"], FORCE_N, rtol=1e-10)
    assert account.unmapped == ("T",)


# Channels of the user's own


def with_own(name: str, keys: str) -> tuple[str, str]:
    """Return a log with a temperature, and a map that reads it under a name."""
    head, *rows = text().splitlines()
    log = [f"{head},Temp", *(f"{row},{20.0 + 0.001 * k}" for k, row in enumerate(rows))]
    return "\n".join(log) + "\n", f'{MAP}[channels."{name}"]\nfrom = "Temp"\n{keys}'


def test_a_channel_of_the_users_own_is_imported_for_a_regressor(tmp_path: Path) -> None:
    log, log_map = with_own("motor_temperature_K", "own = true\noffset = 273.15\n")
    (tmp_path / "log.csv").write_text(log)
    (tmp_path / "map.toml").write_text(log_map)
    record, account = import_log(tmp_path / "log.csv", tmp_path / "map.toml")
    assert record.channels[-1] == "motor_temperature_K"
    assert record["motor_temperature_K"][0] == pytest.approx(293.15)
    assert record.manifest["channels"] == list(record.channels)
    assert account.channels["motor_temperature_K"].source == "Temp"


@pytest.mark.parametrize(
    ("name", "keys", "says"),
    [
        ("motor_temperature_K", "", "no record has such a channel; .*own = true for one of your"),
        ("motor_temperature_K", 'own = true\nunit = "m"\n', "convert it by scale and offset"),
        ("column_forse_N", "own = true\n", "own: is not for column_force_N"),
        ("column_force_lbf", "own = true\n", "own: is not for column_force_N"),
        ("loader_time_s", "own = true\n", "own: is not for loader_time_s"),
        ("a b", "own = true\n", "is no name: give letters"),
    ],
)
def test_another_channel_is_refused_by_its_key(
    tmp_path: Path, name: str, keys: str, says: str
) -> None:
    log, log_map = with_own(name, keys)
    (tmp_path / "log.csv").write_text(log)
    (tmp_path / "map.toml").write_text(log_map)
    with pytest.raises(InputError, match=says):
        import_log(tmp_path / "log.csv", tmp_path / "map.toml")
