"""The paper's figures, a module each.

======================= ==================================================================
``figure``              what all figures have in common
``figure2`` … 6         one figure each
``random_models``       the baseline of Figure 3: models drawn at random
======================= ==================================================================
"""
