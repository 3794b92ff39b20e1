"""Implementations by name: our own, those of installed packages, and those of the calling program.

A package offers an implementation under a name in one of our entry-point groups::

    [project.entry-points."bodyschema.physics"]
    mujoco = "bodyschema_mujoco:MujocoPhysics"

Nothing is imported before it is asked for by name, so a package that is broken, or that lacks what
it needs, disturbs only those who want it.

A program that runs the estimator itself needs no entry point: it adds its class or function to the
registry, and asks for it by the name that ``Registry.add`` returns.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import lru_cache
from importlib import metadata
from traceback import walk_tb
from typing import Final, Generic, TypeVar, cast

from estimator.errors import EstimatorError, PluginError, RunDirectoryError
from protocol.errors import BodyschemaError
from protocol.text import error_text

_GROUPS: Final = "bodyschema."
_ADDED: Final = "of the calling program"  # takes the place of a package's version
T = TypeVar("T")


def installed_packages() -> dict[str, str]:
    """Version by name of all packages that offer something in one of our entry-point groups."""
    versions: dict[str, str] = {}
    for package in metadata.distributions():
        if any(entry.group.startswith(_GROUPS) for entry in package.entry_points):
            versions.setdefault(package.name, package.version)  # the first on the path counts
    return versions


def missing(packages: Mapping[str, str]) -> str:
    """Those packages, by name and version, that a run was made with and that are not installed."""
    installed = installed_packages()
    return ", ".join(
        f"{name} {version}"
        for name, version in packages.items()
        if version != _ADDED and name not in installed
    )


@contextmanager
def packages_named_when_failing() -> Iterator[None]:
    """Turns whatever code of an installed package raises in the block into a sentence on it.

    Errors of our own code stay as they are, as do those that are sentences already.

    Raises:
        EstimatorError: A package's code raised something, or something that it called.
    """
    try:
        yield
    except BodyschemaError:
        raise
    except Exception as error:
        for frame, line in reversed(list(walk_tb(error.__traceback__))):
            package = _package_of(frame.f_globals.get("__name__", ""))
            if package is not None:
                raise EstimatorError(
                    f"{package.name} {package.version} failed in {frame.f_code.co_filename}, line "
                    f"{line}: {error_text(error)}"
                ) from error
        raise


def _package_of(module: str) -> metadata.Distribution | None:
    """The package with an implementation in a module of this name, or in one beside it."""
    top = module.partition(".")[0]
    for package in metadata.distributions():
        for entry in package.entry_points:
            if entry.group.startswith(_GROUPS) and entry.module.partition(".")[0] == top:
                return package
    return None


def _entry_points(group: str) -> metadata.EntryPoints:
    """Entry points in a group, of all packages that are installed now."""
    changed = []
    for place in sys.path:
        with suppress(OSError):
            changed.append((place, os.stat(place or ".").st_mtime_ns))
    return _entry_points_of(tuple(changed), group)


@lru_cache(maxsize=16)  # a hundred packages take 15 ms, and a run asks twenty times
def _entry_points_of(changed: tuple[tuple[str, int], ...], group: str) -> metadata.EntryPoints:
    return metadata.entry_points(group=group)


@dataclass(frozen=True, kw_only=True)
class Registry(Generic[T]):
    """The implementations of one interface, by name.

    Attributes:
        kind: What the implementations are, as messages call it, such as ``physics``.
        group: Entry-point group of other packages' implementations.
        own: Our own implementations: ``module:attribute`` by name, the default first.
    """

    kind: str
    group: str
    own: Mapping[str, str]
    _added: dict[str, T] = field(default_factory=dict, init=False, repr=False, compare=False)

    def names(self) -> tuple[str, ...]:
        """All names there are: our own, the calling program's, those of installed packages."""
        implementations = {**self.own, **self._added}
        return (*implementations, *sorted(_entry_points(self.group).names - implementations.keys()))

    def add(self, implementation: T) -> str:
        """Adds an implementation of the calling program's own, as long as this process runs.

        It replaces one that was defined in the same place, as by a notebook's cell that is run
        again.

        Args:
            implementation: What an entry point of the group would refer to. Where worker processes
                use it, at the top level of a module that they can import.

        Returns:
            Name by which a run records it: where it is defined, or our name if it is one of ours.

        Raises:
            EstimatorError: It is not defined at the top level of a module.
        """
        place = getattr(implementation, "__qualname__", "")
        if not place.isidentifier():
            raise EstimatorError(
                f"{implementation!r} cannot be the {self.kind}, since nothing could find it again: "
                "give a class or function at the top level of a module"
            )
        name = f"{implementation.__module__}:{place}"
        for our_name, location in self.own.items():
            if location == name:
                return our_name
        self._added[name] = implementation
        return name

    def check(self, name: str) -> None:
        """Refuses a name that no implementation has; imports nothing.

        Raises:
            PluginError: No implementation has this name, or more than one.
        """
        if name not in self._added:
            self._entry(name)

    def load(self, name: str) -> T:
        """Imports an implementation, unless the calling program has added it.

        Raises:
            PluginError: No implementation has this name, or more than one.
            EstimatorError: Its import fails.
        """
        if name in self._added:
            return self._added[name]
        entry = self._entry(name)
        try:
            return cast(T, entry.load())
        except Exception as error:  # whatever a module of somebody else's raises
            raise EstimatorError(
                f"the {self.kind} {self.described(name)} cannot be loaded from {entry.value}: "
                f"{error_text(error)}"
            ) from error

    def package(self, name: str) -> dict[str, str]:
        """Version, by name, of the package that has an implementation; empty if it is ours.

        Raises:
            PluginError: No implementation has this name, or more than one.
        """
        if name in self._added:
            return {name: _ADDED}
        package = self._entry(name).dist
        return {} if package is None else {package.name: package.version}

    def described(self, name: str) -> str:
        """The name in quotes, and where it comes from unless it is ours: for error messages."""
        packages = " ".join(map(" ".join, self.package(name).items()))
        return f"{name!r} of {packages}" if packages else repr(name)

    def _entry(self, name: str) -> metadata.EntryPoint:
        entries = list(_entry_points(self.group).select(name=name))
        if name in self.own:
            entries.insert(0, metadata.EntryPoint(name, self.own[name], self.group))
        if not entries and ":" in name:
            raise RunDirectoryError(
                f"the {self.kind} {name!r} is part of a program: let that program go on with the "
                "run, and add it to its registry before"
            )
        if not entries:
            raise PluginError(f"there is no {self.kind} {name!r}: choose {', '.join(self.names())}")
        if len(entries) > 1:
            packages = ["bodyschema" if item.dist is None else item.dist.name for item in entries]
            raise PluginError(
                f"there is more than one {self.kind} {name!r}: uninstall all but one of "
                f"{', '.join(packages)}"
            )
        return entries[0]
