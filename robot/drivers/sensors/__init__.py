"""Drivers of sensors.

=================== =============================================================================
``contracts``       those of accelerometers, touch and distance sensors, and of boards of inputs
``analogue``        accelerometer and strain gauges on analogue inputs
``switch``          a switch with its resistor on an analogue input
``mpu6050``         InvenSense MPU-6050 accelerometer
``vl6180x``         ST VL6180X distance sensor
``axes``            three axes with their calibration, whatever their unit
=================== =============================================================================
"""
