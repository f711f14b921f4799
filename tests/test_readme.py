"""Every command and every output printed in the README, run and compared.

`python -m tests.test_readme` writes the outputs anew after a change that is meant.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path

import pytest

from tests.support.benchmarks import SENTENCES
from tests.support.commands import ROOT, coupled

README = ROOT / "README.md"
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
    """Give a folder the files that the README's commands name."""
    for source in ("tests/data/typo.toml", "tests/data/loose.toml"):
        (folder / Path(source).name).write_bytes((ROOT / source).read_bytes())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("readme")
    prepare(path)
    return path


@pytest.mark.parametrize(("command", "output"), sessions(README.read_text(encoding="utf-8")))
def test_a_command_prints_what_the_readme_says(command: str, output: str, folder: Path) -> None:
    assert run(command, folder) == trimmed(output)


def test_the_python_example_prints_what_it_says(folder: Path) -> None:
    [(code, output)] = PYTHON.findall(README.read_text(encoding="utf-8"))
    assert run_python(code, folder) == trimmed(output)


def test_the_pictures_and_pages_that_the_readme_shows_are_there() -> None:
    text = README.read_text(encoding="utf-8")
    for target in [*re.findall(r"\]\(([^)#:]+)\)", text), *re.findall(r'src="([^"]+)"', text)]:
        assert (ROOT / target).exists(), target


MEASURED = r"(<!-- {name} -->\n)(.*?)(\n<!-- end -->)"


@pytest.mark.parametrize("name", list(SENTENCES))
def test_the_measured_figures_are_those_that_a_benchmark_kept(name: str) -> None:
    found = re.search(MEASURED.format(name=name), README.read_text(encoding="utf-8"), re.S)
    assert found is not None
    assert " ".join(found.group(2).split()) == SENTENCES[name]()


def with_measured(text: str) -> str:
    """Return the README with the benchmarks' sentences anew."""
    for name, sentence in SENTENCES.items():
        lines = "\n".join(textwrap.wrap(sentence(), 110, break_on_hyphens=False))
        head, end = f"<!-- {name} -->\n", "\n<!-- end -->"
        before, _, after = text.partition(head)
        text = before + head + lines + end + after.partition(end)[2]
    return text


def refresh() -> None:
    """Write the README's outputs anew."""
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

        text = BLOCK.sub(block, README.read_text(encoding="utf-8"))
        text = PYTHON.sub(example, text)
        text = with_measured(text)
        README.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    refresh()
