"""Server, client and telemetry: sockets and threads around the rules.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``client``              ``RobotClient``: controls a robot over the wire
``client_thread``       the thread behind it, which owns the socket
``server``              ``Server``: ZeroMQ sockets around ``rules.server_core``
``telemetry``           the robot's publications; ``TelemetrySubscriber`` listens to them
``connection_probe``    why nobody answers at an address, step by step
======================= =========================================================================
"""
