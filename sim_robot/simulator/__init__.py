"""The daemon of a robot, on emulated electronics over a simulated body.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``daemon``              puts world, electronics and daemon together, and serves them
``wiring``              what each wire of the simulated robot carries
``miscalibration``      electronics that are not what their configuration says, by a seed
``person``              a person for guided sessions, who measures the simulated body
======================= =========================================================================
"""
