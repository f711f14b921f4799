"""Every command and every output printed in the README and the guides, run and compared.

`python -m tests.test_pages` writes the outputs anew after a change that is meant;
`python -m tests.test_pages PAGE…` those of some pages.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path
from typing import Any

import pytest

from tests.support.benchmarks import SENTENCES
from tests.support.commands import ROOT, coupled

README = ROOT / "README.md"
PAGES = [README, *sorted((ROOT / "docs" / "guides").glob("*.md"))]
BLOCK = re.compile(r"^```console\n(.*?)^```$", re.M | re.S)
PYTHON = re.compile(r"^```python\n(.*?)^```\n+prints\n+```text\n(.*?)^```$", re.M | re.S)


def sessions(text: str) -> list[tuple[str, str]]:
    """Return the (command, output) pairs of the console blocks, in their order."""
    pairs = []
    for block in BLOCK.findall(text):
        for part in re.split(r"^\$ ", block, flags=re.M)[1:]:
            command, _, output = part.partition("\n")
            pairs.append((command, output))
    return pairs


def run(command: str, folder: Path) -> str:
    """Return what a command prints, as on a terminal of 80 columns."""
    words = shlex.split(command)
    assert words[0] == "coupled"
    done = coupled(folder, *words[1:])
    return trimmed(done.stdout + done.stderr)


def run_python(code: str, folder: Path) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, cwd=folder, capture_output=True, text=True
    )
    return trimmed(done.stdout)


def trimmed(text: str) -> str:
    return "".join(line.rstrip() + "\n" for line in text.rstrip().splitlines())


def prepare(folder: Path) -> None:
    """Give a folder the files that the pages' commands name."""
    for name in ("typo.toml", "floor.csv", "yoke-readings.csv", "JSBout.csv"):
        (folder / name).write_bytes((ROOT / "tests" / "data" / name).read_bytes())


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[Path, Path]:
    """Return a folder for each page: its commands go on with one another's files."""
    made = {page: tmp_path_factory.mktemp(page.stem) for page in PAGES}
    for folder in made.values():
        prepare(folder)
    return made


def everything_printed() -> list[Any]:
    return [
        pytest.param(page, command, output, id=f"{page.stem}-{command}")
        for page in PAGES
        for command, output in sessions(page.read_text(encoding="utf-8"))
    ]


@pytest.mark.parametrize(("page", "command", "output"), everything_printed())
def test_a_command_prints_what_the_page_says(
    page: Path, command: str, output: str, folders: dict[Path, Path]
) -> None:
    assert run(command, folders[page]) == trimmed(output)


def test_what_a_new_user_does_takes_six_commands_at_most() -> None:
    for page in PAGES:
        for block in BLOCK.findall(page.read_text(encoding="utf-8")):
            assert len(re.findall(r"^\$ ", block, re.M)) <= 6, page


EXAMPLES = [
    pytest.param(page, code, output, marks=[pytest.mark.slow] if page == README else [])
    for page in PAGES
    for code, output in PYTHON.findall(page.read_text(encoding="utf-8"))
]


@pytest.mark.parametrize(("page", "code", "output"), EXAMPLES)
def test_a_python_example_prints_what_it_says(
    folders: dict[Path, Path], page: Path, code: str, output: str
) -> None:
    assert run_python(code, folders[page]) == trimmed(output)


def test_readme_and_a_guide_have_python_examples() -> None:
    assert len(EXAMPLES) >= 2


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_pictures_and_pages_that_a_page_shows_are_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in [*re.findall(r"\]\(([^)#:]+)\)", text), *re.findall(r'src="([^"]+)"', text)]:
        assert (page.parent / target).exists(), target


MEASURED = r"(<!-- {name} -->\n)(.*?)(\n<!-- end -->)"


@pytest.mark.parametrize("name", list(SENTENCES))
def test_the_measured_figures_are_those_that_a_benchmark_kept(name: str) -> None:
    found = [
        (page, match.group(2))
        for page in PAGES
        for match in re.finditer(MEASURED.format(name=name), page.read_text(encoding="utf-8"), re.S)
    ]
    assert found
    for page, text in found:
        assert " ".join(text.split()) == on_page(SENTENCES[name](), page)


def on_page(sentence: str, page: Path) -> str:
    """Return a sentence with its links as they are from a page."""
    return sentence if page == README else sentence.replace("](docs/", "](../")


def with_measured(text: str, page: Path) -> str:
    """Return a page with the benchmarks' sentences anew, where it has their place."""
    for name, sentence in SENTENCES.items():
        lines = "\n".join(textwrap.wrap(on_page(sentence(), page), 110, break_on_hyphens=False))
        head, end = f"<!-- {name} -->\n", "\n<!-- end -->"
        before, found, after = text.partition(head)
        if found:
            text = before + head + lines + end + after.partition(end)[2]
    return text


def refresh(page: Path) -> None:
    """Write a page's outputs anew."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        prepare(folder)

        def block(match: re.Match[str]) -> str:
            parts = [
                f"$ {command}\n{run(command, folder)}" for command, _ in sessions(match.group(0))
            ]
            return "```console\n" + "\n".join(parts) + "```"

        def example(match: re.Match[str]) -> str:
            code, output = match.groups()
            return match.group(0).replace(output, run_python(code, folder))

        text = BLOCK.sub(block, page.read_text(encoding="utf-8"))
        text = PYTHON.sub(example, text)
        text = with_measured(text, page)
        page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    for each in [Path(name).resolve() for name in sys.argv[1:]] or PAGES:
        refresh(each)
