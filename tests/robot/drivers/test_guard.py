"""Drivers that raise, give or do what none may, and what whoever uses them is told."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.drivers.guard import open_driver, under_way
from robot.errors import CommandError, DeviceDataError, DeviceMissingError, DriverError

NOT_FINITE = st.sampled_from([math.nan, math.inf, -math.inf])


class Unspeakable(BaseException):
    def __str__(self) -> str:
        raise SystemExit("not even its text")


class Driver:
    """Does what it is told, whatever it is asked for."""

    def __init__(self, act: Callable[[], Any]):
        self.act = act

    def __getattr__(self, name: str) -> Callable[..., Any]:
        return lambda *_: self.act()


@dataclass
class Settings:
    act: Callable[[], Any]
    name: ClassVar[str] = "sick board"

    def open(self) -> Driver:
        return Driver(self.act)


def driver(act: Callable[[], Any]) -> Any:
    return open_driver(Settings(act))


def raising(error: BaseException) -> Callable[[], Any]:
    def act() -> None:
        raise error

    return act


ERRORS = [
    SystemExit(0),
    GeneratorExit(),
    KeyError("board"),
    MemoryError(),
    RecursionError(),
    Exception("x" * 5_000_000 + "\n"),
]


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
@pytest.mark.parametrize("method", ["set_counts", "start", "check", "load", "close", "details"])
def test_whatever_a_driver_raises_is_a_device_error_that_names_it(
    method: str, error: BaseException
) -> None:
    with pytest.raises(DriverError) as raised:
        getattr(driver(raising(error)), method)()
    words = f"The driver of the sick board failed in {method}: {type(error).__name__}"
    assert raised.value.message.startswith(words)
    assert raised.value.__cause__ is error
    assert len(str(raised.value)) < 1_000


def test_opening_is_guarded_too() -> None:
    class Failing(Settings):
        def open(self) -> Driver:
            raise SystemExit(0)

    with pytest.raises(DriverError, match="sick board failed in open: SystemExit: 0"):
        open_driver(Failing(raising(SystemExit())))


def test_a_text_that_cannot_be_had_is_no_way_out() -> None:
    with pytest.raises(DriverError, match="Unspeakable: its text cannot be had: SystemExit"):
        driver(raising(Unspeakable())).load()


def test_what_a_driver_may_raise_stays_what_it_is() -> None:
    for error in (DeviceMissingError("Gone.", "Look."), CommandError("servo 9")):
        with pytest.raises(type(error)) as raised:
            driver(raising(error)).load()
        assert raised.value is error


def test_ctrl_c_comes_through_where_it_comes_from() -> None:
    with pytest.raises(KeyboardInterrupt):
        driver(raising(KeyboardInterrupt())).load()
    raised: list[BaseException] = []

    def read() -> None:
        try:
            driver(raising(KeyboardInterrupt())).load()
        except BaseException as error:
            raised.append(error)

    thread = threading.Thread(target=read)
    thread.start()
    thread.join()
    assert isinstance(raised[0], DriverError)


@given(st.sampled_from(["acceleration", "raw", "scan"]), st.integers(0, 2), NOT_FINITE)
def test_one_number_that_is_not_finite_spoils_the_sample(
    method: str, place: int, bad: float
) -> None:
    sample = [0.0, 0.0, 1.0]
    assert list(getattr(driver(lambda: sample), method)()) == sample
    sample[place] = bad
    with pytest.raises(DeviceDataError, match=r"sick board gave .*, which is no finite"):
        getattr(driver(lambda: sample), method)()


@given(st.sampled_from(["load", "distance", "seconds_for"]), NOT_FINITE | st.text())
def test_neither_does_a_single_one_pass(method: str, bad: Any) -> None:
    with pytest.raises(DeviceDataError, match="no finite number"):
        getattr(driver(lambda: bad), method)()


@pytest.mark.parametrize(
    ("method", "bad"),
    [
        ("acceleration", None),
        ("acceleration", (0.0, 1.0)),
        ("scan", 1.0),
        ("load", None),
        ("load", 10**400),
        ("read_counts", None),
        ("read_counts", {1: math.nan}),
        ("read_counts", {1: 127.5}),
    ],
)
def test_what_is_no_sample_at_all_is_refused(method: str, bad: Any) -> None:
    with pytest.raises(DeviceDataError, match="The sick board gave"):
        getattr(driver(lambda: bad), method)()


def test_what_is_right_comes_through() -> None:
    assert driver(lambda: None).distance() is None
    assert driver(lambda: 1).distance() == 1.0
    assert driver(lambda: True).load() is True
    assert driver(lambda: {3: 128}).read_counts([3]) == {3: 128}
    assert driver(lambda: [1]).verify({}) == [1]


def test_others_can_tell_which_driver_does_not_return() -> None:
    entered, free = threading.Event(), threading.Event()

    def hang() -> bool:
        entered.set()
        assert free.wait(60)
        return True

    sick = driver(hang)
    thread = threading.Thread(target=sick.load)
    thread.start()
    assert entered.wait(60)
    expected = "the driver of the sick board does not return from load"
    assert under_way(thread.ident) == expected
    assert under_way(threading.get_ident()) == ""
    free.set()
    thread.join()
    assert under_way(thread.ident) == ""
