"""What ``robotd doctor`` looks at.

=================  ===============================================================================
``findings``       What was observed of one thing, and what to check
``servos``         The servo board, its line, each joint; small moves there and back
``sensors``        The analogue inputs, accelerometer, strain gauges, distance sensor
``doctor``         All of them in turn, one failing device not hiding the next
=================  ===============================================================================
"""
