"""The model: what is unknown of a body, and how likely readings are, given one.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``slopes``              how readings change with lengths, and which lengths fit best
``likelihood``          the mixture: how likely an interaction is, given a body
``mixture``             its density, compiled
``noise_family``        how readings scatter: the normal distribution, and all that follows
``noise_factors``       how much noisier than announced each sensor is, integrated out
``sensor_data``         the readings of an interaction as the likelihood takes them
``densities``           one modality's readings, held against predictions
``special``             functions that the densities need
``unknowns``            the unit cube that all this is over
``deviations``          how a robot may be built otherwise than any body of that cube
``possible_deviations`` all that are looked at
``servos_and_sensors``  what servos and sensors make of programs and poses then
======================= =========================================================================
"""
