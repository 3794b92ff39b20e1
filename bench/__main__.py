"""Runs every benchmark."""

from __future__ import annotations

from bench import pybullet_cost, robot_cost, statics_cost

if __name__ == "__main__":
    robot_cost.main()
    pybullet_cost.main()
    statics_cost.main()
