"""Server, client and telemetry: sockets and threads around the rules."""
