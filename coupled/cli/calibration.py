"""The command `calibrate`: calibrates from readings, or plans them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coupled.cli.app import JsonOption, UnitsOption, app
from coupled.cli.progress import progress
from coupled.cli.reporting import ReportOption, check_report, say_report, write_report
from coupled.cli.rigs import (
    DEFAULT_RIG,
    ControlOption,
    CrossedOption,
    ErrorOption,
    OnceOption,
    StrongestOption,
    instruments,
    rig_and_control,
    say_guesses,
)
from coupled.cli.terminal import (
    check_json,
    keep_json,
    out,
    print_json,
    refuse_needless,
    say,
    say_note,
)
from coupled.display import System, in_system
from coupled.errors import InputError, shown
from coupled.files import check_target, write_text
from coupled.outputs import Outputs
from coupled.record.channels import ControlName, unit_of

if TYPE_CHECKING:
    from coupled.calibration.estimate import Instruments
    from coupled.calibration.plan import DeflectionNeeds
    from coupled.calibration.readingsplan import ReadingsPlan
    from coupled.calibration.result import CalibrationResult
    from coupled.rig.rig import Rig

_PRECISION, _STRONGEST_N = 5.0, 150.0


@app.command(
    epilog="[dim]Examples: coupled calibrate out/report-column-readings.csv"
    " · coupled calibrate my.csv --rig my.toml --hardware --write new.toml --date 1974-02-04"
    " · coupled calibrate --plan --precision 5[/]"
)
def calibrate(
    readings: Annotated[Path | None, typer.Argument(help="Readings, CSV; not with --plan.")] = None,
    rig: Annotated[
        str,
        typer.Option(
            help="A rig file, or the name of a shipped rig, for travel, arc, gains and gradients."
            f" (default: {DEFAULT_RIG})"
        ),
    ] = "",
    control: ControlOption = "column",
    write: Annotated[
        Path | None,
        typer.Option(
            metavar="NEW",
            help="Write the calibrated rig to this .toml; with --plan, a form for readings to"
            " .csv.",
        ),
    ] = None,
    hardware: Annotated[
        bool,
        typer.Option(
            "--hardware",
            help="With --write, for readings of a real loader: write the results as the rig's"
            " hardware, too. (default: only as the host's values)",
        ),
    ] = False,
    date: Annotated[
        str, typer.Option(help="Date of the readings, any text, for the rig file.")
    ] = "",
    plan: Annotated[
        bool, typer.Option("--plan", help="Print which readings to take; give no readings.")
    ] = False,
    precision: Annotated[
        float,
        typer.Option(
            help="With --plan: half-width of the 95 % interval of K, % of K.", min=0.1, max=100
        ),
    ] = _PRECISION,
    strongest: StrongestOption = _STRONGEST_N,
    once: OnceOption = False,
    crossed: CrossedOption = 0.0,
    figure: Annotated[
        Path | None,
        typer.Option(help="Draw readings and fit (the report's figure 4): PNG, PDF or SVG."),
    ] = None,
    error: ErrorOption = None,
    json_file: JsonOption = "",
    report: ReportOption = None,
    units: UnitsOption = "si",
) -> None:
    """Estimate S1, S2, S3 and K from readings, with standard errors; or plan the readings."""
    file, data, name = rig_and_control(rig or DEFAULT_RIG, control)
    tools = instruments(name, error)
    if plan:
        if readings is not None or figure is not None:
            raise InputError("--plan", "", "plans readings to come; give no readings and no figure")
        of_calibration = {"--report": report, "--hardware": hardware, "--date": date}
        refuse_needless("--plan", of_calibration, "is for a calibration, not for a plan")
        wanted = (precision / 100.0, strongest, 1 if once else 2, crossed)
        _plan((file, data, name), tools, wanted, (write, json_file), units)
        _say_default(rig)
        return
    if readings is None:
        raise InputError("calibrate", "", "give a file of readings, or --plan for which to take")
    of_plan = {"--precision": precision != _PRECISION, "--strongest-N": strongest != _STRONGEST_N}
    of_plan |= {"--once": once, "--crossed-N": crossed > 0.0}
    refuse_needless(str(readings), of_plan, "is for --plan")
    if write is None:
        refuse_needless(str(readings), {"--hardware": hardware}, "is for --write NEW.toml")
    inputs = [readings, file]
    for target, suffix in ((write, ".toml"), (figure, "")):
        if target is not None:
            if suffix and target.suffix.lower() != suffix:
                raise InputError(target, "--write", "a rig file ends in .toml")
            check_target(target, inputs)
    if figure is not None:
        from coupled.plots.saving import check_format

        check_format(figure)
    own = [*inputs, *(path for path in (write, figure) if path)]
    check_json(json_file, [*own, *check_report(report, own)])
    targets = (write, figure, report, json_file)
    _calibrate(readings, (file, data, name), tools, targets, (date, hardware), units)
    _say_default(rig)


def _say_default(rig: str) -> None:
    """Print which rig's values are used if none is named."""
    if not rig:
        say_note(f"no --rig given: travel, arc, gains and gradients are {DEFAULT_RIG}'s")


