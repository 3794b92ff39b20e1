"""Questions and answers on a terminal.

Every question can be answered with ``q``; that, Ctrl-C and the end of input all leave the session.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Protocol, TypeVar

from robot.errors import AbandonedError, ConfigError, DeviceError, DeviceMissingError

T = TypeVar("T")


class Terminal(Protocol):
    """The terminal of a session: a person, or a test in their place."""

    def say(self, text: str) -> None:
        """Shows some lines."""

    def ask(self, prompt: str) -> str:
        """Shows a prompt and returns the line that is typed.

        Raises:
            EOFError: Nobody will type any more.
        """


class Console:
    """Standard input and output."""

    def say(self, text: str) -> None:
        """Prints."""
        print(text, flush=True)

    def ask(self, prompt: str) -> str:
        """Reads a line."""
        return input(f"{prompt} > ")


class Questions:
    """Asks until an answer makes sense.

    Args:
        terminal: Terminal at which to ask.
        reconnect: Opens a link anew that was lost; called before a device that is missing is tried
            again.
    """

    def __init__(self, terminal: Terminal, reconnect: Callable[[], None] = lambda: None):
        self._terminal = terminal
        self._reconnect = reconnect

    def say(self, text: str) -> None:
        """Shows some lines."""
        self._terminal.say(text)

    def ask(self, prompt: str) -> str:
        """Asks, and returns the answer in lower case, without blanks around it.

        Raises:
            AbandonedError: The answer was ``q``, or there will be none.
        """
        try:
            answer = self._terminal.ask(prompt).strip().lower()
        except EOFError:
            raise AbandonedError("The input ended.") from None
        if answer in ("q", "quit"):
            raise AbandonedError("You left the session.")
        return answer

    def choose(self, prompt: str, *choices: str) -> str:
        """Asks for a word, or the beginning of one; the empty word stands for Enter alone."""
        words = [choice or "Enter" for choice in choices]
        while True:
            answer = self.ask(prompt)
            matches = [c for c in choices if c.startswith(answer)] if answer else [""]
            if len(matches) == 1 and matches[0] in choices:
                return matches[0]
            self.say(f"Answer {', '.join(words)}, or q to leave.")

    def number(self, prompt: str, least: float, most: float) -> float:
        """Asks for a number from ``least`` to ``most``."""
        while True:
            value = number(self.ask(prompt))
            if value is not None and least <= value <= most:
                return value
            self.say(f"Answer a number from {least:g} to {most:g}, or q to leave.")

    def attempt(self, action: Callable[[], T]) -> T:
        """Does something with a device or a file, until it succeeds or somebody leaves."""
        while True:
            try:
                return action()
            except (DeviceError, ConfigError) as error:
                self.say(f"! {error}")
                self.choose("Enter tries again", "")
                if isinstance(error, DeviceMissingError):
                    with suppress(DeviceError):  # the next try will say so
                        self._reconnect()


def number(text: str) -> float | None:
    """Parses a finite decimal number with point or comma; ``None`` where it is none."""
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        return None
    return value if abs(value) < 1e12 else None
