"""The computer that the daemon runs on: its clocks, its log, its service manager.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``clock``               the robot's clock, passed in wherever time matters
``trusted_clock``       a clock that can be trusted with time stamps and slews
``logs``                log lines on standard error, for a terminal or systemd's journal
``service_manager``     ready, alive, stopping: the protocol of sd_notify(3)
======================= =========================================================================
"""
