"""``robotd drivers``: lists the drivers that a robot.toml can name, and who brings them."""

from __future__ import annotations

import argparse
from collections import Counter
from importlib import metadata

from robot.drivers.registry import OURS, SERVOS, installed, load

HELP = "list the drivers that robot.toml can name: ours, and those of other distributions"

TABLES = ("servos", "accelerometer", "touch", "distance", "daq")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """There are no options."""
    del parser


def run(options: argparse.Namespace) -> int:
    """Prints a line for each driver; 1 if there is one that cannot be used."""
    del options
    drivers = sorted(installed(), key=_place)
    offers = Counter((point.group, point.name) for point in drivers)
    has_unusable = False
    for point in drivers:
        state, usable = _about(point)
        if offers[point.group, point.name] > 1 and point.dist is not None:
            usable = False
            is_ours = point.name in OURS[point.group]
            state = f"not used: {'the name is ours' if is_ours else 'offered twice'}"
        has_unusable |= not usable
        table, name = _table_and_name(point)
        dist = point.dist or metadata.distribution("bodyschema")
        print(f"[{table}]".ljust(16) + f"{name:<12} {state:<24} {dist.name} {dist.version}")
    return int(has_unusable)


def _about(point: metadata.EntryPoint) -> tuple[str, bool]:
    """What a driver calls its device, or why it cannot be used; and whether it can."""
    try:
        return str(load(point).name), True
    except (ImportError, AttributeError) as error:
        return f"{point.value} {error}", False


def _table_and_name(point: metadata.EntryPoint) -> tuple[str, str]:
    """The table of ``robot.toml`` that a driver serves, and its name there."""
    table, _, name = point.name.partition(".")
    return ("servos", point.name) if point.group == SERVOS else (table, name)


def _place(point: metadata.EntryPoint) -> tuple[int, str]:
    table, _ = _table_and_name(point)
    return TABLES.index(table) if table in TABLES else len(TABLES), table
