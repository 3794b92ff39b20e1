"""The daemon of a robot, on emulated electronics over a simulated body.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``daemon``              puts world, electronics and daemon together, and serves them
``electronics_set``     what a set of electronics is, and the configuration that fits it
``pc104_set``           the boards of 2006: SV203, DMM-32, VL6180X
``pi_set``              chips on an I²C bus: PCA9685, ADS1115, MPU-6050, VL6180X
``wiring``              what each wire of the simulated robot carries
``miscalibration``      electronics that are not what their configuration says, by a seed
``person``              a person for guided sessions, who measures the simulated body
======================= =========================================================================
"""
