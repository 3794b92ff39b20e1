"""The estimation-exploration loop: act, sense, model.

==================== ===============================================================================
Name                 What is in it
==================== ===============================================================================
``run``              starts runs, continues them, and connects them to robot and physics
``loop``             the loop
``posterior_method`` the method ``posterior``
``next_program``     the next motor program, by an exploration rule
``paper``            the method ``paper``: a population of models, its search and its objectives
``method``           the interfaces between a run and its method, and between a run and its listener
``robot_link``       where readings come from: a robot, a table, a recorded run
``record_link``      records in place of a robot
==================== ===============================================================================

Each imports only from those below it.
"""
