"""The command of the gap between a rig and its records: one, several, or a folder of them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from coupled.cli.app import JsonOption, app
from coupled.cli.terminal import check_json, keep_json, out, print_json, progress, say
from coupled.errors import InputError, shown
from coupled.files import check_target, check_targets, write_text
from coupled.outputs import Outputs
from coupled.record.channels import CONTROL_NAMES, ControlName
from coupled.resources import find, shipped_rigs

if TYPE_CHECKING:
    from coupled.gap.diagnose import Diagnosis
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
            help="Records of one rig, CSV or Parquet; or a folder whose records.toml names each's.",
        ),
    ],
    rig: Annotated[str, typer.Option(help="Its rig file, or the name of a shipped one.")] = "",
    control: Annotated[str, typer.Option(help="column, wheel or pedals.")] = "column",
    improve: Annotated[
        Path | None, typer.Option(metavar="NEW.toml", help="Write the rig with the effects found.")
    ] = None,
    plots: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Draw ladder, stages and signature there.")
    ] = None,
    power: Annotated[
        bool, typer.Option("--power", help="Tell what size of each effect would have shown.")
    ] = False,
    output: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="For a folder: where its diagnoses go, a JSON each."),
    ] = None,
    json_file: JsonOption = "",
) -> None:
    """Tell where records depart from their rig, which effect causes it, and how far it shrinks."""
    if any(record.is_dir() for record in records):
        asked = {"--improve": improve, "--plots": plots, "--power": power, "--json": json_file}
        for option, value in asked.items():
            if value:
                raise InputError(records[0], option, "is for records of one rig, not for a folder")
        _diagnose_folder(records, rig, output)
        return
    if output is not None:
        raise InputError(output, "--output", "is for a folder of records; give --json FILE")
    if not rig:
        raise InputError(records[0], "--rig", "is missing: the rig file to hold the record against")
    rig_file = find(rig, shipped_rigs(), "rig")
    name = _control(control, records[0])
    inputs = [*records, rig_file]
    if improve is not None and improve.suffix != ".toml":
        raise InputError(improve, "--improve", "is a rig file: its name ends in .toml")
    drawn = _plot_targets(plots)
    targets = [*drawn, *([improve] if improve else [])]
    for target in targets:
        check_target(target, inputs)
    if improve in drawn:
        raise InputError(plots or "", "--plots", f"would write {improve}, as does --improve")
    check_json(json_file, [*inputs, *targets])
    whole, read = _diagnose(records, rig_file, name)
    if power:
        whole.found["power"] = _power(whole)
    with Outputs() as outputs:
        if improve is not None:
            _write_improved(outputs.at(improve), whole, rig_file, read)
        if plots is not None:
            _draw(outputs.folder(plots), whole, read)
        keep_json(whole.found, json_file, outputs)
    if json_file != "-":
        _print(whole, improve, drawn)
    print_json(whole.found, json_file)


def _control(word: str, file: Path) -> ControlName:
    for name in CONTROL_NAMES:
        if name == word:
            return name
    raise InputError(file, "--control", f"is {word!r}; one of {', '.join(CONTROL_NAMES)}")


def _diagnose(
    files: list[Path], rig_file: Path, control: ControlName
) -> tuple[Diagnosis, dict[str, Record]]:
    from coupled.gap.diagnose import diagnose as find_gap
    from coupled.gap.report import add_report
    from coupled.record.record import read_record
    from coupled.rig.rigfile import read_rig

    nominal = read_rig(rig_file)
    read: dict[str, Record] = {}
    for file in files:
        if str(file) in read:
            raise InputError(file, "", "is given twice")
        read[str(file)] = read_record(file)
    with progress() as advance:
        whole = find_gap(nominal, read, control, advance)
        advance("flying again, and looking for the next test", 0, 1)
        add_report(whole, read)
    return whole, read


def _power(whole: Diagnosis) -> list[dict[str, Any]]:
    from coupled.gap.power import power

    return power(whole.choice.settled.rig, whole.control, whole.outputs)


def _print(whole: Diagnosis, improve: Path | None, drawn: list[Path]) -> None:
    from coupled.cli.tables.gaps import print_closed_loop, print_power, print_stages
    from coupled.gap.words import in_words

    out.print(in_words(whole.found, whole.control), markup=False, highlight=False)
    print_stages(out, whole.found)
    print_closed_loop(out, whole.found)
    if "power" in whole.found:
        print_power(out, whole.found["power"])
    if improve is not None:
        say(f"improved rig: {improve}")
    for figure in drawn:
        say(f"figure: {figure}")


def _write_improved(
    path: Path, whole: Diagnosis, rig_file: Path, records: dict[str, Record]
) -> None:
    from coupled.gap.words import in_words
    from coupled.rig.rigwrite import rig_text

    names = ", ".join(shown(Path(name).name) for name in records)
    remark = f"{shown(rig_file.name)} with what was found in {names}:\n"
    write_text(path, rig_text(whole.improved, remark + in_words(whole.found, whole.control)))


def _plot_targets(folder: Path | None) -> list[Path]:
    """Return the files that a diagnosis draws into a folder."""
    if folder is None:
        return []
    from coupled.plots.gaps import FIGURES

    return [folder / name for name in FIGURES]


def _draw(folder: Path, whole: Diagnosis, records: dict[str, Record]) -> None:
    from coupled.plots.gaps import draw_diagnosis
    from coupled.plots.saving import save

    for file, figure in draw_diagnosis(whole, records).items():
        save(figure, folder / file)


def _diagnose_folder(folders: list[Path], rig: str, output: Path | None) -> None:
    """Diagnose every record of a folder, each alone; print and write a summary."""
    from coupled.cli.tables.gaps import print_summary
    from coupled.gap.batch import LIST, jobs, run_all, summary
    from coupled.record.record import manifest_path

    if len(folders) > 1:
        raise InputError(folders[1], "", "a folder of records is diagnosed by itself")
    if rig:
        raise InputError(folders[0], "--rig", "leave it out: records.toml names each record's rig")
    if output is None:
        raise InputError(folders[0], "--output", "is missing: the folder for the diagnoses")
    todo = jobs(folders[0], output)
    read = [file for job in todo for file in (job.record, manifest_path(job.record), job.rig)]
    targets = [*(job.out for job in todo), output / "summary.csv"]
    check_targets(targets, [folders[0] / LIST, *read])
    with progress() as advance:
        found = run_all(todo, advance)
    write_text(output / "summary.csv", summary(found))
    print_summary(out, found)
    say(f"diagnoses: {output}  ({len(found)}, and summary.csv)")
