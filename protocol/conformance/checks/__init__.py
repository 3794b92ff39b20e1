"""The checks, by subject; the sections are those of ``SPEC.md``.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``basics``              a plain request of each kind: the checks on which the others build
``connections``         section 1: parts, sizes, keys; many requests at once
``frames``              section 2, and the malformed frames of ``vectors.json``
``sessions``            section 3: hello, sessions, where answers go
``request_ids``         section 4: each numbered request is carried out at most once
``control``             sections 5 and 6 on a robot at rest: control, stop, states; with
                        ``--slow`` also long silences
``readings``            sections 7 to 11: what the robot says and publishes
``motion``              what moves the robot; only with ``--move``
======================= =========================================================================

A module registers its checks when it is imported.
"""
