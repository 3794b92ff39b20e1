"""What C code prints is discarded, whether it is buffered or not; what Python prints stays."""

import subprocess
import sys

PROGRAM = """
import ctypes, sys
from protocol.system.native_output import native_output_discarded

libc = ctypes.CDLL(None)
print("before")
with native_output_discarded():
    libc.puts(b"buffered by C")
    libc.write(2, b"not buffered", 12)
try:
    with native_output_discarded():
        raise ValueError
except ValueError:
    print("after")
libc.puts(b"C again")
libc.fflush(None)
"""


def test_only_what_is_printed_inside_is_discarded() -> None:
    printed = subprocess.run(
        [sys.executable, "-u", "-c", PROGRAM],
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    assert (printed.stdout, printed.stderr) == ("before\nafter\nC again\n", "")
