"""``robotd new``: writes a commented ``robot.toml`` for a set of electronics and its servos."""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Final

from protocol.text import command_line
from protocol.wire.field_checks import MAX_NAME
from robot.configuration.robot_config import load_config
from robot.errors import ConfigError

HELP = "write a commented robot.toml for a robot of your own"
MOST_JOINTS: Final = 24  # of a file that is written here; robot.toml may name more
_PLACE: Final = r"^(output|channel) = (\d+)"


@dataclass(frozen=True, kw_only=True)
class ElectronicsSet:
    """What a set of electronics changes in ``robot/robot.toml``.

    Attributes:
        tables: Name of the file whose tables replace those of ``robot.toml``, or ``None``.
        most_touch: Most touch sensors that its inputs take.
        chips: By table, the line that names its first board or chip, and how many joints or touch
            sensors fit on one; a further chip has the next number.
    """

    tables: str | None
    most_touch: int
    chips: Mapping[str, tuple[str, int]]


SETS: Final[Mapping[str, ElectronicsSet]] = MappingProxyType(
    {
        "pc104": ElectronicsSet(tables=None, most_touch=24, chips={"servos": ("board = 1", 8)}),
        "pi": ElectronicsSet(
            tables="robot-pi.toml",
            most_touch=16,
            chips={"servos": ("address = 0x40", 16), "daq": ("address = 0x48", 4)},
        ),
    }
)


SERVOS: Final = MappingProxyType(
    {"feetech": "robot-feetech.toml", "dynamixel": "robot-dynamixel.toml"}
)
"""By kind of bus servos, the file whose tables replace those of a set of electronics."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the options."""
    parser.add_argument(
        "--electronics",
        required=True,
        choices=tuple(SETS),
        help="pc104: SV203 on a serial line, DMM-32 and VL6180X; pi: PCA9685, ADS1115, MPU-6050 "
        "and VL6180X on I²C",
    )
    parser.add_argument(
        "--servos",
        choices=tuple(SERVOS),
        help="serial bus servos in the place of the set's own: feetech (STS, SMS), dynamixel (X)",
    )
    parser.add_argument("--name", default="my-robot", help="the robot's name (default %(default)s)")
    parser.add_argument("--joints", type=int, default=8, help="how many (default %(default)s)")
    parser.add_argument("--touch", type=int, default=4, help="touch sensors (default %(default)s)")
    parser.add_argument("file", type=Path, metavar="FILE", help="the robot.toml to write")


def run(options: argparse.Namespace) -> int:
    """Writes the file and says what comes next."""
    file = options.file
    for key, count, least, most in (
        ("--joints", options.joints, 1, MOST_JOINTS),
        ("--touch", options.touch, 0, SETS[options.electronics].most_touch),
    ):
        if not least <= count <= most:
            raise ConfigError(f"must be from {least} to {most}, not {count}.", key=key)
    if not 1 <= len(options.name) <= MAX_NAME:
        raise ConfigError(
            f"must have 1 to {MAX_NAME} characters, not {len(options.name)}.", key="--name"
        )
    text = robot_toml(
        options.electronics,
        servos=options.servos,
        name=options.name,
        joints=options.joints,
        touch=options.touch,
    )
    try:
        with file.open("x", encoding="utf-8") as new_file:
            new_file.write(text)
    except FileExistsError:
        raise ConfigError("exists already; name another file.", file=str(file)) from None
    except OSError as error:
        raise ConfigError(f"cannot be written: {error.strerror}.", file=str(file)) from error
    load_config(file, uncalibrated=True)
    print(f"{file} is written. Say in it what is connected where; then:")
    for command in ("doctor", "calibrate", "run"):
        print(f"  {command_line('robotd', command, '--config', file)}")
    return 0


def robot_toml(
    electronics: str, *, servos: str | None = None, name: str, joints: int, touch: int
) -> str:
    """The text of a ``robot.toml``.

    Args:
        electronics: A key of ``SETS``.
        servos: A key of ``SERVOS``, or ``None`` for the set's own.
        name: Name of the robot.
        joints: Number of joints, at most ``MOST_JOINTS``; on the outputs one after another.
        touch: Number of touch sensors; they are on the inputs one after another.
    """
    kind = SETS[electronics]
    counts = {"joint": joints, "touch": touch}
    example = [(_table_of(block), block) for block in _paragraphs("robot.toml")]
    files = [file for file in (kind.tables, SERVOS.get(servos or "")) if file]
    chosen = {_table_of(block): block for file in files for block in _paragraphs(file)}
    chosen.pop("", None)  # a comment by itself
    text: list[str] = []
    seen: set[str] = set()
    for table, paragraph in example:
        if table in counts and table not in seen:
            rows = [block for other_table, block in example if other_table == table]
            names = [_name(row) for row in rows]
            text += _rows([chosen[table]] if table in chosen else rows, table, names, counts[table])
        elif table not in counts and (touch or table != "daq" or table not in kind.chips):
            text.append(chosen.get(table, paragraph))
        seen.add(table)
    toml = "\n\n".join(text) + "\n"
    for table, (line, per_chip) in kind.chips.items():
        if table == "servos" and servos:
            continue
        chip_count = -(-counts["joint" if table == "servos" else "touch"] // per_chip)
        if chip_count > 1:
            toml = re.sub(
                rf"^{re.escape(line)} *", _chips(line, chip_count), toml, flags=re.MULTILINE
            )
    for old, new in (  # the name last: in it anything may stand
        ("joints = 8", f"joints = {joints}"),
        ("touch_sensors = 4", f"touch_sensors = {touch}"),
        ("# [calibration]\n# file", "[calibration]\nfile"),
        ('name = "quadruped"', f"name = {json.dumps(name, ensure_ascii=False)}"),
    ):
        toml = toml.replace(old, new, 1)
    return re.sub(r" +$", "", toml, flags=re.MULTILINE)


def _paragraphs(file: str) -> list[str]:
    text = resources.files("robot").joinpath(file).read_text(encoding="utf-8")
    return text.strip().split("\n\n")


def _table_of(paragraph: str) -> str:
    """The name of the table that a paragraph writes, or nothing."""
    heading = re.search(r"^\[+(\w+)", paragraph, re.MULTILINE)
    return heading[1] if heading else ""


def _name(paragraph: str) -> str:
    return str(re.findall(r'^name = "(.+)"', paragraph, re.MULTILINE)[0])


def _rows(like: Sequence[str], table: str, names: Sequence[str], count: int) -> Iterator[str]:
    """``count`` tables like some others, on outputs or inputs one after another."""
    row_names = names if count == len(names) else [f"{table}_{n}" for n in range(1, count + 1)]
    first_place = int(re.findall(_PLACE, like[0], re.MULTILINE)[0][1])
    for index, name in enumerate(row_names):
        row = like[index] if count == len(like) else like[0]
        row = re.sub(r'^name = ".+"', f'name = "{name}"', row, flags=re.MULTILINE)
        row = re.sub(_PLACE, rf"\1 = {first_place + index}", row, flags=re.MULTILINE)
        # The comment above the first is enough.
        yield re.sub(r"^#.*\n", "", row, flags=re.MULTILINE) if index else row


def _chips(line: str, count: int) -> str:
    """Rewrites a line that names one chip for ``count`` of them."""
    key, _, number = line.partition(" = ")
    first = int(number, 0)
    template = "{:#x}" if "0x" in number else "{}"
    return f"{key} = [{', '.join(template.format(first + n) for n in range(count))}] "
