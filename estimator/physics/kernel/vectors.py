"""Vectors in the kernel: three numbers, which stay in registers."""

from __future__ import annotations

import math

from estimator.body.morphology import Array
from estimator.body.mounts import Vector
from estimator.physics.kernel.compiling import compiled


@compiled
def vector(array: Array) -> Vector:
    """The three numbers of an array."""
    return array[0], array[1], array[2]


@compiled
def at(points: Array, point: int) -> Vector:
    """Where a point is."""
    return points[0, point], points[1, point], points[2, point]


@compiled
def plus(a: Vector, b: Vector) -> Vector:
    """Their sum."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compiled
def minus(a: Vector, b: Vector) -> Vector:
    """The way from b to a."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def times(scale: float, a: Vector) -> Vector:
    """So many times a vector."""
    return scale * a[0], scale * a[1], scale * a[2]


@compiled
def dot(a: Vector, b: Vector) -> float:
    """Their inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def cross(a: Vector, b: Vector) -> Vector:
    """Their outer product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def unit(a: Vector) -> Vector:
    """The same direction, of length 1."""
    direction: Vector = times(1 / math.sqrt(dot(a, a)), a)
    return direction


@compiled
def turning(up: Vector, a: Vector, b: Vector) -> float:
    """Twice the area from 0 to a to b as seen along ``up``; above 0 for a turn to the left."""
    area: float = dot(up, cross(a, b))
    return area
