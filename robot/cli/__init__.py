"""The command line of ``robotd``."""
