"""``import estimator``: cheap, and its names are those that a program needs."""

import subprocess
import sys

import pytest

import estimator


def test_importing_it_loads_no_library() -> None:
    """Nor does asking for a name load what that name has no use for."""
    program = (
        "import sys, estimator; print(sorted(sys.modules)); estimator.EstimatorError;"
        "print('numpy' in sys.modules); estimator.Problem; print('numba' in sys.modules)"
    )
    printed = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=300
    ).stdout.splitlines()
    for library in ("numpy", "scipy", "numba", "pydantic", "pybullet", "zmq", "msgpack"):
        assert f"'{library}'" not in printed[0]
    assert printed[1:] == ["False", "False"]


@pytest.mark.parametrize("name", estimator.__all__)
def test_every_name_is_there_and_explained(name: str) -> None:
    value = getattr(estimator, name)
    assert name in dir(estimator)
    if not name.isupper() and name != "Pair":
        assert value.__name__ == name
        assert value.__doc__


def test_any_other_name_is_an_ordinary_error() -> None:
    with pytest.raises(AttributeError, match="No estimator attribute identfy"):
        getattr(estimator, "identfy")  # noqa: B009 - a type checker knows that it is not there


@pytest.mark.parametrize(
    ("field", "registry"),
    [
        ("physics", estimator.BACKENDS),
        ("explore", estimator.RULES),
        ("search", estimator.SEARCHES),
        ("objective", estimator.OBJECTIVES),
    ],
)
def test_an_option_names_what_there_is(field: str, registry: estimator.Registry[object]) -> None:
    described = estimator.RunConfig.model_fields[field].description or ""
    for name in registry.own:
        assert name in described
