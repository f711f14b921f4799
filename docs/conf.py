"""The site: the Markdown that is here, the notebooks run, and the package's own docstrings.

    sphinx-build -W --keep-going -b html docs out/site

A Markdown file links to its neighbours as a reader of the repository needs them. What lies outside
this folder is linked here to the page that includes it, or offered as a file.
"""

from __future__ import annotations

import os
import re
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent

project = "coupled"
author = "The coupled authors"
project_copyright = author
release = version = version_of("coupled")

extensions = ["myst_nb", "sphinx.ext.autodoc"]
myst_enable_extensions = ["html_image"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 600
nb_execution_excludepatterns: list[str] = []
nb_output_stderr = "remove"  # progress
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_format = "short"
default_role = "literal"  # docstrings put code in single backquotes
highlight_language = "none"
html_theme = "furo"
html_title = f"coupled {release}"
html_show_copyright = False
html_copy_source = False

# Pages that hold what lies outside this folder.
HELD = {
    ROOT / "README.md": "index.md",
    ROOT / "CONTRIBUTING.md": "contributing.md",
    ROOT / "CHANGELOG.md": "changelog.md",
    ROOT / "aircraft" / "README.md": "aircraft.md",
}
_LINK = re.compile(r"\[([^\]\[]*)\]\(([^()\s#]+)(#[^()\s]*)?\)")
_IMAGE = re.compile(r'(<img src=")([^"]+)(")')


def relinked(text: str, where: Path, page: Path) -> str:
    """Return Markdown of a file in the folder `where` as a page in the folder `page` links."""

    def link(match: re.Match[str]) -> str:
        label, target, anchor = match[1], (where / match[2]).resolve(), match[3] or ""
        if not target.exists():
            return match[0]
        if target in HELD:
            return f"[{label}]({os.path.relpath(DOCS / HELD[target], page)}{anchor})"
        if target.is_dir():
            return label  # the site has no folders
        anchor = anchor if target.is_relative_to(DOCS) else ""  # a file has no lines to go to
        return f"[{label}]({os.path.relpath(target, page)}{anchor})"

    def image(match: re.Match[str]) -> str:
        return match[1] + os.path.relpath((where / match[2]).resolve(), page) + match[3]

    return _IMAGE.sub(image, _LINK.sub(link, text))


def read_page(app: Any, name: str, source: list[str]) -> None:
    """Relink a page of this folder."""
    folder = (DOCS / name).parent
    source[0] = relinked(source[0], folder, folder)


def read_included(app: Any, relative: Path, parent: str, source: list[str]) -> None:
    """Relink a file that a page includes."""
    file = (DOCS / relative).resolve()
    source[0] = relinked(source[0], file.parent, (DOCS / parent).parent)


def read_docstring(
    app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]
) -> None:
    """Make plain text, as a terminal shows it, of docstrings: aligned lines stay as they are."""
    paragraphs = "\n".join(lines).strip("\n").split("\n\n")
    lines[:] = "\n\n".join(_set(paragraph) for paragraph in paragraphs).splitlines()


def _set(paragraph: str) -> str:
    rows = paragraph.strip("\n").splitlines()
    if rows and rows[0].lstrip().startswith(">>>"):
        return "\n".join(row.strip() for row in rows)
    if any(row.startswith(" ") or re.search(r"\S {2,}\S", row) for row in rows):
        return "\n".join(["::", "", *(f"    {row}" for row in rows)])
    words = re.split(r"(`[^`]*`)", "\n".join(rows))
    return "".join(w if w.startswith("`") else re.sub(r"([*|]|_\b)", r"\\\1", w) for w in words)


def setup(app: Any) -> dict[str, bool]:
    """Register what reads pages and docstrings."""
    app.connect("source-read", read_page)
    app.connect("include-read", read_included)
    app.connect("autodoc-process-docstring", read_docstring)
    return {"parallel_read_safe": True}
