"""The operating system: replacing files, and what a process holds and shares."""
