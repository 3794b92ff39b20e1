"""Implementations by name: our own, and those that installed packages bring as entry points.

A package offers an implementation under a name in one of our entry-point groups::

    [project.entry-points."bodyschema.physics"]
    mujoco = "bodyschema_mujoco:MujocoPhysics"

Nothing is imported before it is asked for by name, so a package that is broken, or that lacks what
it needs, disturbs only those who want it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import metadata
from typing import Final, Generic, TypeVar, cast

from estimator.errors import EstimatorError

_GROUPS: Final = "bodyschema."
T = TypeVar("T")


def installed_packages() -> dict[str, str]:
    """Version by name of all packages that offer something in one of our entry-point groups."""
    versions: dict[str, str] = {}
    for package in metadata.distributions():
        if any(entry.group.startswith(_GROUPS) for entry in package.entry_points):
            versions.setdefault(package.name, package.version)  # the first on the path counts
    return versions


@dataclass(frozen=True, kw_only=True)
class Registry(Generic[T]):
    """The implementations of one seam.

    Attributes:
        kind: What they are, as a person says it, such as ``physics``.
        group: The entry-point group of those from elsewhere.
        own: Our own: ``module:attribute`` by name, the default first.
    """

    kind: str
    group: str
    own: Mapping[str, str]

    def names(self) -> tuple[str, ...]:
        """All names there are: our own, then those of installed packages."""
        theirs = sorted(metadata.entry_points(group=self.group).names - self.own.keys())
        return (*self.own, *theirs)

    def check(self, name: str) -> None:
        """Refuses a name that nothing has; imports nothing.

        Raises:
            EstimatorError: No implementation has this name, or more than one.
        """
        self._entry(name)

    def load(self, name: str) -> T:
        """Imports an implementation.

        Raises:
            EstimatorError: No implementation has this name, or more than one; or its import fails.
        """
        entry = self._entry(name)
        try:
            return cast(T, entry.load())
        except Exception as error:  # whatever a module of somebody else's raises
            raise EstimatorError(
                f"the {self.kind} {self.described(name)} cannot be loaded from {entry.value}: "
                f"{type(error).__name__}: {error}"
            ) from error

    def package(self, name: str) -> dict[str, str]:
        """Version by name of the package that an implementation comes from; empty if it is ours.

        Raises:
            EstimatorError: No implementation has this name, or more than one.
        """
        package = self._entry(name).dist
        return {} if package is None else {package.name: package.version}

    def described(self, name: str) -> str:
        """The name in quotes, and where it comes from unless it is ours: for error messages."""
        packages = " ".join(map(" ".join, self.package(name).items()))
        return f"{name!r} of {packages}" if packages else repr(name)

    def _entry(self, name: str) -> metadata.EntryPoint:
        entries = list(metadata.entry_points(group=self.group, name=name))
        if name in self.own:
            entries.insert(0, metadata.EntryPoint(name, self.own[name], self.group))
        if not entries:
            raise EstimatorError(
                f"there is no {self.kind} {name!r}: choose {', '.join(self.names())}"
            )
        if len(entries) > 1:
            packages = ["bodyschema" if item.dist is None else item.dist.name for item in entries]
            raise EstimatorError(
                f"there is more than one {self.kind} {name!r}: uninstall all but one of "
                f"{', '.join(packages)}"
            )
        return entries[0]
