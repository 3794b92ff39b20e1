"""The paper's figures, a module each.

======================= ==================================================================
``figure``              what all figures have in common
``figure2``             one figure each, like ``figure3``, ``figure4``, ``figure5``, ``figure6``
======================= ==================================================================
"""
