"""Implementations by name, of packages that are installed and of those that are not."""

import importlib
import json
from pathlib import Path

import pytest

from estimator import cluster
from estimator.errors import ClusterError, EstimatorError
from estimator.plugins import Registry, installed_packages, packages_named_when_failing
from tests.estimator.outside_package import install, put_on_path

NUMBERS: Registry[float] = Registry(
    kind="number", group="bodyschema.numbers", own={"pi": "math:pi", "e": "math:e"}
)


def test_our_own_come_first_and_need_no_package() -> None:
    assert NUMBERS.names() == ("pi", "e")
    assert NUMBERS.load("e") == pytest.approx(2.71828, abs=1e-5)
    assert NUMBERS.package("e") == {}
    assert NUMBERS.described("e") == "'e'"
    with pytest.raises(EstimatorError, match="there is no number 'tau': choose pi, e"):
        NUMBERS.check("tau")


def test_what_a_package_brings_is_imported_when_it_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    points = "[bodyschema.numbers]\ntau = math:tau\nbroken = no_such_module:x\n[other]\nx = y\n"
    put_on_path(install(tmp_path, points, name="circles", version="2.0"), monkeypatch)
    assert NUMBERS.names() == ("pi", "e", "broken", "tau")
    assert NUMBERS.load("tau") == 2 * NUMBERS.load("pi")
    assert NUMBERS.package("tau") == {"circles": "2.0"}
    NUMBERS.check("broken")  # imports nothing
    with pytest.raises(EstimatorError, match=r"'broken' of circles 2\.0 .*No module named 'no_suc"):
        NUMBERS.load("broken")


CIRCLES = """
import json

from estimator.errors import ClusterError


def parsed(text):
    return json.loads(text)


def lost(text):
    raise ClusterError(text)
"""


def test_only_what_others_bring_is_named_when_it_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    points = "[bodyschema.numbers]\ntau = circles.numbers:tau\n"
    put_on_path(install(tmp_path, points, name="circles", version="2.0", code=CIRCLES), monkeypatch)
    theirs = importlib.import_module("circles")
    sentence = r"^circles 2\.0 failed in .*circles\.py, line 8: JSONDecodeError: Expecting value: "
    with pytest.raises(EstimatorError, match=sentence), packages_named_when_failing():
        theirs.parsed("x")
    with pytest.raises(ValueError, match="Expecting value"), packages_named_when_failing():
        json.loads("x")  # a fault of ours, whose traceback is wanted
    with pytest.raises(ClusterError, match=r"^it is lost$"), packages_named_when_failing():
        theirs.lost("it is lost")


def test_a_cluster_must_have_the_packages_that_compute_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert installed_packages() == {}
    theirs = cluster._identity.__wrapped__()
    points = "[bodyschema.numbers]\ntau = math:tau\n"
    put_on_path(install(tmp_path, points, name="circles", version="2.0"), monkeypatch)
    assert installed_packages() == {"circles": "2.0"}
    with pytest.raises(EstimatorError, match=r"circles is missing there and 2\.0 here"):
        cluster._compare("Worker 1", theirs, cluster._identity.__wrapped__())


class Half:
    """A number that a program brings."""


def test_a_program_brings_implementations_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    registry: Registry[object] = Registry(
        kind="number", group="bodyschema.numbers", own={"pi": "math:pi"}
    )
    points = "[bodyschema.numbers]\ntau = math:tau\n"
    put_on_path(install(tmp_path, points, name="circles", version="2.0"), monkeypatch)
    name = f"{__name__}:Half"
    with pytest.raises(EstimatorError, match=f"{name}' is part of a program: let .* add it to its"):
        registry.check(name)
    assert registry.add(Half) == registry.add(Half) == name
    assert registry.names() == ("pi", name, "tau")
    registry.check(name)
    assert registry.load(name) is Half
    assert registry.package(name) == {name: "of the calling program"}


@pytest.mark.parametrize("nameless", [lambda: None, Half(), 0.5])
def test_what_nothing_could_find_again_is_refused(nameless: object) -> None:
    registry: Registry[object] = Registry(kind="number", group="bodyschema.numbers", own={})
    with pytest.raises(EstimatorError, match="cannot be the number, since nothing could find it"):
        registry.add(nameless)
