"""The layout of a text log: its delimiter, and the lines of its header and its numbers."""

from __future__ import annotations

import csv
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import chain
from pathlib import Path
from typing import Literal

from coupled.errors import InputError
from coupled.files import read_bytes
from coupled.record.importing.mapping import Layout
from coupled.record.importing.reading import FORMATS, text_of
from coupled.units import usual_unit

LOOKED_AT = 400  # lines from which the layout is guessed
COMMENTS = ("#", "%", "//", "*")
DELIMITERS = ("\t", ";", ",", " ")  # a semicolon before a comma, which may be the decimal mark
MOST_WORDS = 5
_NUMBER = re.compile(r"[-+\u2212]?(\d+[.,]?\d*|[.,]\d+)([eE][-+\u2212]?\d+)?")
_COMMA = re.compile(r"[-+\u2212]?\d*,\d+([eE][-+\u2212]?\d+)?")
_STAMP = re.compile(r"\d.*\d:\d\d|\d:\d\d")  # the first cell of a row without a header
_THOUSANDS = re.compile(r"[-+\u2212]?[1-9]\d{0,2},\d{3}")


def guess_layout(path: Path) -> Layout:
    """Return the layout of a log; the default one if its format is not text."""
    if FORMATS.get(path.suffix.lower(), "csv") != "csv":
        return Layout()
    encoding, text = _decoded(path, read_bytes(path))
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")[:LOOKED_AT]
    comment = next((mark for mark in COMMENTS if any(s.startswith(mark) for s in lines)), "")
    rows = [
        (number, line)
        for number, line in enumerate(lines)
        if line.strip() and not (comment and line.lstrip().startswith(comment))
    ]
    if len(rows) < 3:
        raise InputError(path, "", "has fewer than three rows: too few to propose a map")
    delimiter, width = _delimiter([line for _, line in rows], path)
    cells = [_split(line, delimiter) for _, line in rows]
    first = next(i for i, row in enumerate(cells) if len(row) == width)
    skipped = rows[first][0] if not comment else _skipped(rows[first][0], lines, comment)
    cells = cells[first:]
    header = not all(is_number(cell) or not cell or _STAMP.match(cell) for cell in cells[0])
    units_row = header and units_in(cells[1]) > 0 and any(map(is_number, chain(*cells[2:5])))
    below = cells[(2 if units_row else 1) if header else 0 :]
    numbers = (i for i, row in enumerate(below) if any(map(is_number, row)))
    below = below[next(numbers, 0) :]  # without further rows of the header
    found = {cell for row in below for cell in row if is_number(cell)}
    commas = {cell for cell in found if _COMMA.fullmatch(cell)}
    if delimiter == ",":  # of quoted cells, which may have commas between thousands
        points = any("." in cell for cell in found)
        commas = set() if points else {cell for cell in commas if not _THOUSANDS.fullmatch(cell)}
    return Layout(
        delimiter=delimiter,
        decimal="," if commas else ".",
        comment=comment,
        skip_rows=skipped,
        header=header,
        units_row=units_row,
        missing=_missing(below, width),
        encoding=encoding,
    )


def is_number(cell: str) -> bool:
    """Tell whether a cell holds one number, with a decimal point or comma."""
    return _NUMBER.fullmatch(cell.strip()) is not None


def _decoded(path: Path, content: bytes) -> tuple[Literal["utf-8", "latin-1", "utf-16"], str]:
    encoding: Literal["utf-8", "latin-1", "utf-16"] = "utf-8"
    if content[:2] in (BOM_UTF16_LE, BOM_UTF16_BE) or b"\0" in content[:2]:
        encoding = "utf-16"
    else:
        try:
            content.decode()
        except UnicodeError:
            encoding = "latin-1"
    return encoding, text_of(path, content, encoding)


def _split(line: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return line.split()
    try:
        cells = next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error:  # a quote that nothing closes, before very many cells
        cells = line.split(delimiter)
    return [cell.strip() for cell in cells]


def _delimiter(lines: Sequence[str], path: Path) -> tuple[str, int]:
    """Return the delimiter, and the number of columns, which is equal in nearly every row."""
    tail = lines[len(lines) // 3 :]
    for delimiter in DELIMITERS:
        widths = Counter(len(_split(line, delimiter)) for line in tail)
        width, times = widths.most_common(1)[0]
        if width > 1 and times >= 0.9 * len(tail):
            return delimiter, width
    raise InputError(path, "", "has no columns that a tab, semicolon, comma or space sets apart")


def _skipped(row: int, lines: Sequence[str], comment: str) -> int:
    """Return the number of lines to skip before a row, without comments."""
    others = [i for i in range(row) if lines[i].strip() and not lines[i].startswith(comment)]
    return row if others else 0


def units_in(row: Iterable[str]) -> int:
    """Return the number of units in a row; 0 if it has numbers."""
    words = [cell for cell in row if cell]
    if any(is_number(cell) and cell != "1" for cell in words):
        return 0
    return sum(bool(usual_unit(cell)) and not is_number(cell) for cell in words)


def _missing(rows: Sequence[Sequence[str]], width: int) -> list[str]:
    """Return the words in columns of numbers."""
    words: Counter[str] = Counter()
    for place in range(width):
        column = [row[place] for row in rows if len(row) == width and row[place]]
        numbers = sum(map(is_number, column))
        if column and 0.5 * len(column) < numbers < len(column):
            words.update(cell for cell in column if not is_number(cell))
    return [word for word, _ in words.most_common(MOST_WORDS)]
