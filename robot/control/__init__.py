"""The control loop: the only thread that touches devices.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``controller``          the loop: takes jobs from a queue, reports through events
``job_queue``           the jobs that wait for it
``loop_watch``          notices that it no longer turns
``outbox``              what the loop has to tell the server
``jobs``                a request on its way through the loop, and its answers
``interaction``         the choreography of one interaction: slew, settle, sample
``motion``              the way from the present counts to the targets
======================= =========================================================================
"""
