"""The operating system: files that are replaced as a whole, and Ctrl-C where it has to wait.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``replace_file``        replaces a file in one step, on disk when it returns
``interrupts``          defers Ctrl-C until a block is over
======================= =========================================================================
"""
