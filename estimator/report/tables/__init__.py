"""Tables and sentences at a terminal.

======================= ========================================================================
``terminal``            a run's result, its score and its validation
``posterior``           a posterior; the page says it in the same words
``plain``               how tables look
======================= ========================================================================
"""
