"""Chains on levels of noise, which discovery searches with and sampling draws from.

================= ===============================================================================
Module            What is in it
================= ===============================================================================
``population``    the chains: evolutionary Monte Carlo
``moves``         their proposals
``rows``          other ways to put one part on, and who then has to move
================= ===============================================================================
"""
