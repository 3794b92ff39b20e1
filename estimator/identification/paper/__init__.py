"""The paper's method: a population of models is optimised until it fits what was observed."""
