"""A robot on emulated electronics in a world that never moves: it lies flat, whatever it does.

With the boards of a PC-104, or with the chips of a Pi. It needs neither numpy nor PyBullet, so it
shows what the daemon itself costs, and lets tests drive the control loop with a clock of their own.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Final, cast

from robot.configuration.joint_calibration import DrivenJoint, JointScale
from robot.configuration.robot_config import RobotConfig, load_config
from robot.control.controller import Controller
from robot.devices import Devices, open_devices
from robot.drivers.buses import Buses
from robot.drivers.sensors.ads1115 import ADS1115Settings
from robot.drivers.sensors.analogue import StrainGauge
from robot.drivers.sensors.mpu6050 import MPU6050Settings
from robot.drivers.servos.pca9685 import PCA9685Settings
from robot.drivers.servos.servo_bus import ServoBus, ServoSettings
from robot.drivers.servos.sv203 import SERVOS, SV203, SV203Settings
from robot.host.clock import Clock, WatchedClock
from robot.host.service_manager import ServiceManager
from robot.service.daemon import build_controller
from sim_robot.electronics.ads1115 import ADS1115Emulator
from sim_robot.electronics.clock import HostClock
from sim_robot.electronics.dmm32 import Dither, DMM32Emulator
from sim_robot.electronics.fault_switch import FaultSwitch
from sim_robot.electronics.i2c_bus import I2CBus, I2CDevice
from sim_robot.electronics.mpu6050 import MPU6050Emulator
from sim_robot.electronics.pca9685 import PCA9685Emulator
from sim_robot.electronics.sv203 import SV203Emulator
from sim_robot.electronics.vl6180x import VL6180XEmulator
from sim_robot.faults.fault_panel import FaultPanel


@dataclass(kw_only=True)
class StillWorld:
    """What the sensors are exposed to; a test may change it.

    Attributes:
        volts: Voltage at each analogue input, V; an input that is not listed reads 0.
        distance_mm: Distance of what is in front of the distance sensor, mm; ``None``: nothing is.
    """

    volts: list[float]
    distance_mm: float | None
    _dither: Dither = field(default_factory=Dither)
    _error: float = 0.0

    @classmethod
    def around(cls, config: RobotConfig) -> StillWorld:
        """World of a robot that lies flat on its belly, with its feet in the air."""
        assert config.axes is not None
        rest = [*config.axes.zero[:2], config.axes.zero[2] + 1.0]
        return cls(
            volts=rest + [gauge.tare for gauge in config.gauges.values()],
            distance_mm=config.distance.zero * 1000 if config.distance else None,
        )

    def input(self, channel: int) -> float:
        """Voltage at an analogue input, V; a scan begins at the first input."""
        if channel == 0:
            self._error = self._dither.next_scan()
        return self.volts[channel] + self._error if channel < len(self.volts) else 0.0


@dataclass(frozen=True, kw_only=True)
class OnElectronics:
    """A robot on emulated electronics."""

    config: RobotConfig
    buses: Buses
    devices: Devices
    panel: FaultPanel
    controller: Controller


@dataclass(frozen=True, kw_only=True)
class StillRobot(OnElectronics):
    """A robot with a PC-104's boards, and the parts behind it."""

    servos: SV203
    world: StillWorld
    servo_board: SV203Emulator
    daq: DMM32Emulator
    distance: VL6180XEmulator
    bus: I2CBus


class Bystander:
    """Counts interactions, and touches nothing."""

    lays_down = False

    def __init__(self, panel: FaultPanel):
        self._panel = panel

    def attend(self) -> None:
        """Called at each interaction, once the joints are at zero."""
        self._panel.begin_interaction()


def example_config(port: str, *, boards: Sequence[int] = (1,)) -> RobotConfig:
    """The documented ``robot.toml``, on another serial port.

    The time of watching before a robot counts as at rest is short, since this one never moves.

    Args:
        port: The port.
        boards: Numbers of its servo boards; each has the joints of the first, under new names.
    """
    config = load_config(Path(str(resources.files("robot") / "robot.toml")))
    assert isinstance(config.servos, SV203Settings)
    further = tuple(
        replace(joint, name=f"{joint.name}_{number}", output=joint.output + SERVOS * row)
        for row, number in enumerate(boards)
        for joint in config.joints
        if row
    )
    return replace(
        config,
        servos=replace(config.servos, port=port, boards=tuple(boards)),
        joints=config.joints + further,
        settling=replace(config.settling, window=0.3),
    )


