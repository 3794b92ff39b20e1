"""Base class of context managers that have to be closed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Self


class Closable(ABC):
    """Holds threads, sockets or processes until it is closed; a context manager."""

    @abstractmethod
    def close(self) -> None:
        """Releases everything; idempotent."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
