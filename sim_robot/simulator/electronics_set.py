"""A complete set of emulated electronics: what a robot's drivers find, whatever the boards."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar, Final

from robot.configuration.device_tables import DistanceConfig
from robot.configuration.joint_calibration import DrivenJoint, JointScale, middle
from robot.configuration.robot_config import BodyConfig, NoiseConfig, RobotConfig
from robot.drivers.buses import Buses
from robot.drivers.sensors.analogue import StrainGauge
from robot.drivers.sensors.contracts import BoardSettings, SensorSettings
from robot.drivers.sensors.vl6180x import VL6180XSettings
from robot.drivers.servos.servo_bus import ServoBus, ServoSettings
from robot.host.clock import Clock
from robot.sensing.samples import RestCriterion
from robot.sensing.sensors import BellySensor, TouchPoint
from sim_robot.electronics.clock import TICK
from sim_robot.electronics.fault_switch import FaultSwitch
from sim_robot.electronics.servos import Felt
from sim_robot.simulator.wiring import Wiring
from sim_robot.world.body import Body, Motor
from sim_robot.world.sensor_noise import NoiseLevels
from sim_robot.world.simulation import GRAVITY, SERVO_SPEED

TARE_VOLTS: Final = 0.2
"""Voltage of a strain gauge without load, V."""
VOLTS_PER_NEWTON: Final = 0.1
"""Sensitivity of a strain gauge, V/N; less for a heavy body, so that twice its weight reads."""
RECESS: Final = 0.010
"""How far inside the belly the distance sensor sits, m."""
REACH: Final = 0.2
"""The largest clearance that is measured, m."""
REACH_MM: Final = int(1000 * (REACH + RECESS))
"""The largest distance from the sensor that is measured, mm."""

ENCODER: Final = math.radians(0.05)
"""Error of a measured angle, rad: an emulated encoder of 4096 steps has neither noise nor play."""

_SPARE_SHARE: Final = 2 / 255
"""Share of the counts beyond each limit of a joint."""


class ElectronicsSet(ABC):
    """One set of electronics, made for a body and connected to its world.

    Args:
        body: The body.

    Attributes:
        summary: Boards of the set, for the command line's help.
        lag: Time until a servo drives to where it was last sent, in small steps, s.
        notes: What a person should know of the set, a sentence each.
    """

    summary: ClassVar[str]
    lag: float = TICK
    notes: Sequence[str] = ()

    def __init__(self, body: Body) -> None:
        self._body = body

    @property
    @abstractmethod
    def switches(self) -> Mapping[str, FaultSwitch]:
        """What can fail, by its name at the fault panel; complete after ``connect``."""

    @abstractmethod
    def configure(self, levels: NoiseLevels) -> RobotConfig:
        """The configuration that fits the set; noise is announced to clients."""

    @abstractmethod
    def connect(self, wiring: Wiring, clock: Clock) -> None:
        """Makes the emulators of the sensors; ``clock`` is the world's."""

    @abstractmethod
    def buses(self, clock: Clock) -> Buses:
        """Buses that lead drivers to the emulators; ``clock`` is the robot's."""

    @abstractmethod
    def pulses(self) -> Sequence[int]:
        """Counts of the joints, 0 where there are no pulses, then of outputs without a joint."""

    def feel(self, find: Callable[[], Sequence[Felt]]) -> None:  # noqa: B027 - few servos measure
        """Has servos that measure find what the world has, in the order of ``pulses``."""

    def follow(self, servos: ServoBus) -> Callable[[], None]:
        """Returns what waits, when called, until the boards have had all that the driver sent."""
        del servos
        return lambda: None

    def begin_interaction(self) -> None:  # noqa: B027 - only some boards count
        """Restarts what counts samples, so that a repeated observation reads the same."""

    def close(self) -> None:  # noqa: B027 - only some took anything
        """Gives back what the set took of this computer."""


def configuration(
    body: Body,
    levels: NoiseLevels,
    *,
    servos: ServoSettings,
    daq: BoardSettings | None,
    accelerometer: SensorSettings,
    first_foot: int,
    full_load: float,
    turn: float | None = None,
) -> RobotConfig:
    """The configuration of a simulated robot with the drivers of one set.

    The emulated calibration is one rule for every body and board: a joint's range takes all counts
    but a few at either end, so that the middle count is its middle. With 255 counts that is 0.68° a
    count at the hips of the paper's quadruped and 0.76° at its knees, because Table 2's ranges do
    not fit the 254 counts at the SV203's nominal 0.71°.

    Args:
        body: The body.
        levels: Levels of noise that are announced to clients.
        servos: Settings of the servos; joints are on their outputs, in order.
        daq: Settings of the board that has the feet on its inputs, or ``None``.
        accelerometer: Settings of the accelerometer.
        first_foot: Input of the first foot; the others follow.
        full_load: Largest voltage at twice the body's weight on one foot, V.
        turn: Angle that a servo turns over all its counts, rad, if known: the middle count is 0.
    """
    counts = servos.counts
    spare = int(len(counts) * _SPARE_SHARE)
    ends = counts[0] + spare, counts[-1] - spare

    def scale(motor: Motor) -> JointScale:
        if turn is None:
            return JointScale(((ends[0], motor.lower), (ends[1], motor.upper)), counts)
        zero = middle(counts)
        step = turn / len(counts)
        return JointScale(
            tuple((count, step * (count - zero)) for count in (counts[0], counts[-1])), counts
        )

    sensitivity = min(VOLTS_PER_NEWTON, full_load / (2 * body.mass * GRAVITY))
    return RobotConfig(
        name=body.name[:64],
        body=BodyConfig(
            size=body.base_size,
            radius=body.base_radius,
            mass=body.base_mass,
            lies_flat=body.lies_flat,
        ),
        servos=servos,
        joints=tuple(
            DrivenJoint(
                name=motor.name,
                output=output,
                lower_limit=motor.lower,
                upper_limit=motor.upper,
                part_radius=motor.radius,
                scale=scale(motor),
            )
            for output, motor in zip(servos.outputs, body.motors, strict=False)
        ),
        speed=SERVO_SPEED,
        daq=daq,
        accelerometer=accelerometer,
        touch=tuple(
            TouchPoint(
                name=name,
                driver=StrainGauge(
                    channel=first_foot + index, tare=TARE_VOLTS, volts_per_newton=sensitivity
                ),
                on=0.1,
                off=0.05,
                debounce=3,
            )
            for index, name in enumerate(body.touch)
        ),
        distance=DistanceConfig(
            driver=VL6180XSettings(bus=1, address=0x29),
            sensor=BellySensor(zero=RECESS, reach=REACH),
        ),
        settling=RestCriterion(),
        samples=10,
        noise=NoiseConfig(
            tilt=levels.announced * math.radians(levels.tilt_deg),
            clearance=levels.announced * levels.clearance_mm / 1000,
            joint=ENCODER,
        ),
    )
