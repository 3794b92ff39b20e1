"""The live page: a run in a browser while it goes on, read from its directory and never written."""
