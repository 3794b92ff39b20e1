from __future__ import annotations

import inspect

from protocol.errors import BodyschemaError
from robot import errors


def test_the_drawn_tree_names_every_error() -> None:
    kinds = [kind for _, kind in inspect.getmembers(errors, inspect.isclass)]
    own = [kind for kind in kinds if kind.__module__ == errors.__name__]
    assert own
    for kind in own:
        assert issubclass(kind, BodyschemaError)
        assert f"── {kind.__name__}" in (errors.__doc__ or "")


def test_a_device_error_keeps_sentence_and_advice_apart() -> None:
    error = errors.DeviceTimeoutError("It is late.", "Wait.")
    assert (error.message, error.advice, str(error)) == (
        "It is late.",
        "Wait.",
        "It is late. Wait.",
    )


def test_a_late_device_is_not_taken_for_a_failed_link() -> None:
    assert not issubclass(errors.DeviceTimeoutError, OSError)


def test_a_config_error_names_file_key_and_reason() -> None:
    error = errors.ConfigError("must be positive", file="robot.toml", key="joints.speed")
    assert str(error) == "robot.toml: joints.speed: must be positive"
    assert str(errors.ConfigError("is empty", file="robot.toml")) == "robot.toml: is empty"
