"""Performs a motor program so that no crash, on either side, loses it or does it twice unasked."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from estimator.errors import InteractionError
from estimator.identification.listener import Listener
from estimator.identification.robot_link import RobotLink
from estimator.readings.observation import Observation
from estimator.storage.records import InteractionRecord, Ticket
from protocol.errors import RobotError, RobotRestartedError, RobotUnreachableError

Commit = Callable[[Ticket | None], None]
"""Puts on disk under which ticket a motor program is about to be asked for."""


def carry_out(
    link: RobotLink, number: int, planned: InteractionRecord, commit: Commit, listener: Listener
) -> Observation:
    """Performs a motor program, or finds out what became of it.

    Args:
        link: The robot.
        number: Number of the interaction.
        planned: Its motor program; with a ticket when an earlier process asked for it.
        commit: Called before every request, and with ``None`` once a request has failed for good.
        listener: Hears of the progress, and is asked before a retry.

    Raises:
        InteractionError: The robot did not do it; the message says what happened and what to do.
    """
    try:
        if planned.ticket is not None:
            observation = _ask_again(link, number, planned, listener)
            if observation is not None:
                return observation
        while True:
            try:
                ticket = link.ticket()
                commit(ticket)
                moving = partial(listener.moving, number)
                return link.perform(number, planned.program, ticket, moving)
            except RobotError as error:
                commit(None)
                if not (error.retryable and listener.may_retry(error)):
                    raise InteractionError(f"interaction {number + 1}: {error}") from error
    except RobotRestartedError as error:
        raise InteractionError(
            f"interaction {number + 1}: the robot's daemon restarted while the motion was under "
            "way, so nobody knows whether the robot moved. Resuming performs it again."
        ) from error
    except RobotUnreachableError as error:
        raise InteractionError(f"interaction {number + 1}: {error}") from error


def _ask_again(
    link: RobotLink, number: int, planned: InteractionRecord, listener: Listener
) -> Observation | None:
    """The outcome of a request whose answer an earlier process did not live to see."""
    assert planned.ticket is not None
    try:
        moving = partial(listener.moving, number)
        observation = link.outcome(planned.program, planned.ticket, moving)
    except RobotRestartedError:
        listener.say(
            f"Interaction {number + 1}: the robot's daemon restarted since it was asked for, so "
            "the motor program is performed anew."
        )
        return None
    except RobotError as error:
        listener.say(f"Interaction {number + 1} had failed ({error.message}); it is tried again.")
        return None
    if observation is None:
        listener.say(f"Interaction {number + 1} was never carried out; it is performed now.")
    else:
        listener.say(f"Interaction {number + 1} was under way; its outcome was still there.")
    return observation
