"""How tables look in a terminal."""

from __future__ import annotations

from rich.console import JustifyMethod
from rich.table import Table


def plain_table(*columns: str, justify: JustifyMethod = "right") -> Table:
    """A table without lines, with bold headings; the first column is flush left."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    for index, column in enumerate(columns):
        table.add_column(column, justify="left" if index == 0 else justify)
    return table
