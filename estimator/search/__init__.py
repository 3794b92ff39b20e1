"""Search over gene arrays by ask and tell; the user brings the evaluator.

=================================================== ===========================================
``deterministic_crowding.DeterministicCrowding``    the paper's genetic algorithm
``searches``                                        searches by name, and what a search is
``operators``                                       crossover, mutation, distance; by name
``randomness``                                      a run's seed, in independent streams
=================================================== ===========================================
"""
