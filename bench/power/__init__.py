"""How often each method finds the body, and whether it knows: ``python -m bench.power``.

Robots are simulated (PyBullet at 1/240 s, noise on) and reached through the protocol. What a run
costs is the estimator's CPU time: it does not depend on what else the machine does.
"""
