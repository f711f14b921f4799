"""The command `diagnose`, for one record, several, or a folder of records."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coupled.cli.app import JsonOption, UnitsOption, WideOption, app, check_cluster
from coupled.cli.progress import progress
from coupled.cli.recordfiles import RECORDS, check_rig_target, files_read, read_each
from coupled.cli.reporting import ReportOption, check_report, say_report, write_report
from coupled.cli.rigs import say_guesses
from coupled.cli.terminal import check_json, keep_json, out, print_json, say
from coupled.errors import InputError, shown
from coupled.files import check_target, check_targets, write_text
from coupled.outputs import Outputs
from coupled.record.channels import CONTROL_NAMES, ControlName, control_named
from coupled.resources import find, shipped_rigs

if TYPE_CHECKING:
    from coupled.display import System
    from coupled.gap.findings.diagnosis import Diagnosis
    from coupled.record.record import Record


@app.command(
    epilog="[dim]Examples: coupled diagnose out/737.csv --rig 737 --plots out/737"
    " · coupled diagnose a.csv b.csv --rig my-rig.toml --json - --power"
    " · coupled diagnose out/trials --output out/diagnoses[/]"
)
def diagnose(
    records: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORD...",
            help=f"Records of one rig, {RECORDS}; or a folder with a records.toml that names"
            " the rig of each record.",
        ),
    ],
    rig: Annotated[
        str,
        typer.Option(
            help="The records' rig: a rig file, or the name of a shipped rig. (default: the rig"
            " in the manifest beside the record)"
        ),
    ] = "",
    control: Annotated[
        str,
        typer.Option(
            help="Judge this control only: column, wheel or pedals. (default: all controls that the"
            " records move, and the airframe)"
        ),
    ] = "",
    healthy: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="RECORD",
            help="A record of the healthy machine; may be repeated. These records are the reference"
            " of the diagnosis. (default: the rig file is)",
        ),
    ] = None,
    improve: Annotated[
        Path | None, typer.Option(metavar="NEW.toml", help="Write the rig with the effects found.")
    ] = None,
    with_curves: Annotated[
        bool,
        typer.Option(
            "--with-curves",
            help="With --improve: also write the curves fitted where no effect explains a stage.",
        ),
    ] = False,
    plots: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Draw ladder, stages, signature and curves into this folder: one set of"
            " figures for each faulty control and a faulty airframe, or for all if none is faulty.",
        ),
    ] = None,
    terms: Annotated[
        bool,
        typer.Option(
            "--terms",
            help="Fit a factor on each named aerodynamic function of the model, in place of the"
            " library's aerodynamic effects.",
        ),
    ] = False,
    power: Annotated[
        bool,
        typer.Option("--power", help="Print the smallest detectable size of each effect."),
    ] = False,
    output: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="For a folder of records: folder for the diagnoses, one JSON file for each"
            " record.",
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers",
            "-j",
            min=1,
            max=512,
            help="For a folder of records: number of processes. (default: one for each core)",
        ),
    ] = None,
    cluster: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="For a folder of records: address of a dask scheduler, whose workers diagnose"
            " them. (default: this computer)",
        ),
    ] = "",
    json_file: JsonOption = "",
    report: ReportOption = None,
    units: UnitsOption = "si",
    wide: WideOption = False,
) -> None:
    """Find which stages of a rig deviate from its records, by which effects, and by how much."""
    name = control_named(control, records[0]) if control else None
    if any(record.is_dir() for record in records):
        asked = {"--improve": improve, "--plots": plots, "--power": power, "--healthy": healthy}
        asked |= {"--terms": terms, "--with-curves": with_curves}
        _refuse_for_folders(records, asked | {"--json": json_file, "--report": report})
        _diagnose_folder(records, rig, output, name, check_cluster(workers, cluster))
        return
    if workers is not None or cluster:
        option = "--cluster" if cluster else "--workers"
        raise InputError(records[0], option, "is for a folder of records")
    if with_curves and improve is None:
        raise InputError(records[0], "--with-curves", "is for --improve NEW.toml")
    if output is not None:
        raise InputError(output, "--output", "is for a folder of records; give --json FILE")
    rig_file = find(rig, shipped_rigs(), "rig") if rig else None
    inputs = files_read([*records, *(healthy or [])], rig_file)
    drawn = _plot_targets(plots)
    for target in drawn:
        check_target(target, inputs, made=plots)
    targets = [*drawn, *check_rig_target(improve, "--improve", inputs, plots)]
    if improve in drawn:
        raise InputError(plots or "", "--plots", f"would write {improve}, as does --improve")
    targets += check_report(report, [*inputs, *targets], plots)
    check_json(json_file, [*inputs, *targets])
    whole, read = _diagnose(records, rig_file, name, healthy or [], terms)
    note = say_guesses(whole.nominal, whole.controls)
    improves = whole.improves_with_curves if with_curves else whole.improves
    worse = improve is not None and not improves
    table = whole.as_dict(power) if json_file else {}
    with progress("drawing and writing"), Outputs() as outputs:
        if improve is not None and not worse:
            _write_improved(outputs.at(improve), whole, rig_file, read, with_curves)
        if plots is not None:
            drawn = [plots / one for one in _draw(outputs.folder(plots), whole, note, units)]
        keep_json(table, json_file, outputs)
        _report(report, outputs, inputs, (whole, power, note, units))
    if json_file != "-":
        if rig_file is None:
            say(f"rig: {whole.nominal.name}, of the manifest of {shown(records[0].name)}")
        with out.widened(wide):
            _print(whole, power, (None if worse else improve, drawn), units)
        say_report(report)
        if with_curves and not whole.curves:
            say("no curve was fitted: --with-curves adds none to the rig")
        if worse:
            say(f"not written: {improve}, since a flight of that rig differs more from the record")
    print_json(table, json_file)


def _refuse_for_folders(records: list[Path], asked: dict[str, object]) -> None:
    for option, value in asked.items():
        if value:
            raise InputError(records[0], option, "is for records of one rig, not for a folder")


def _diagnose(
    files: list[Path],
    rig_file: Path | None,
    control: ControlName | None,
    healthy: list[Path],
    terms: bool,
) -> tuple[Diagnosis, dict[str, Record]]:
    from coupled.gap.checks import rig_of_manifests
    from coupled.gap.diagnose import diagnose as find_gap
    from coupled.rig.rigfile import read_rig

    nominal = None if rig_file is None else read_rig(rig_file)
    read = read_each([*files, *healthy])
    well = {str(file): read.pop(str(file)) for file in healthy}
    nominal = rig_of_manifests(read) if nominal is None else nominal
    with progress() as advance:
        whole = find_gap(nominal, read, control, advance, well, terms=terms)
        advance("flying again, and looking for the next test", 0, 1)
        # Computed here, where progress is shown.
        _ = whole.closed_loop, whole.closed_loop_with_curves, whole.in_flight, whole.next_tests
    return whole, read


def _print(
    whole: Diagnosis, power: bool, written: tuple[Path | None, list[Path]], units: System
) -> None:
    from coupled.calibration.assumedscales import outdated_bends
    from coupled.cli.tables import print_table
    from coupled.tables.gaps import diagnosis_tables

    improve, drawn = written
    out.print(in_words(whole, units), markup=False, highlight=False)
    for table in diagnosis_tables(whole, power, units):
        out.print()
        print_table(out, table, edge=True)
    if improve is not None:
        say(f"improved rig: {improve}")
        for sentence in outdated_bends(whole.nominal, whole.improved):
            say(sentence)
    for figure in drawn:
        say(f"figure: {figure}")


def in_words(whole: Diagnosis, system: System) -> str:
    """Return a diagnosis's summary; values for a rig file are in the file's unit.

    For two or more effects it is a list of sentences.
    """
    from coupled.gap.findings.summary import sentences, summary_in

    text = summary_in(whole.summary, whole.effects, system)
    if len(whole.effects) < 2:
        return text
    return "\n".join(f"- {sentence}" for sentence in sentences(text))


# Reasons of keys in an improved rig that are no effect's parameters.
_GOES_WITH = "which an effect found needs; it has no effect of its own"
_BESIDE = {
    "servo_damping_ratio": "since a file gives both numbers of a servo or none",
    "model_folder": "whole, since this file may lie elsewhere",
    "guesses": "without the numbers that were found",
}


def _write_improved(
    path: Path,
    whole: Diagnosis,
    rig_file: Path | None,
    records: dict[str, Record],
    with_curves: bool,
) -> None:
    from coupled.calibration.assumedscales import outdated_bends
    from coupled.files import read_text
    from coupled.gap.checks import rig_of_manifests, trim_in
    from coupled.gap.findings.summary import changed
    from coupled.gap.signals.reading import in_trim
    from coupled.rig.rigedit import differences, edited
    from coupled.rig.rigfile import read_rig
    from coupled.rig.rigwrite import rig_text

    names = ", ".join(shown(Path(name).name) for name in records)
    if rig_file is None:
        filed, held = rig_of_manifests(records), "the manifest's rig"
        text = rig_text(filed)
    else:
        filed, held = read_rig(rig_file), shown(rig_file.name)
        text = read_text(rig_file, "a rig file is wanted")
    remark = f"{held} with what was found in {names}:\n{whole.summary}\n"
    improved = whole.with_curves if with_curves else whole.improved
    curves = whole.curves if with_curves else ()
    # The trim was taken from the record, and is no change of the rig file; nor is the frame rate
    # of a rig without controls.
    nominal = whole.nominal
    judged = in_trim(filed, trim_in(nominal, filed)) if filed.controls else nominal
    changes = differences(judged, improved)
    remark += "".join(f"added: {one.key}, {one.lists} over {one.of}; no cause\n" for one in curves)
    effects, fitted_again = (whole.credible, changes) if curves else (whole.effects, {})
    remark += "".join(f"changed: {line}\n" for line in changed(effects, fitted_again))
    for setting in () if curves else (one for one in whole.settings if one.moved):
        remark += f"changed: {setting.words}, within its tolerance\n"
    remark += "".join(f"{sentence}\n" for sentence in outdated_bends(filed, improved))
    said = remark
    for key in changes:
        dotted = ".".join(key)
        if key[-1] not in said and dotted not in said:
            remark += f"written beside these: {dotted}, {_BESIDE.get(key[-1], _GOES_WITH)}\n"
    write_text(path, edited(text, changes, remark))


def _plot_targets(folder: Path | None) -> list[Path]:
    """Return the files that a diagnosis may draw into a folder."""
    if folder is None:
        return []
    from coupled.gap.chain import AIRFRAME
    from coupled.plots.gaps import figure_files

    return [folder / name for name in figure_files(["", *CONTROL_NAMES, AIRFRAME])]


def _report(
    path: Path | None,
    outputs: Outputs,
    inputs: list[Path],
    handed: tuple[Diagnosis, bool, str, System],
) -> None:
    """Write the report of a diagnosis; `handed` has it, its power or None, a note and units."""
    whole, power, note, units = handed
    if path is None:
        return
    from coupled.reports.diagnosis import diagnosis_report

    title = ", ".join(shown(Path(name).name) for name in whole.records)
    write_report(
        path,
        outputs,
        inputs,
        lambda made: diagnosis_report(whole, title, made, power, units),
        note,
    )


def _draw(folder: Path, whole: Diagnosis, note: str, units: System) -> list[str]:
    """Draw the figures of a diagnosis into a folder; return their files' names."""
    from coupled.plots.gaps import draw_diagnosis
    from coupled.plots.saving import save

    figures = draw_diagnosis(whole, units)
    for file, figure in figures.items():
        save(figure, folder / file, note)
    return list(figures)


