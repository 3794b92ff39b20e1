"""The command line of ``sim-robotd``.

``command_line``; ``calibrate`` for ``--calibrate``, and ``console`` for ``--console``.
"""
