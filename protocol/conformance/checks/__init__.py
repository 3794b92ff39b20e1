"""The checks by subject, each module for sections of ``SPEC.md``; importing one registers its checks."""
