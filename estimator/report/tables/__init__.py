"""Tables and sentences at a terminal.

======================= ========================================================================
``terminal``            a run's result, its score and its validation
``posterior``           a posterior; the page says it in the same words
``verdict``             whether any body explains the readings, and what to check if none does
``plain``               how tables look
======================= ========================================================================
"""
