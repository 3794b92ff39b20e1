"""The paper's claims, and what our runs say about them.

======================= ==================================================================
``paper_claims``        the claims, declared before any run
``claims_table``        the table of verdicts, as files and as Markdown
``statistics``          its statistics; all tests are scipy's
======================= ==================================================================
"""
