"""Act, sense, model: the estimation-exploration loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import ExitStack, closing
from functools import cache, partial

from estimator.errors import InteractionError
from estimator.exploration.rules import Choice
from estimator.identification.method import Listener, Method
from estimator.identification.robot_link import RobotLink
from estimator.readings.observation import Observation
from estimator.storage.records import InteractionRecord, Ticket
from estimator.storage.store import RunStore
from protocol.errors import RobotError, RobotRestartedError, RobotUnreachableError

Connect = Callable[[], RobotLink]
"""Reaches the robot when it is first needed."""


def go_through(
    store: RunStore,
    method: Method,
    *,
    choose: Callable[[], Choice],
    connect: Connect,
    listener: Listener,
    after_iteration: Callable[[], object],
) -> None:
    """Takes a run from where its store says that it stands through all interactions to its end.

    Args:
        store: The run's memory; opened for writing.
        method: Learns from each interaction.
        choose: Chooses the next motor program, by what the method knows so far.
        connect: Reaches the robot; called at most once, and not at all when every interaction is
            done already.
        listener: Hears what happens.
        after_iteration: Called whenever something was learnt, and another interaction follows.

    Raises:
        InteractionError: The robot did not do its part; a further call goes on.
    """
    observations, numbers = list[Observation](), range(store.settings.interactions)
    listener.expect(sum(map(method.work, numbers)), sum(map(method.done, numbers)))
    with ExitStack() as stack:
        linked = cache(lambda: stack.enter_context(closing(connect())))
        for number in numbers:
            observations.append(_act(store, number, linked, choose, listener))
            news = method.done(number) < method.work(number)
            method.learn(number, observations)
            if number == numbers[-1] or method.is_sure(number):
                break
            if news:
                after_iteration()
    method.finish(observations)


def _act(
    store: RunStore,
    number: int,
    linked: Connect,
    choose: Callable[[], Choice],
    listener: Listener,
) -> Observation:
    """Observation of an interaction, which is performed if it was not yet."""
    interactions = store.interactions()
    planned = interactions[number] if number < len(interactions) else None
    if planned is not None and planned.observation is not None:
        return planned.observation
    link = linked()
    if planned is None:
        choice = _choice(store, number, link, choose)
        planned = InteractionRecord(program=choice.program, reason=choice.reason, bits=choice.bits)
        store.plan(number, choice.program, reason=choice.reason, bits=choice.bits)
    if planned.reason:
        listener.chosen(number, planned.reason, planned.bits)
    observation = carry_out(link, number, planned, partial(store.ask, number), listener)
    store.observe(number, observation)
    listener.observed(number, observation)
    return observation


def _choice(store: RunStore, number: int, link: RobotLink, choose: Callable[[], Choice]) -> Choice:
    if link.recorded is None:
        if reason := _why_in_the_zero_pose(store, number):
            return Choice(program=(0.0,) * len(store.capabilities.joints), reason=reason)
        return choose()
    if number >= len(link.recorded):
        raise InteractionError(
            f"interaction {number + 1} was never recorded: the record holds "
            f"{len(link.recorded)}. Add it to the record and resume."
        )
    return Choice(program=link.recorded[number])


def _why_in_the_zero_pose(store: RunStore, number: int) -> str:
    """Why an interaction is one that moves nothing; empty: it is not.

    Before each motion the robot is in its zero pose. Where it leans there, an interaction in that
    pose tells how the accelerometer is turned, or the ground slopes.
    """
    if number == 0 and store.problem.reads_flat_first:
        return "reads the accelerometer's own tilt while the robot lies flat"
    weighs_it = store.settings.keeps_samples and store.problem.reads_zero_pose
    if number == 1 and weighs_it and any(store.interactions()[0].program):
        lean = math.degrees(store.problem.supposed.lean)
        return (
            f"moves nothing, since the robot leans by {lean:.1f}° in its zero pose: the ground "
            "slopes, or the accelerometer is turned"
        )
    return ""


Commit = Callable[[Ticket | None], None]
"""Commits the ticket under which a motor program is about to be asked for."""


def carry_out(
    link: RobotLink, number: int, planned: InteractionRecord, commit: Commit, listener: Listener
) -> Observation:
    """Performs a motor program, or finds out what became of it.

    Args:
        link: The robot.
        number: Number of the interaction.
        planned: Record of its motor program; with a ticket when an earlier process asked for it.
        commit: Called before every request, and with ``None`` once a request has failed for good.
        listener: Hears of the progress, and is asked before a retry.

    Raises:
        InteractionError: The robot did not perform the program; the message says what happened and
            what to do.
    """
    try:
        if planned.ticket is not None:
            observation = _ask_again(link, number, planned, listener)
            if observation is not None:
                return observation
        while True:
            try:
                ticket = link.ticket()
                if ticket is not None:
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
            "way, so nobody knows whether the robot moved. Going on performs it again."
        ) from error
    except RobotUnreachableError as error:
        raise InteractionError(f"interaction {number + 1}: {error}") from error


def _ask_again(
    link: RobotLink, number: int, planned: InteractionRecord, listener: Listener
) -> Observation | None:
    """Outcome of a request of an earlier process, which ended before the answer came."""
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
