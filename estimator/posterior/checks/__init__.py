"""What is looked at before a posterior is believed.

=============== =================================================================================
Module          What is in it
=============== =================================================================================
``verdict``     does any body that the problem allows explain the readings?
``departed``    would a body that departs from the problem explain them clearly better?
``fitting``     fits the bodies that depart
``recheck``     a simulator reweights samples
``left_out``    does one interaction rule out lengths that the simulator would admit?
=============== =================================================================================
"""
