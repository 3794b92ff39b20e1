"""The computer that the daemon runs on: its clocks, its log, its service manager."""
