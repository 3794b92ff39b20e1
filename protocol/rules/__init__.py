"""The rules of the protocol, without sockets, threads or clocks.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``server_core``         the server's side: requests in, actions out
``server_actions``      what the core asks its caller to do: send, submit, tell the robot
``client_core``         the client's side: heartbeats, repeated requests, replies
``at_most_once``        the memory that makes every numbered request idempotent
``lease``               who controls the robot, and whether that client is still there
``roles``               what a viewer, an operator and an admin may do
``transitions``         the robot's state machine as a table
``targets``             whether targets fit a robot's joints
``robot_interface``     what the server needs of a robot
======================= =========================================================================
"""
