"""Writing and printing the results of `new feel` and `import --feel` for a sweep of a control."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from coupled.cli.progress import progress
from coupled.cli.terminal import say, say_note
from coupled.display import System, in_system
from coupled.files import write_text

if TYPE_CHECKING:
    from coupled.calibration.feel import Feel
    from coupled.outputs import Outputs
    from coupled.record.channels import ControlName


def keep_feel(
    feel: Feel,
    control: ControlName,
    source: str,
    file: Path,
    outputs: Outputs,
    units: System = "si",
) -> None:
    """Write the keys of a rig file to `file`, and a plot of the fit with the same name."""
    from coupled.calibration.feel import feel_text
    from coupled.plots.feel import draw_sweep
    from coupled.plots.saving import save

    with progress("drawing the plot"):
        write_text(outputs.at(file), feel_text(feel, control, source))
        save(draw_sweep(feel, control, source, units), outputs.at(file.with_suffix(".png")))


def print_feel(feel: Feel, control: ControlName, file: Path, units: System = "si") -> None:
    """Print the results, the files, and the next step."""
    newtons = in_system("N", units)
    for what, value, half in (
        ("breakout", feel.breakout_N, feel.breakout_half_width_N),
        ("friction", feel.friction_N, feel.friction_half_width_N),
        ("residual RMS", feel.rms_N, 0.0),
    ):
        wide = f" ± {newtons.factor * half:.2g}" if half else ""
        say(f"{what:13}{newtons.factor * value:.4g}{wide} {newtons.unit}")
    segments = len(feel.deflection) - 1
    sides = "for both sides" if feel.deflection[0] == 0.0 else "over both sides"
    say(f"{'curve':13}{segments} segments {sides}, at {len(feel.pressure)} q̄")
    for doubt in feel.doubts(control):
        say_note(doubt)
    plot = file.with_suffix(".png")
    say(f"written: {file}, {plot}")
    say(f"next: compare them in {plot.name}, then put the keys of {file.name} in a rig file")
