"""``robotd try``: a person moves one joint and watches every sensor, in the terminal.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``session``             what each key does, turn by turn
``joints``              the joints: one moves, never beyond its limits or its speed
``live_sensors``        the sensors in physical units, one failing sensor not hiding the next
``screen``              the lines that are shown
``keyboard``            single keys from a terminal, and the terminal as it was before
======================= =========================================================================
"""
