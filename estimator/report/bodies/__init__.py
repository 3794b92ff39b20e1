"""Bodies as people see them.

======================= ========================================================================
``scene``               bodies as solids in the world, turned as their readings say
``camera``              pictures of solids, without a screen
``jointed_body``        a body as links and joints, for a page to pose
``predictions``         what bodies would have felt in the poses that the robot took
``shown_bodies``        which bodies a run shows: the best, its rivals, the truth
``body_picture``        them as one picture
======================= ========================================================================
"""
