"""``report.html``: a page that needs nothing but itself.

``viewer.js`` draws bodies with three.js: ``three.min.js`` is three 0.187.0 (MIT, see
``three.LICENSE``) from npm, of which ``make three`` bundles what ``three.js`` names with esbuild
0.28.2.
"""
