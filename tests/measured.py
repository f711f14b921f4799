"""How far the gap of each measured machine shrinks by effects alone, and with curves.

    python -m tests.measured        every machine in ../shared/real
    python -m tests.measured FOLDER emps so101        those of a folder whose names begin so

The data are of others and are not shipped. A row is a record: the verdict, its channel with the
widest gap in noise floors, and the share of this gap that is closed on held-out stretches, with its
95 % interval, by the effects, and with the curves beside the credible ones.
"""

from __future__ import annotations

import sys
from pathlib import Path

from coupled.gap.diagnose import diagnose
from coupled.gap.findings.budget import ChannelShrink
from coupled.gap.findings.diagnosis import Diagnosis
from coupled.record.record import read_record
from coupled.rig.rigfile import read_rig

SO101 = "so101/rotation.toml"
MACHINES = {  # name: record and rig
    "emps": ("emps-train.csv", "emps-train.toml"),
    "ur10e-j6": ("ur10e-j6/ur10e-j6-then-rests.csv", "ur10e-j6/rig.toml"),
    "franka-j7": ("franka-j7/franka-j7-25Hz.csv", "franka-j7/rig.toml"),
    "hsm150": ("motor-hsm150/hsm150.csv", "motor-hsm150/rig.toml"),
    **{
        f"pendulum-kp{gain}": (
            f"pendulum-servo/sin_time_square-kp{gain}-1.csv",
            "pendulum-servo/m3-no-friction.toml",
        )
        for gain in (8, 16, 32)
    },
    **{
        f"so101-{motion}": (f"so101/{motion}-rotation.csv", SO101)
        for motion in ("friction_gravity", "chirp_sweep", "backlash_detection")
    },
}


def share(one: ChannelShrink | None) -> str:
    """Return the share closed, with its interval."""
    if one is None or one.closed is None:
        return "none"
    if one.low is None or one.high is None:
        return f"{100 * one.closed:.0f} %"
    return f"{100 * one.closed:.0f} % ({100 * one.low:.0f} to {100 * one.high:.0f})"


def row(name: str, found: Diagnosis) -> str:
    """Return the row of a machine."""
    widest = found.shrink.widest
    gap = f"{widest.channel}, {widest.before / widest.floor:.1f}"
    curves = ", ".join(one.key.split(".", 2)[2] for one in found.curves)
    curved = [one for one in found.shrunk_by_curves if one.channel == widest.channel]
    with_curves = f"{share(curved[0])}: {curves}" if curved else curves or "no curve"
    return f"{name}| {found.verdict}| {gap}| {share(widest)}| {with_curves}"


def main(folder: str, begins: tuple[str, ...]) -> None:
    """Print the table."""
    print("machine| verdict| widest gap, noise floors| closed by effects| with curves")
    print("---| ---| ---| ---| ---")
    for name, (record, rig) in MACHINES.items():
        if begins and not name.startswith(begins):
            continue
        read = {"r": read_record(Path(folder) / record)}
        print(row(name, diagnose(read_rig(Path(folder) / rig), read)), flush=True)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "../shared/real", tuple(sys.argv[2:]))
