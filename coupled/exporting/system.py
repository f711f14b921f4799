"""A JSBSim `<system>`: properties that may be set, and components in their order of execution."""

from __future__ import annotations

from collections.abc import Sequence
from xml.sax.saxutils import escape, quoteattr

from coupled.exporting.expression import Expr, Value, as_expr, prop


class System:
    """One system file. `at` is the path of its properties, for example coupled/column."""

    def __init__(self, name: str, at: str) -> None:
        self.name, self.at = name, at
        self._declared: list[str] = []
        self._body: list[str] = []
        self.documented: dict[str, str] = {}
        self._open = False

    def declare(self, name: str, value: float, what: str) -> Expr:
        """Declare a property that the user may set, and return it; `what` describes it."""
        path = f"{self.at}/{name}"
        self._declared.append(f'  <property value="{value!r}">{path}</property>  {_comment(what)}')
        self.documented[path] = what
        return prop(path)

    def channel(self, name: str, says: str = "") -> None:
        """Begin a channel: the components of one stage."""
        self._close()
        self._body += ["", *([f"  {_comment(says)}"] if says else [])]
        self._body.append(f"  <channel name={quoteattr(f'{self.name}: {name}')}>")
        self._open = True

    def own(self, name: str) -> Expr:
        """Return a component's value: of this run if it comes earlier, else of the last run."""
        return prop(f"{self.at}/{name}")

    def add(self, name: str, value: Value, says: str = "", output: str = "", out: str = "") -> Expr:
        """Add a component with this value, and return its property.

        `says` is a comment in the file, `out` its text in the list of outputs; `output` is a
        further property that takes the value.
        """
        path = f"{self.at}/{name}"
        if says or out:
            shown = [f"gives: {out}"] if out else []
            self._body.append(f"    {_comment('. '.join([*shown, *([says] if says else [])]))}")
        self._body.append(f'    <fcs_function name="{path}">')
        self._body.append("      <function>")
        self._body += as_expr(value).lines("        ")
        self._body.append("      </function>")
        if output:
            self._body.append(f"      <output>{output}</output>")
        self._body.append("    </fcs_function>")
        if out:
            self.documented[path] = out
        return prop(path)

    def _close(self) -> None:
        if self._open:
            self._body.append("  </channel>")
        self._open = False

    def text(self, head: Sequence[str]) -> str:
        """Return the system's file; `head` describes it, line by line."""
        self._close()
        said = "\n".join(f"  {line}" for line in head)
        lines = ['<?xml version="1.0"?>', f"<!--\n{said.replace('--', '- -')}\n-->"]
        lines += [f"<system name={quoteattr(self.name)}>", "", *self._declared, *self._body]
        return "\n".join([*lines, "</system>", ""])


def _comment(text: str) -> str:
    return f"<!-- {escape(text.replace('--', '- -'))} -->"
