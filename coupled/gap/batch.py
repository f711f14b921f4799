"""Many records diagnosed by one frozen version: a folder with `records.toml`, each record alone.

Each diagnosis is written as soon as it is made, with the hashes of what made it; a second run
of the same version does only what is missing. The records are dealt to all cores.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import os
from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import coupled
from coupled.errors import InputError, nearest
from coupled.files import check_target, sha256, write_text
from coupled.gap.diagnose import diagnose
from coupled.gap.report import add_report
from coupled.parallel import executor
from coupled.record.record import read_record
from coupled.resources import shipped_rigs
from coupled.rig.rigfile import read_rig
from coupled.schema import load_toml

LIST = "records.toml"
HEAD = ("record", "rig", "verdict", "effects", "parameters", "guilty", "rivals", "closed")
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Job:
    """One record, its rig, and where its diagnosis goes."""

    name: str
    record: Path
    rig: Path
    out: Path


def jobs(folder: Path, out: Path) -> list[Job]:
    """Return what a folder's `records.toml` asks for: record = rig.

    Records lie beside it or in `records/`, rigs in `rigs/` there or a folder up, else among
    the shipped ones.
    """
    listed = load_toml(folder / LIST)
    found = []
    for name, rig in listed.items():
        if not isinstance(rig, str):
            raise InputError(folder / LIST, name, "needs the name of a rig, in quotes")
        file = f"{name}.json"
        check_target(out / file)
        found.append(Job(name, _record(folder, name), _rig(folder, name, rig), out / file))
    if not found:
        raise InputError(folder / LIST, "", "names no record")
    return found


def _record(folder: Path, name: str) -> Path:
    places = [
        folder / sub / f"{name}{end}" for sub in ("", "records") for end in (".csv", ".parquet")
    ]
    for place in places:
        if place.is_file():
            return place
    raise InputError(folder / LIST, name, f"there is no {name}.csv or .parquet beside it")


def _rig(folder: Path, name: str, rig: str) -> Path:
    shipped = shipped_rigs()
    for place in (folder / "rigs" / f"{rig}.toml", folder.parent / "rigs" / f"{rig}.toml"):
        if place.is_file():
            return place
    if rig in shipped:
        return shipped[rig]
    raise InputError(folder / LIST, name, f"there is no rig {rig!r}; {nearest(rig, shipped)}")


def summary(found: Sequence[dict[str, Any]]) -> str:
    """Return a table of diagnoses as CSV, a row a record."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(
        ["record", "rig", "verdict", "effects", "parameters", "guilty", "rivals", "closed"]
    )
    for item in found:
        effects = item["effects"]
        parameters = [
            f"{name}={value['value']:.5g}"
            for effect in effects
            for name, value in effect["parameters"].items()
        ]
        guilty = [stage for stage, told in item["stages"].items() if told.get("guilty")]
        rivals = ["|".join(group) for group in item["rivals"]]
        closed = item["shrink"].get("closed", "")
        row = [item["record"], item["made"]["rig"], item["verdict"]]
        row += [
            " ".join(names) for names in ([e["name"] for e in effects], parameters, guilty, rivals)
        ]
        table.writerow([*row, f"{closed:.4f}" if closed != "" else ""])
    return text.getvalue()


def version_hash() -> str:
    """Return the hash of all the package's sources: what a frozen version is."""
    here = Path(coupled.__file__).parent
    digest = hashlib.sha256()
    for source in sorted(here.rglob("*.py")):
        digest.update(source.relative_to(here).as_posix().encode() + source.read_bytes())
    return digest.hexdigest()


def run(job: Job, version: str) -> dict[str, Any]:
    """Diagnose one record, write its JSON, and return it; a refused record is told as such."""
    made = {
        "coupled": coupled.__version__,
        "sources_sha256": version,
        "record_sha256": sha256(job.record),
        "rig": job.rig.stem,
        "rig_sha256": sha256(job.rig),
    }
    known = _known(job.out)
    if known.get("made") == made:
        return known
    try:
        records = {str(job.record): read_record(job.record)}
        whole = diagnose(read_rig(job.rig), records, "column")
        add_report(whole, records)
        found = whole.found
    except InputError as error:
        refused = {"verdict": "refused", "why": f"{error.key}: {error.problem}".lstrip(": ")}
        found = refused | {"stages": {}, "effects": [], "rivals": [], "shrink": {}}
    found = {"record": job.name} | found | {"made": made}
    write_text(job.out, json.dumps(found, indent=1, ensure_ascii=False) + "\n")
    return found


def _known(path: Path) -> dict[str, Any]:
    try:
        known = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return known if isinstance(known, dict) else {}


def run_all(todo: list[Job], progress: Progress, workers: int = 0) -> list[dict[str, Any]]:
    """Diagnose all records on all cores; the order and the numbers are those of one core."""
    version = version_hash()
    found: dict[str, dict[str, Any]] = {}
    with executor(workers or os.cpu_count() or 1) as pool:
        waiting = {pool.submit(run, job, version): job.name for job in todo}
        for done in as_completed(waiting):
            found[waiting[done]] = done.result()
            progress(waiting[done], len(found), len(todo))
    return [found[job.name] for job in todo]
