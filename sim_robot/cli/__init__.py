"""The command line of ``sim-robotd``.

``command_line``, and ``console`` for ``--console``.
"""
