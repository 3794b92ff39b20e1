"""The rules of the protocol for both sides, without sockets, threads or clocks."""
