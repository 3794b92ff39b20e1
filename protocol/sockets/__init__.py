"""Connections between computers: TCP and ZeroMQ.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``zmq_sockets``         how ZeroMQ sockets are made here: bounded, with or without keys
``tcp_listener``        gives each TCP connection a ZeroMQ socket of its own
``tcp_connection``      one TCP connection, with its ZeroMQ socket
``framing``             counts the frames of a ZMTP stream without looking into them
``endpoints``           addresses, and which of them need keys
``waker``               wakes a thread that sleeps in a poll
======================= =========================================================================
"""
