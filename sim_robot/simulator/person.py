"""A simulated person at the terminal: answers a guided session, or lends hands to a real one.

What this person knows comes from the world, never from the electronics or their calibration: the
angle that a protractor shows, which side is up, the weight on a foot, the height of a plate.
``sim-robotd --console`` lets a real person rehearse ``doctor``, ``calibrate`` and ``try``.
"""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Callable, Collection, Sequence
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np

from protocol.errors import BodyschemaError
from protocol.text import command_line
from robot.calibration.joints import MAX_STEP
from robot.calibration.questions import Console
from robot.cli.calibrate import calibrate
from robot.cli.doctor import print_findings
from robot.configuration.robot_config import RobotConfig, with_calibration
from robot.devices import Devices, open_devices
from robot.diagnosis.doctor import Doctor
from robot.errors import CommandError
from robot.trial.keyboard import keyboard
from robot.trial.session import Trial
from sim_robot.faults.fault_panel import FaultSpec
from sim_robot.simulator.daemon import Emulation

HELP: Final = """\
  doctor [--move]      looks at each device, joint and sensor, as robotd doctor does
  calibrate [--only NAME …]
                       the guided session, whole or by parts; the simulated hands help
  try [--limp]         one joint by hand, every sensor live
  stand, ground        put the robot on a stand, or on its belly
  fault SPEC, mend     break something (sim-robotd --help lists what), and mend it all
  quit"""

PROTRACTOR: Final = 0.2  # degrees: the worst error of one reading, rounding to 0.1° included
UNEVEN: Final = 1.5  # degrees: how far a body in the hands leans, at most, about each axis
PLATE_MM: Final = 150
WEIGHT_G: Final = 200
STAND: Final = 2.0  # m

_SPACING: Final = 40  # counts between measured angles
_MIN_SPACING: Final = 10  # counts below which two angles say little
_MAX_SLOPE: Final = 0.9  # degrees a count; no servo turns further
_SETTLING_TIME: Final = 0.5  # s until what was moved by hand, or by a servo, is still
_CREEPING: Final = 0.05  # degrees in that time

_UP: Final = MappingProxyType(
    {
        "nose up": (1.0, 0.0, 0.0),
        "nose down": (-1.0, 0.0, 0.0),
        "left side up": (0.0, 1.0, 0.0),
        "left side down": (0.0, -1.0, 0.0),
        "upright": (0.0, 0.0, 1.0),
        "upside down": (0.0, 0.0, -1.0),
    }
)