@contextmanager
def on_electronics(
    config: RobotConfig,
    electronics: Mapping[str, FaultSwitch],
    buses: Buses,
    *,
    stand: bool = False,
    housekeeping: float | None,
    log: logging.Logger,
    manager: ServiceManager | None = None,
) -> Iterator[OnElectronics]:
    """Opens the drivers and builds the control loop, which is not yet started.

    Args:
        config: Configuration of the robot.
        electronics: Emulated electronics that can fail, by name on the fault panel.
        buses: Buses that lead to the electronics.
        stand: Whether the servos are on, in the zero pose.
        housekeeping: As ``build_controller`` takes it.
        log: As ``build_controller`` takes it.
        manager: As ``build_controller`` takes it.
    """
    with ExitStack() as stack:

        def look() -> None:
            panel.advance()

        host = HostClock(WatchedClock(buses.clock, look))
        panel = FaultPanel({**electronics, "clock": host}, host.now)
        stack.callback(panel.close)
        buses = replace(buses, clock=host)
        devices = open_devices(config, buses)
        stack.callback(devices.close)
        if stand:
            devices.servos.read_counts([joint.output for joint in config.joints])
            devices.servos.set_counts(
                {joint.output: joint.quantise(0.0) for joint in config.joints}
            )
        controller = build_controller(
            config,
            devices,
            clock=host,
            operator=Bystander(panel),
            housekeeping=housekeeping,
            log=log,
            manager=manager,
        )
        yield OnElectronics(
            config=config, buses=buses, devices=devices, panel=panel, controller=controller
        )


@contextmanager
def still_robot(
    clock: Clock,
    *,
    housekeeping: float | None,
    log: logging.Logger,
    manager: ServiceManager | None = None,
    boards: Sequence[int] = (1,),
) -> Iterator[StillRobot]:
    """Builds the robot of ``example_config``; its control loop is not yet started."""
    with closing(SV203Emulator(boards=boards)) as board:
        config = example_config(board.port, boards=boards)
        world = StillWorld.around(config)
        daq = DMM32Emulator(world.input, clock)
        distance = VL6180XEmulator(lambda: world.distance_mm, clock)
        bus = I2CBus([distance], clock)
        with on_electronics(
            config,
            {"servo_board": board, "daq": daq, "distance": distance, "i2c": bus},
            Buses(clock=clock, open_ports=lambda base: daq, open_i2c=bus.open),
            housekeeping=housekeeping,
            log=log,
            manager=manager,
        ) as robot:
            yield StillRobot(
                **vars(robot),
                servos=cast(SV203, robot.devices.servos),
                world=world,
                servo_board=board,
                daq=daq,
                distance=distance,
                bus=bus,
            )


_ENDS: Final = (106, 509)  # counts at the limits of each joint


@dataclass(frozen=True, kw_only=True)
class StillPi(OnElectronics):
    """A robot with PCA9685, ADS1115, MPU-6050 and VL6180X, and the parts behind it."""

    servos: ServoBus
    pwm: PCA9685Emulator
    bus: I2CBus


def pi_config(servos: ServoSettings, scale: Callable[[DrivenJoint], JointScale]) -> RobotConfig:
    """The documented robot, with the chips of a Pi in the place of its boards."""
    config = example_config("")
    joints = tuple(
        replace(joint, output=output, counts=servos.counts, scale=scale(joint))
        for output, joint in zip(servos.outputs, config.joints, strict=False)
    )
    touch = tuple(
        replace(point, driver=StrainGauge(channel=index, tare=0.2, volts_per_newton=0.1))
        for index, point in enumerate(config.touch)
    )
    return replace(
        config,
        servos=servos,
        joints=joints,
        touch=touch,
        daq=ADS1115Settings(bus=1, addresses=(0x48,), input_range="±4.096V"),
        accelerometer=MPU6050Settings(bus=1, address=0x68),
    )


@contextmanager
def on_pi_sensors(
    config: RobotConfig,
    clock: Clock,
    name: str,
    servos: FaultSwitch,
    *,
    housekeeping: float | None,
    log: logging.Logger,
) -> Iterator[tuple[OnElectronics, I2CBus]]:
    """The robot, its servos on in the zero pose, and the bus with the sensors."""
    assert config.distance is not None
    world = StillWorld(volts=[0.2] * 4, distance_mm=config.distance.zero * 1000)
    adc = ADS1115Emulator(world.input, clock)
    accelerometer = MPU6050Emulator(lambda: (0.0, 0.0, 1.0), clock)
    distance = VL6180XEmulator(lambda: world.distance_mm, clock)
    sensors = {"adc": adc, "accelerometer": accelerometer, "distance": distance}
    chips = [servos] if isinstance(servos, I2CDevice) else []
    bus = I2CBus([*chips, adc, accelerometer, distance], clock)
    with on_electronics(
        config,
        {name: servos, **sensors, "i2c": bus},
        Buses(clock=clock, open_i2c=bus.open),
        stand=True,
        housekeeping=housekeeping,
        log=log,
    ) as robot:
        yield robot, bus


@contextmanager
def still_pi(clock: Clock, *, housekeeping: float | None, log: logging.Logger) -> Iterator[StillPi]:
    """Builds the robot, with its servos on in the zero pose; its control loop is not started."""
    servos = PCA9685Settings(bus=1, boards=(0x40,), prescale=121, widths_us=(500.0, 2500.0))

    def scale(joint: DrivenJoint) -> JointScale:
        limits = joint.lower_limit, joint.upper_limit
        return JointScale(tuple(zip(_ENDS, limits, strict=True)))

    pwm = PCA9685Emulator(clock)
    with on_pi_sensors(
        pi_config(servos, scale), clock, "pwm", pwm, housekeeping=housekeeping, log=log
    ) as (robot, bus):
        yield StillPi(**vars(robot), servos=robot.devices.servos, pwm=pwm, bus=bus)