def _calibrate(
    path: Path,
    rig: tuple[Path, Rig, ControlName],
    tools: Instruments,
    targets: tuple[Path | None, Path | None, Path | None, str],
    noted: tuple[str, bool],
    units: System,
) -> None:
    from coupled.calibration.calibrate import calibrate_control as fit
    from coupled.calibration.calibrated import (
        refuse_other_hardware,
        unstated_scales,
        with_calibration,
    )
    from coupled.calibration.readingsfile import read_readings
    from coupled.rig.rigfile import rig_from_table
    from coupled.rig.rigwrite import rig_text
    from coupled.schema import loads_toml

    (file, data, name), (write, figure, report, json_file) = rig, targets
    date, hardware = noted
    note = say_guesses(data, (name,))
    with progress(f"fitting the {name}'s readings"):
        found = fit(read_readings(path, name), data.controls[name], name, tools, path)
    text = ""
    if write is not None:
        new = with_calibration(data, name, found, date, hardware)
        refuse_other_hardware(data.controls[name], new.controls[name], found, file)
        text = rig_text(new, f"{shown(file.name)}, its {name} calibrated from {shown(path.name)}")
        rig_from_table(loads_toml(text, write), write)  # a rig that cannot be flown is refused
    with Outputs() as outputs:
        if write is not None:
            write_text(outputs.at(write), text)
        if figure is not None:
            from coupled.plots.readings import draw_readings
            from coupled.plots.saving import save

            save(draw_readings(found, shown(path.name), units), outputs.at(figure), note)
        keep_json(found.as_dict(), json_file, outputs)
        if report is not None:
            from coupled.reports.calibration import calibration_report

            names = (data.name, shown(path.name), date)
            inputs = [path, file]
            write_report(
                report,
                outputs,
                inputs,
                lambda made: calibration_report(found, *names, made, units),
                note,
            )
    if json_file != "-":
        _print_results(found, units)
        if write is not None:
            unstated = unstated_scales(data.controls[name], found)
            if unstated and not hardware:
                say(f"{', '.join(unstated)}: not in {file.name}, so the hardware's are those found")
            say(f"calibrated rig: {write}")
        if figure is not None:
            say(f"figure: {figure}")
        say_report(report)
    print_json(found.as_dict(), json_file)


def _plan(
    of_rig: tuple[Path, Rig, ControlName],
    tools: Instruments,
    wanted: tuple[float, float, int, float],
    targets: tuple[Path | None, str],
    units: System,
) -> None:
    from coupled.calibration.readingsplan import plan_readings

    (file, rig, control), (write, json_file) = of_rig, targets
    share, strongest, looks, crossed = wanted
    if write is not None:
        if write.suffix.lower() != ".csv":
            raise InputError(write, "--write", "a form for readings ends in .csv")
        check_target(write, [file])
    check_json(json_file, [file, *([write] if write else [])])
    with progress() as advance:
        found = plan_readings(rig, control, tools, share, strongest, looks, crossed, advance)
    with Outputs() as outputs:
        if write is not None:
            write_text(outputs.at(write), found.form(units))
        keep_json(found.as_dict(), json_file, outputs)
    if json_file != "-":
        _print_plan(found, units)
        for name, half in found.others.items():
            force, bend = (in_system(u, units) for u in ("N", f"{unit_of(control)}/N"))
            held_at = f"±{force.factor * crossed:.4g} {force.unit}"
            reached_to = f"±{bend.written(half, 2)} {bend.unit}"
            say(f"with {held_at} on the {name}: K by {name} to {reached_to}")
        if write is not None:
            say(f"form: {write}")
    print_json(found.as_dict(), json_file)


def _print_results(found: CalibrationResult, system: System) -> None:
    """Print the results of readings, their reliability, and the values to use."""
    from coupled.calibration.figures import basis, remarks
    from coupled.cli.tables import print_table
    from coupled.tables.calibration import results_table

    out.print(basis(found), highlight=False)
    out.print()
    print_table(out, results_table(found, system))
    out.print()
    for line in remarks(found, system):
        out.print(line, highlight=False, markup=False)


def _print_plan(plan: ReadingsPlan, system: System) -> None:
    """Print the precision of K with grids of readings, and the fewest readings that suffice."""
    from coupled.cli.tables import print_table
    from coupled.display import percent
    from coupled.tables.calibration import grids_table, plan_table

    count, half = plan.reached.readings, plan.reached.half_width
    print_table(out, grids_table(plan, system))
    out.print(f"\nfewest for ± {percent(half)}: {count} readings", highlight=False)
    print_table(out, plan_table(plan, system))
    out.print(
        "\nReadings at the softest gradient and a large deflection determine S1; those at the"
        " stiffest gradient and full force determine K. The others test whether the bend is linear."
    )
    out.print(_deflection_line(plan.needs, count), highlight=False)


def _deflection_line(needs: DeflectionNeeds, readings: int) -> str:
    """Return the error of δ̂ after these readings, and what reaches the wanted error."""
    wanted = f"{100 * needs.wanted:g} %"
    text = "In a rig compensated with these readings, the error of δ̂ is at most"
    text += f" {100 * needs.half_width:.2g} % of δ (95 %)."
    if needs.half_width <= needs.wanted:
        return text
    ways = []
    if needs.readings is not None:
        ways.append(f"{needs.readings} readings")
    if needs.ruler is not None:
        ways.append(f"these {readings} with a ruler {needs.ruler:.2g} times finer")
    elif needs.all is not None:
        smaller = f"{needs.all:.2g} times smaller"
        ways.append(f"these {readings} with all errors of instruments and hand {smaller}")
    if not ways:
        return f"{text} No number of readings reaches {wanted}."
    return f"{text} {wanted} requires {', or '.join(ways)}."