class SimulatedPerson:
    """Sits at the terminal of a guided session, with the simulated body at hand.

    Args:
        parts: The body, and the electronics over it; handling takes time on their clock, and their
            noise is drawn anew whenever the body is put somewhere.
        seed: Seed of this person's own errors.
        echo: Called with everything that is said and answered.
    """

    def __init__(self, parts: Emulation, *, seed: int, echo: Callable[[str], None]):
        self._parts = parts
        self._body = parts.body
        self._world = parts.world
        self._noise = parts.noise
        self._clock = parts.clock
        self._rng = np.random.default_rng(seed)
        self._echo = echo
        self._placements = 0
        self._counts = parts.config.servos.counts
        self._joint = _Joint(self._counts)
        self._answers: tuple[tuple[str, Callable[[re.Match[str]], str]], ...] = (
            ("instrument between", lambda _: "skip"),  # there is none
            ("on the stand", lambda _: self._hold(STAND)),
            (r"(?P<name>.+) is limp; hold it", lambda _: ""),
            (r"(?P<name>.+): limp, count \d+, was ", lambda _: "hold"),
            (r"(?P<name>.+): count (?P<count>\d+), was .* measured", self._at_a_count),
            (r"(?P<name>.+) at its new 0°", self._at_zero),
            ("accelerometer: six", lambda _: "six"),
            (r"(?P<position>.+), hold it still", self._in_position),
            (r"(?P<name>.+) free of any load", lambda _: self._hold(STAND)),
            (r"(?P<name>.+) with a known load", self._loaded),
            ("distance: Enter", lambda _: ""),
            ("belly flat on the ground", lambda _: self._lay_down()),
            ("height of a plate", lambda _: str(PLATE_MM)),
            (r"plate at (?P<height>\d+) mm", lambda at: self._hold(float(at["height"]) / 1000)),
            ("write this", lambda _: "yes"),
        )

    def calibrate(self, devices: Devices, file: Path, only: Collection[str] = ()) -> None:
        """Goes through the session of ``robotd calibrate``.

        Args:
            devices: Drivers on the electronics.
            file: The calibration file; if it exists, its values are where the session begins.
            only: What to calibrate; empty for everything.

        Raises:
            AbandonedError: This person was refused; the file has what was measured before.
        """
        config, stored = with_calibration(self._parts.config, file)
        calibrate(config, stored, devices, clock=self._clock, terminal=self, file=file, only=only)

    def say(self, text: str) -> None:
        """Shows the text to ``echo``."""
        self._echo(text)

    def ask(self, prompt: str) -> str:
        """Does what is asked for, and answers.

        Raises:
            CommandError: This person does not know the prompt.
        """
        answer = self._handle(prompt)
        if answer is None:
            raise CommandError(f"the simulated person does not understand {prompt!r}")
        self._echo(f"{prompt} > {answer}")
        return answer

    def _handle(self, prompt: str) -> str | None:
        """Does what is asked for; returns the answer, ``None`` to a question nobody foresaw."""
        for pattern, act in self._answers:
            match = re.match(pattern, prompt)
            if match is not None:
                return act(match)
        return None

    def _in_position(self, match: re.Match[str]) -> str:
        lean = np.tan(np.radians(self._rng.uniform(-UNEVEN, UNEVEN, 3)))
        up = [u or float(slope) for u, slope in zip(_UP[match["position"]], lean, strict=True)]
        length = math.hypot(*up)
        return self._hold(STAND, tuple(u / length for u in up))

    def _loaded(self, match: re.Match[str]) -> str:
        for name in self._body.touch:
            self._world.press(name, WEIGHT_G * 9.81e-3 if name == match["name"] else 0.0)
        self._clock.sleep(_SETTLING_TIME)
        return f"{WEIGHT_G} g"

    def _at_zero(self, match: re.Match[str]) -> str:
        return f"{self._protractor(self._index(match['name'])):.1f}"

    def _at_a_count(self, match: re.Match[str]) -> str:
        if self._joint.name != match["name"]:
            self._joint = _Joint(self._counts, match["name"])
        index = self._index(match["name"])
        motor = self._body.motors[index]
        limits = math.degrees(motor.lower), math.degrees(motor.upper)
        return self._joint.next(int(match["count"]), self._protractor(index), limits)

    def _index(self, name: str) -> int:
        return [motor.name for motor in self._body.motors].index(name)

    def _protractor(self, index: int) -> float:
        """The angle of a joint, degrees, as a person reads it."""
        self._clock.sleep(_SETTLING_TIME)
        angle, previous = self._angle(index), math.inf
        while abs(angle - previous) > _CREEPING:  # a servo that was off may have come a long way
            self._clock.sleep(_SETTLING_TIME)
            angle, previous = self._angle(index), angle
        max_error = PROTRACTOR - 0.05
        return round(angle + float(self._rng.uniform(-max_error, max_error)), 1)

    def _angle(self, index: int) -> float:
        return math.degrees(self._world.angles()[index])

    def _hold(self, height: float, up: tuple[float, ...] = _UP["upright"]) -> str:
        self._world.hold(height, up)
        return self._settled()

    def _lay_down(self) -> str:
        self._world.lay_down()
        return self._settled()

    def _settled(self) -> str:
        """The answer, Enter alone, once the body is still."""
        self._placements += 1
        self._noise.begin(self._placements)
        self._clock.sleep(_SETTLING_TIME)
        return ""


class Rehearsal(SimulatedPerson):
    """Simulated hands for a real person at the keyboard.

    They do what a question asks for, if they know how, and say what is to be seen; the person types
    the answer.
    """

    def ask(self, prompt: str) -> str:
        """Handles the body, and reads a line from standard input."""
        answer = self._handle(prompt)
        if answer:
            self.say(f"  (simulated: {answer})")
        return Console().ask(prompt)

    def _at_a_count(self, match: re.Match[str]) -> str:
        return f"the protractor shows {self._protractor(self._index(match['name'])):.1f}°"


