"""The page ``report.html``: a single file that loads nothing else.

``viewer.js`` draws bodies with three.js: ``three.min.js`` is three 0.187.0 (MIT, see
``three.LICENSE``) from npm; ``make three`` bundles the parts of it that ``three.js`` names, with
esbuild 0.28.2.
"""
