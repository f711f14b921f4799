"""Many records diagnosed by one frozen version: a folder with `records.toml`, each record alone.

Each diagnosis is written as soon as it is made, with the hashes of what made it; a second run
of the same version does only what is missing. The records are dealt to all cores, or to a
cluster, whose machines need none of the files.
"""

from __future__ import annotations

import csv
import hashlib
import io
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import coupled
from coupled.errors import InputError, collected, nearest, together
from coupled.files import check_target, json_text, read_json, sha256, write_text
from coupled.gap.diagnose import diagnose
from coupled.gap.findings.result import FORMAT, diagnosis_from, placed
from coupled.parallel import as_done, cores, executor
from coupled.record.channels import ControlName
from coupled.record.record import Record, read_record
from coupled.resources import shipped_rigs
from coupled.rig.parameters import PLAIN_NAME
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.schema import load_toml

LIST = "records.toml"
ENDS = (".csv", ".parquet")  # of records' files
HEAD = ("record", "rig", "verdict", "effects", "parameters", "guilty", "rivals", "closed", "why")
Progress = Callable[[str, int, int], None]
_AHEAD = 4  # records that wait for each worker


@dataclass(frozen=True)
class Job:
    """One record, its rig, where its diagnosis goes, and the control; None for all that move."""

    name: str
    record: Path
    rig: Path
    out: Path
    control: ControlName | None = None


def jobs(folder: Path, out: Path, control: ControlName | None = None) -> list[Job]:
    """Return what a folder's `records.toml` asks for: record = rig.

    Records lie beside it or in `records/`, rigs in `rigs/` there or a folder up, or are shipped.
    """
    listed = load_toml(folder / LIST)
    if not listed:
        raise InputError(folder / LIST, "", "names no record")
    found, faults = [], list[InputError]()
    for name, rig in listed.items():
        with collected(faults):
            found.append(_job(folder, out, name, rig, control))
    if faults:
        raise together(faults)
    return found


def _job(folder: Path, out: Path, name: str, rig: object, control: ControlName | None) -> Job:
    if not isinstance(rig, str):
        raise InputError(folder / LIST, name, "needs the name of a rig, in quotes")
    if not re.match(PLAIN_NAME, name):
        problem = "should be a record's name: letters, digits, dots and dashes, no folder"
        raise InputError(folder / LIST, name, problem)
    if not re.match(PLAIN_NAME, rig):
        raise InputError(folder / LIST, name, f"names the rig {rig!r}: give a name, no folder")
    file, shipped = out / f"{name}.json", shipped_rigs()
    check_target(file, made=out)
    records = (at / f"{name}{end}" for at in (folder, folder / "records") for end in ENDS)
    record = next((place for place in records if place.is_file()), None)
    if record is None:
        raise InputError(folder / LIST, name, f"there is no {name}.csv or .parquet beside it")
    rigs = (at / "rigs" / f"{rig}.toml" for at in (folder, folder.parent))
    rig_file = next((place for place in rigs if place.is_file()), shipped.get(rig))
    if rig_file is None:
        problem = f"there is no rigs/{rig}.toml here or a folder up, and no shipped rig {rig!r}"
        raise InputError(folder / LIST, name, f"{problem}; {nearest(rig, shipped)}")
    return Job(name, record, rig_file, file, control)


@dataclass(frozen=True)
class Row:
    """One record's line of the summary, read off the JSON of its diagnosis."""

    record: str
    rig: str
    verdict: str
    effects: tuple[str, ...]
    parameters: tuple[tuple[str, float | None], ...]
    guilty: tuple[str, ...]
    rivals: tuple[tuple[str, ...], ...]
    closed: float | None
    why: str = ""  # it was refused, or failed

    @classmethod
    def of(cls, document: Mapping[str, Any], job: Job) -> Row:
        """Return the line of a job's diagnosis. Raises InputError for JSON that holds none."""
        kept = diagnosis_from(document, job.out)
        return cls(
            record=job.name,
            rig=job.rig.stem,
            verdict=kept.verdict,
            effects=tuple(placed(effect.name, effect.control) for effect in kept.effects),
            parameters=tuple(
                (name, one.value)
                for e in kept.effects
                for name, one in e.parameters.items()
                if not isinstance(one.value, str)
            ),
            guilty=tuple(name for name, stage in kept.stages.items() if stage.guilty),
            rivals=tuple(tuple(group) for group in kept.rivals),
            closed=kept.shrink.closed,
            why=kept.why,
        )


