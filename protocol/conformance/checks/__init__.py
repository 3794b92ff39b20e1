"""The checks, grouped as the sections of ``SPEC.md``; importing a module registers its checks."""
