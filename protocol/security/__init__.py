"""Keys: who may connect to a robot, and with which role.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``keys``                key directories: this computer's own keys, and those that it knows
``key_files``           reads a directory's files: only such as nobody else can have written
``access``              the list of known clients, read again when it has changed; the ZAP handler
                        (ZeroMQ RFC 27), which accepts or refuses connections by it
======================= =========================================================================
"""
