import pytest

from protocol.text import DEEPEST, TomlError, parse_toml


def test_what_is_fine_is_parsed() -> None:
    assert parse_toml("a = [[1], 2.5]\n[b.c]\nd = -9223372036854775808") == {
        "a": [[1], 2.5],
        "b": {"c": {"d": -(2**63)}},
    }


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a = " + "[" * 5000, "nested too deeply"),
        ("a = " + "[" * 100_000, "more than 10000 characters"),
        ("a = " + "[" * 400 + "]" * 400, "nested too deeply"),
        ("a = " + "[" * DEEPEST + "]" * DEEPEST, "nested too deeply"),
        ("a = " + "{ b = " * 1500, "nested too deeply"),
        (".".join("a" * 900) + " = 1", "nested too deeply"),
        (".".join("a" * 100_000) + " = 1", "more than 10000 characters"),
        ("a = " + "9" * 400, "more than 64 bits"),
        ("a = 0x" + "f" * 9000, "more than 64 bits"),
        ("a = [1, { b = -9223372036854775809 }]", "more than 64 bits"),
        ("a = " + "9" * 5000, "4300 digits"),
        ("a = 2026-02-31", "day is out of range|Invalid"),
        ("a = ", "Invalid value"),
    ],
)
def test_what_would_be_a_traceback_is_a_sentence(text: str, sentence: str) -> None:
    with pytest.raises(TomlError, match=sentence):
        parse_toml(text)
