"""What an idle daemon, an interaction and a simulation cost: ``make bench``."""

from __future__ import annotations

import logging
import math
import random
import time

from bench import simulation_cost
from bench.daemons import cpu_share, simulator
from protocol.rules.robot_interface import Finished
from protocol.transport.client import RobotClient
from protocol.wire.messages import Perform
from sim_robot.simulator.daemon import emulation, robot_on
from sim_robot.world.body import default_body_path, load_body
from sim_robot.world.sensor_noise import NoiseLevels

IDLE_SECONDS = 20.0
INTERACTIONS = 40


def idle_daemon(electronics: str = "pc104") -> tuple[float, float]:
    """Resident memory (MB) and CPU share (%) of an idle daemon with one client connected."""
    with (
        simulator("--electronics", electronics, module="bench.still_robotd") as daemon,
        RobotClient(daemon.uri) as client,
    ):
        client.acquire()
        client.perform({joint.name: 0.1 for joint in client.capabilities.joints})
        share = cpu_share(daemon.process, IDLE_SECONDS)
        return daemon.process.memory_info().rss / 1e6, share


def interaction() -> float:
    """Milliseconds of one core for one interaction of the simulated quadruped."""
    rng = random.Random(0)
    log = logging.getLogger("bench")
    with emulation(
        load_body(default_body_path()),
        seed=0,
        levels=NoiseLevels(),
        real_time=False,
        log=log,
    ) as parts:
        controller = robot_on(parts, log, operator=True)
        joints = controller.capabilities.joints
        controller.start()
        start = time.process_time()
        for ticket in range(INTERACTIONS):
            targets = {
                joint.name: math.radians(rng.uniform(-30, 30)) if index < 4 else 0.0
                for index, joint in enumerate(joints)
            }
            controller.submit(ticket, Perform(id=ticket, client="b", session="b", targets=targets))
            while not any(isinstance(event, Finished) for event in controller.events()):
                time.sleep(0.001)
        spent = time.process_time() - start
        controller.shut_down()
    return 1000 * spent / INTERACTIONS


def main() -> None:
    """Prints the figures with their aims."""
    for electronics in ("pc104", "pi"):
        memory, share = idle_daemon(electronics)
        print(
            f"robotd on {electronics}, idle, telemetry at 2 Hz: {memory:.1f} MB resident "
            f"(aim: under 40), {share:.2f} % of a core (aim: under 2)"
        )
    print(f"sim-robotd: {interaction():.0f} ms of a core per interaction (aim: at most 150)")
    simulation_cost.main()


if __name__ == "__main__":
    main()
