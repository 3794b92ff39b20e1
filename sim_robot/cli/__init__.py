"""The command line of ``sim-robotd``: ``command_line``, and ``calibrate`` for ``--calibrate``."""