def _diagnose_folder(
    folders: list[Path],
    rig: str,
    output: Path | None,
    control: ControlName | None,
    place: tuple[int, str],
) -> None:
    """Diagnose each record of a folder, or a control in each; print and write a summary."""
    from coupled.cli.tables import print_table
    from coupled.gap.batch import LIST, jobs, run_all, summary
    from coupled.record.record import manifest_path
    from coupled.tables.gaps import batch_table

    if len(folders) > 1:
        raise InputError(folders[1], "", "a folder of records is diagnosed by itself")
    if rig:
        raise InputError(folders[0], "--rig", "leave it out: records.toml names each record's rig")
    if output is None:
        raise InputError(folders[0], "--output", "is missing: the folder for the diagnoses")
    todo = jobs(folders[0], output, control)
    read = [file for job in todo for file in (job.record, manifest_path(job.record), job.rig)]
    targets = [*(job.out for job in todo), output / "summary.csv"]
    check_targets(targets, [folders[0] / LIST, *read], made=output)
    with progress() as advance:
        found = run_all(todo, advance, *place)
    write_text(output / "summary.csv", summary(found))
    print_table(out, batch_table(found), edge=True)
    say(f"diagnoses: {output}  ({len(found)}, and summary.csv)")
    if all(row.why for row in found):
        say("no record could be diagnosed: its JSON has the reason for each")
        raise typer.Exit(2)
