"""Plots.

======================= ========================================================================
``run``                 which plots a run has, and what is to be seen in them
``posterior``           probabilities and intervals over interactions
``generations``         errors and leg lengths over generations, as in the paper's Figure 2
``predictions``         what was felt beside what is foretold
``canvas``              empty figures; drawn ones as PNG and SVG
``leg_styles``          a colour, a marker and a label for each leg
======================= ========================================================================
"""
