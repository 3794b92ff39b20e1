"""Checks of a posterior.

=============== =================================================================================
Module          What is in it
=============== =================================================================================
``verdict``     does any body that the problem allows explain the readings?
``deviated``    would a body that deviates from the problem explain them clearly better?
``fitting``     fits the bodies that deviate
``recheck``     a simulator reweights samples
``left_out``    does one interaction rule out lengths that the simulator would admit?
=============== =================================================================================
"""
