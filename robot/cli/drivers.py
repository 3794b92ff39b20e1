"""``robotd drivers``: lists the drivers that a robot.toml can name, and who brings them."""

from __future__ import annotations

import argparse
from collections import Counter

from robot.drivers.registry import InstalledDriver, installed, load

HELP = "list the drivers that robot.toml can name: ours, and those of other distributions"

TABLES = ("servos", "accelerometer", "touch", "distance", "daq")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """There are no options."""
    del parser


def run(options: argparse.Namespace) -> int:
    """Prints a line for each driver; 1 if there is one that cannot be used."""
    del options
    drivers = sorted(installed(), key=lambda one: (_place(one.table), one.table))
    offers = Counter((entry.table, entry.name) for entry in drivers)
    ours = {
        (entry.table, entry.name) for entry in drivers if entry.point.value.startswith("robot.")
    }
    has_unusable = False
    for entry in drivers:
        state, usable = _about(entry)
        key = (entry.table, entry.name)
        if offers[key] > 1 and not entry.point.value.startswith("robot."):
            usable = False
            state = "not used: the name is ours" if key in ours else "not used: offered twice"
        has_unusable |= not usable
        print(f"[{entry.table}]".ljust(16) + f"{entry.name:<12} {state:<24} {entry.distribution}")
    return int(has_unusable)


def _about(driver: InstalledDriver) -> tuple[str, bool]:
    """What a driver calls its device, or why it cannot be used; and whether it can."""
    try:
        return str(load(driver.point).name), True
    except (ImportError, AttributeError) as error:
        return f"{driver.point.value} {error}", False


def _place(table: str) -> int:
    return TABLES.index(table) if table in TABLES else len(TABLES)