class _Joint:
    """The order in which one joint is measured: up to its end, then down to the other one."""

    def __init__(self, counts: range, name: str = ""):
        self.name = name
        self._counts = counts
        self._points: dict[int, float] = {}
        self._direction = 1
        self._marked_ends: set[str] = set()
        self._finished = False

    def next(self, count: int, angle: float, limits: tuple[float, float]) -> str:
        """Answer at a count where the protractor shows ``angle``; angle and limits in degrees."""
        nearest = min((abs(count - measured) for measured in self._points), default=_SPACING)
        steps = self._steps(count, angle, limits)
        if nearest >= (_SPACING if steps else _MIN_SPACING):
            self._points[count] = angle
            return f"{angle:.1f}"
        if steps:
            return f"{'u' if self._direction > 0 else 'd'} {steps}"
        end = self._end(angle, limits)
        if end is not None and end not in self._marked_ends:
            self._marked_ends.add(end)
            return end
        if self._direction > 0:
            self._direction = -1
            return self.next(count, angle, limits)
        if self._finished:
            return "q"  # it was refused: better ask somebody
        self._finished = True
        return "done"

    def _steps(self, count: int, angle: float, limits: tuple[float, float]) -> int:
        """Number of counts that are safe and possible in the present direction."""
        room = limits[1] - angle, angle - limits[0]
        points = sorted(self._points.items())
        if len(points) < 2:
            degrees_left = min(room)
        else:
            rises = (points[-1][1] > points[0][1]) == (self._direction > 0)
            degrees_left = room[0] if rises else room[1]
        counts = self._counts[-1] - count if self._direction > 0 else count - self._counts[0]
        return max(0, min(MAX_STEP, counts, int(degrees_left / _MAX_SLOPE)))

    @staticmethod
    def _end(angle: float, limits: tuple[float, float]) -> str | None:
        if abs(angle - limits[0]) < 2 * _MAX_SLOPE:
            return "lower"
        return "upper" if abs(angle - limits[1]) < 2 * _MAX_SLOPE else None


class RehearsalConsole:
    """Commands that are typed, on one simulated robot.

    Args:
        parts: Emulation of the robot; its drivers, which are open, are closed.
        seed: Seed of the errors of the simulated hands.
        file: The calibration file, which need not exist, or ``None``.
    """

    def __init__(self, parts: Emulation, *, seed: int, file: Path | None):
        self._parts = parts
        self._seed = seed
        self._file = file
        parts.devices.close()  # each command opens its own, as on a robot

    def run(self) -> None:
        """Reads commands from standard input until its end, or ``quit``."""
        console = Console()
        console.say(f"{self._parts.config.name}, simulated, in real time:\n{HELP}")
        while True:
            try:
                words = shlex.split(console.ask("simulated robot"))
                if words[:1] == ["quit"]:
                    return
                if words:
                    self._obey(words[0], words[1:])
            except EOFError:
                return
            except (BodyschemaError, ValueError) as error:  # ValueError: a quote without its end
                console.say(f"! {error}")

    def _obey(self, command: str, arguments: Sequence[str]) -> None:
        parts, world = self._parts, self._parts.world
        match command, list(arguments):
            case "doctor", [] | ["--move"]:
                doctor = Doctor(self._config(), parts.buses, move=bool(arguments))
                calibrate_only = partial(command_line, "calibrate", "--only")
                print_findings(doctor.examine(), print, calibrate_only)
            case "calibrate", [] | ["--only", _, *_]:
                self._calibrate(arguments[1:])
            case "try", [] | ["--limp"]:
                with keyboard() as view:
                    Trial(self._config(), parts.buses, view, by_hand=bool(arguments)).run()
            case "stand", []:
                world.hold(STAND, (0.0, 0.0, 1.0))
            case "ground", []:
                world.lay_down()
            case "fault", [spec]:
                parts.panel.order(FaultSpec.parse(spec))
            case "mend", []:
                parts.panel.mend()
            case _:
                print(HELP)

    def _config(self) -> RobotConfig:
        return with_calibration(self._parts.config, self._file)[0]

    def _calibrate(self, only: Sequence[str]) -> None:
        if self._file is None:
            raise CommandError("start with --calibration FILE, which this writes")
        devices = open_devices(self._config(), self._parts.buses)
        try:
            Rehearsal(self._parts, seed=self._seed, echo=print).calibrate(devices, self._file, only)
        finally:
            devices.close()
