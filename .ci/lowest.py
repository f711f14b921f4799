"""Print the lower bounds of pyproject.toml as constraints for pip: name==version."""

import re
import tomllib
from pathlib import Path

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text("utf-8"))[
    "project"
]

wanted = [*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["dev"]]
print("\n".join(sorted({re.sub(">=", "==", each) for each in wanted})))
