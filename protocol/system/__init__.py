"""The operating system: replacing files, deferring Ctrl-C, discarding what C code prints.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``replace_file``        replaces a file in one step, on disk when it returns
``interrupts``          defers Ctrl-C until a block is over
``native_output``       discards what C code prints
======================= =========================================================================
"""
