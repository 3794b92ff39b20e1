"""How often each method finds the body, and whether it knows: ``python -m bench.power``.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``study``               the list of all runs
``faults``              robots that are not as their problem says, for that list
``odd_robots``          the same, with faults that no check was made for
``robots``              bodies to start simulated robots with, and what counts as the truth
``trial``               one run through the wire, held against the truth after each interaction
``ablations``           the method with one part left out, on development seeds
``tables``              what the runs say, as Markdown
``curves``              how often the body is found against movements and CPU time, as a picture
``__main__``            does what is left to do, and writes ``docs/power.md``
======================= =========================================================================

Robots are simulated (PyBullet at 1/240 s, noise on) and reached through the protocol. What a run
costs is the estimator's CPU time: it does not depend on what else the machine does.
"""
