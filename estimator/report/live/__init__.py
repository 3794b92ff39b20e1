"""The live page: a run in a browser while it goes on; its directory is read and never written."""
