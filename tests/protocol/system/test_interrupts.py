"""Ctrl-C waits for what cannot stand it."""

import signal
import threading

import pytest

from protocol.system.interrupts import interrupts_deferred


def work(done: list[str]) -> None:
    with interrupts_deferred():
        signal.raise_signal(signal.SIGINT)
        done.append("all of it")


def fail() -> None:
    with interrupts_deferred():
        signal.raise_signal(signal.SIGINT)
        raise OSError("full")


def test_an_interrupt_waits_for_the_end_of_the_block() -> None:
    done: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        work(done)
    assert done
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_an_error_in_the_block_comes_before_an_interrupt() -> None:
    with pytest.raises(OSError, match="full"):
        fail()
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_other_threads_are_never_interrupted() -> None:
    done: list[str] = []

    def calmly() -> None:
        with interrupts_deferred():
            done.append("all of it")

    thread = threading.Thread(target=calmly)
    thread.start()
    thread.join()
    assert done