def summary(rows: Sequence[Row]) -> str:
    """Return a table of diagnoses as CSV, a row a record."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(HEAD)
    for row in rows:
        known = [(name, value) for name, value in row.parameters if value is not None]
        parameters = " ".join(f"{name}={value:.5g}" for name, value in known)
        rivals = " ".join("|".join(group) for group in row.rivals)
        closed = "" if row.closed is None else f"{row.closed:.4f}"
        cells = (row.record, row.rig, row.verdict, " ".join(row.effects), parameters)
        table.writerow((*cells, " ".join(row.guilty), rivals, closed, row.why))
    return text.getvalue()


@lru_cache(maxsize=1)
def version_hash() -> str:
    """Return the hash of all the package's sources: what a frozen version is."""
    here = Path(coupled.__file__).parent
    digest = hashlib.sha256()
    for source in sorted(here.rglob("*.py")):
        digest.update(source.relative_to(here).as_posix().encode() + source.read_bytes())
    return digest.hexdigest()


def made_by(job: Job) -> dict[str, str]:
    """Return what a record's diagnosis is made by and from: hashes of all of it."""
    return {
        "coupled": coupled.__version__,
        "sources_sha256": version_hash(),
        "record_sha256": sha256(job.record),
        "rig": job.rig.stem,
        "rig_sha256": sha256(job.rig),
        "control": job.control or "all",
    }


def known_row(job: Job, made: Mapping[str, str]) -> Row | None:
    """Return the row of an undamaged diagnosis by the same inputs and version; else None."""
    try:
        known = read_json(job.out, "a diagnosis is wanted")
        row = Row.of(known, job)
    except InputError:
        return None
    return row if known.get("made") == made and known.get("format") == FORMAT else None


def answer(
    number: int, rig: Rig, name: str, record: Record, control: ControlName | None
) -> tuple[int, str, dict[str, Any]]:
    """Return a job's number, the version that did it, and the JSON of the diagnosis.

    Needs no file, so that any machine can do it. A diagnosis that is refused or fails has a verdict
    for that.
    """
    try:
        document = diagnose(rig, {name: record}, control, workers=1).as_dict()
    except Exception as error:
        # A defect of the diagnosis is said in this record's file, and the others go on.
        document = _nothing(error)
    return number, version_hash(), document


def _nothing(error: Exception) -> dict[str, Any]:
    """Return the JSON of a record that was refused, or whose diagnosis failed."""
    why = f"{type(error).__name__}: {error}"
    head: dict[str, Any] = {"format": FORMAT, "verdict": "failed", "why": why}
    if isinstance(error, InputError):
        head |= {"verdict": "refused", "why": f"{error.key}: {error.problem}".lstrip(": ")}
    return head | {"stages": {}, "effects": [], "rivals": [], "shrink": {}}


def run_all(todo: list[Job], progress: Progress, workers: int = 0, cluster: str = "") -> list[Row]:
    """Diagnose all records on all cores, or a dask cluster; the numbers are those of one core.

    Each diagnosis is written here as soon as it is made. Raises InputError, also if a cluster's
    workers have another version of this package.
    """
    found: dict[int, Row] = {}
    made = {number: made_by(job) for number, job in enumerate(todo)}

    def keep(number: int, answered: Mapping[str, Any]) -> None:
        job = todo[number]
        document = {"record": job.name, **answered, "made": made[number]}
        write_text(job.out, json_text(document, indent=1))
        found[number] = Row.of(document, job)
        progress(job.name, len(found), len(todo))

    def calls() -> Iterator[tuple[int, Rig, str, Record, ControlName | None]]:
        for number, job in enumerate(todo):
            row = known_row(job, made[number])
            if row is not None:
                found[number] = row
                continue
            try:
                rig, record = read_rig(job.rig), read_record(job.record)
            except InputError as error:
                keep(number, _nothing(error))
                continue
            yield number, rig, str(job.record), record, job.control

    with executor(cores(workers), cluster) as pool:
        for number, version, document in as_done(pool, answer, calls(), _AHEAD * cores(workers)):
            if version != version_hash():
                problem = "its workers have another version of coupled than this machine"
                raise InputError("--cluster", "", problem)
            keep(number, document)
    return [found[number] for number in range(len(todo))]
