"""``report.html``: pages that need nothing but themselves.

======================= ========================================================================
``templates``           pages from templates, everything escaped, nothing fetched
``commands``            the commands that make a run again
``run_page``            the page of a run
======================= ========================================================================

``viewer.js`` draws bodies with three.js: ``three.min.js`` is three 0.187.0 (MIT, see
``three.LICENSE``) from npm, of which ``make three`` bundles what ``three.js`` names with esbuild
0.28.2.
"""
