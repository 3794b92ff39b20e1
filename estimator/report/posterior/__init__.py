"""The posterior of a run, in numbers and sentences.

======================= ========================================================================
``summary``             attachments with probabilities, intervals, rivals
``verdict``             whether some body of the problem explains the readings
``samples_csv``         ``posterior.csv``: the samples, a row each
======================= ========================================================================
"""
