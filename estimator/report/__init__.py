"""What a run found, for people and for other programs.

==================== ===============================================================================
Name                 What is in it
==================== ===============================================================================
``run_files``        the derived files of a run directory
``live``             the page of a run while it goes on
``comparison``       runs side by side
``page``             the page ``report.html``
``camera``           pictures of scenes without a screen
``shown_bodies``     which bodies a page shows
``evaluations``      score and validation: their files and tables
``outcome``          what a run says first, and what to do next
``plots``            plots of a run
``scene``            bodies as links and joints, and as solids at rest
``tables``           words and tables of a run
``canvas``           figures, and each leg's colour and marker
``export``           bodies in the formats of simulators
``formats``          formats of a report by name
``summarise``        the outcome of a run, from its store
``result``           ``result.json``
``posterior_report`` what a posterior says, in the problem's names
``range_ends``       lengths at an end of the range that the problem gives them
``verdict``          whether some body of the problem explains the readings, as sentences
==================== ===============================================================================

Each imports only from those below it.
"""
