"""Server, client and telemetry: sockets and threads around the rules.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``client``              ``RobotClient``: a robot, as a program that controls it sees it
``client_thread``       the thread behind it, which owns the socket
``server``              ``Server``: ZeroMQ sockets around ``rules.server_core``
``publisher``           the robot's publications
``telemetry``           ``TelemetrySubscriber``: listens to them
``connection_probe``    why nobody answers at an address, step by step
``log_limiter``         keeps a log short when the same thing happens again and again
======================= =========================================================================
"""
