"""Connections between computers: TCP and ZeroMQ.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``zmq_sockets``         how ZeroMQ sockets are made here: bounded, with or without keys; ``Waker``
``tcp_listener``        gives each TCP connection a ZeroMQ socket of its own
``tcp_connection``      one TCP connection, with its ZeroMQ socket
``endpoints``           addresses, and which of them need keys
======================= =========================================================================
"""
