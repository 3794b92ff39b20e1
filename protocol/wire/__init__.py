"""What goes over the wire: messages, capabilities, and the frames that carry them.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``messages``            every message, frozen and validated
``capabilities``        what ``hello`` makes public about a robot
``readings``            the definitions of touch, tilt and clearance
``states``              the states that a robot can be in
``codec``               maps to MessagePack frames and back, strictly
``declaration``         how messages are declared: fields with a check for each
``field_checks``        the checks
======================= =========================================================================
"""
