"""The operating system: replacing files, deferring Ctrl-C, C code that prints, libraries.

======================= =========================================================================
Module                  What is in it
======================= =========================================================================
``replace_file``        replaces a file in one step, on disk when it returns
``presence``            whether a file is there, also where nobody may look
``forks``               sockets that a child process does not get
``interrupts``          defers Ctrl-C until a block is over
``native_output``       discards what C code prints
``closable``            base class of what has to be closed, a context manager
``missing_library``     what a command says where a library is not installed
======================= =========================================================================
"""
