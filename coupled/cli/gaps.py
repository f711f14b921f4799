"""The commands of the gap between a rig and its records: diagnose."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from coupled.cli.app import JsonOption, app
from coupled.errors import InputError
from coupled.files import check_target, write_text
from coupled.resources import shipped_rigs
from coupled.terminal import check_json, give_json, out, say


@app.command(epilog="[dim]Example: coupled diagnose out/737.csv --rig 737 --json out/737.json[/]")
def diagnose(
    record: Annotated[Path, typer.Argument(help="A record, CSV or Parquet.")],
    rig: Annotated[str, typer.Option(help="Its rig file, or the name of a shipped one.")],
    control: Annotated[str, typer.Option(help="column, wheel or pedals.")] = "column",
    improve: Annotated[
        Path | None, typer.Option(metavar="NEW.toml", help="Write the rig with the effects found.")
    ] = None,
    plots: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Draw ladder, stages and signature there.")
    ] = None,
    json_file: JsonOption = "",
) -> None:
    """Tell where a record departs from its rig, which effect causes it, and how far it shrinks."""
    from coupled.channels import CONTROL_NAMES
    from coupled.gap.diagnose import diagnose as find_gap
    from coupled.gap.words import in_words
    from coupled.record import read_record
    from coupled.resources import find
    from coupled.rig.rigfile import read_rig
    from coupled.rig.rigwrite import rig_text
    from coupled.tables.gaps import print_stages

    rig_file = find(rig, shipped_rigs(), "rig")
    inputs = [record, rig_file]
    drawn = _plot_targets(plots)
    targets = [*drawn, *([improve] if improve else [])]
    for target in targets:
        check_target(target, inputs)
    if improve in drawn:
        raise InputError(plots or "", "--plots", f"would write {improve}, as does --improve")
    check_json(json_file, [*inputs, *targets])
    for name in CONTROL_NAMES:
        if name == control:
            nominal, records = read_rig(rig_file), {str(record): read_record(record)}
            whole = find_gap(nominal, records, name)
            diagnosis, improved = whole.found, whole.improved
            break
    else:
        raise InputError(record, "--control", f"is {control!r}; one of {', '.join(CONTROL_NAMES)}")
    if json_file != "-":
        out.print(in_words(diagnosis, control), markup=False, highlight=False)
        print_stages(out, diagnosis)
    if improve is not None:
        remark = f"{rig_file.name} with what was found in {record.name}:\n"
        write_text(improve, rig_text(improved, remark + in_words(diagnosis, control)))
        if json_file != "-":
            say(f"improved rig: {improve}")
    if plots is not None:
        from coupled.plots.gaps import draw_diagnosis
        from coupled.plots.saving import save

        for file, figure in draw_diagnosis(whole, records).items():
            save(figure, plots / file)
            if json_file != "-":
                say(f"figure: {plots / file}")
    give_json(diagnosis, json_file)


def _plot_targets(folder: Path | None) -> list[Path]:
    """Return the files that a diagnosis draws into a folder."""
    if folder is None:
        return []
    from coupled.plots.gaps import FIGURES

    return [folder / name for name in FIGURES]
