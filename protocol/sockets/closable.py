"""What has to be closed, and is by the end of its ``with`` block."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Self


class Closable(ABC):
    """Base of whatever holds threads, sockets or processes."""

    @abstractmethod
    def close(self) -> None:
        """Gives everything back; idempotent."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
