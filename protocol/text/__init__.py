"""Text from elsewhere, read and shown safely.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``toml``                TOML from a file that anybody may have written
``printable``           text made harmless and short for whoever reads it
======================= =========================================================================
"""
