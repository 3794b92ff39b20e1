"""The checks by subject, as ``SPEC.md`` has its sections; importing a module registers its checks."""
