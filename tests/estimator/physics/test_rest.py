"""When simulations stop: what a look at the main body tells."""

from __future__ import annotations

import math

import pytest

from estimator.physics.base import WorldSettings
from estimator.physics.rest import MainBody, RestWatch

FINE = WorldSettings(step=1 / 240, rest_window=0.3)
LOOKS = 18  # in the window


def looks_until_rest(
    world: WorldSettings, *, speed: float = 0.0, tipping: float = 0.0, sinking: float = 0.0
) -> int:
    """How many looks it takes; 100 where that is not enough.

    Args:
        world: Its settings.
        speed: Along the ground, m/s.
        tipping: rad/s.
        sinking: m/s.
    """
    watch = RestWatch(world)
    for look in range(100):
        if watch.rests:
            return look
        time = look * watch.STEPS_PER_LOOK * world.step
        lean = 0.2 + tipping * time
        up = math.sin(lean), 0.0, math.cos(lean)
        spin = (0.0, tipping, 0.0)
        watch.look(MainBody((speed, 0.0, -sinking), spin, 0.1 - sinking * time, up))
    return 100


def test_with_fine_steps_what_creeps_along_the_ground_rests() -> None:
    assert looks_until_rest(FINE) == LOOKS + 1
    assert looks_until_rest(FINE, speed=0.01) == LOOKS + 1


@pytest.mark.parametrize("motion", [{"tipping": math.radians(0.3)}, {"sinking": 3e-4}])
def test_with_fine_steps_what_tips_or_sinks_slowly_does_not(motion: dict[str, float]) -> None:
    assert looks_until_rest(FINE, **motion) == 100


def test_with_coarse_steps_a_body_rests_that_hardly_moves() -> None:
    assert looks_until_rest(WorldSettings()) == 4
    assert looks_until_rest(WorldSettings(), speed=0.01) == 100


def test_where_all_steps_are_wanted_nothing_rests() -> None:
    assert looks_until_rest(WorldSettings(full_steps=True)) == 100
    assert looks_until_rest(WorldSettings(step=1 / 240, rest_window=0.3, full_steps=True)) == 100
