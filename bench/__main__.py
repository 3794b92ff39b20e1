"""Runs the benchmarks of ``make bench``."""

from __future__ import annotations

from bench import robot_cost, simulation_cost

if __name__ == "__main__":
    robot_cost.main()
    simulation_cost.main()
