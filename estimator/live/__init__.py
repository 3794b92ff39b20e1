"""A run while it goes on: a page in a browser, which follows the run directory.

================= ===========================================================================
Module            What is in it
================= ===========================================================================
``run_follower``  how a run stands, read again whenever another process has written
``run_view``      what of that is shown: the bodies that are believed in, progress, verdict
``pose_ensemble`` many bodies in the robot's last pose, as arrays for the graphics card
``panel``         the page's text
``live_page``     the page: viser serves it, and draws
``front``         between the page and the network: who is served, and what may reach viser
``watching``      keeps a page up to date until somebody ends it
================= ===========================================================================

Nothing here writes to the run directory or takes its lock.
"""
