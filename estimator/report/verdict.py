"""Whether some body of the problem explains the readings, as sentences."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from estimator.storage.posteriors import (
    LARGEST_OUTLIER,
    MISSPECIFIED,
    SUFFICIENT_COVERAGE,
    SURE,
    FitVerdict,
    NotKnown,
    PosteriorSummary,
)
from estimator.storage.records import BestFit

_NEGLIGIBLE: Final = 1 - SURE
_MAX_CAUSES: Final = 3
_MIN_CAUSE_BITS: Final = 0.25  # bits about causes, from which on a movement tells them apart


def verdict_on_best_model(fit: BestFit, contradictions: Sequence[str] = ()) -> str:
    """Whether the best model of a population explains the readings, as sentences.

    Args:
        fit: How the model explains the readings.
        contradictions: Contradictions between the problem and what the robot states.
    """
    if contradictions:
        return f"{_not_the_robots(contradictions)} {verdict_on_best_model(fit)}"
    if fit.explained:
        return (
            f"The best model explains every interaction{_but_outliers(fit)}. Whether others do as "
            "well, only --method posterior says."
        )
    return (
        f"NO BODY LIKE THE BEST MODEL {', or '.join(_reasons(fit, fit.interactions))}. The search "
        "has not found the robot's body, or this problem does not allow it: --method posterior "
        "tells which."
    )


def verdict_on_posterior(
    summary: PosteriorSummary, contradictions: Sequence[str] = (), joints: Sequence[str] = ()
) -> str:
    """Whether some body of the problem explains the readings, as sentences.

    Args:
        summary: What is stated of the posterior.
        contradictions: Contradictions between the problem and what the robot states.
        joints: Names of the joints, in motor order.
    """
    if contradictions:
        return f"{_not_the_robots(contradictions)} {verdict_on_posterior(summary, (), joints)}"
    if summary.explained:
        reservation = _but_outliers(summary)
        if summary.not_known is NotKnown.POOR_FIT:
            reservation += (
                ", but poorly: a better one may have been missed, the problem may be another "
                "robot's, or the sensors noisier than announced"
            )
        return (
            f"Some body that this problem allows explains every interaction{reservation}"
            f"{_otherwise(summary)}.{_what_tells(summary, joints)}"
        )
    reasons = _reasons(summary, len(summary.predicted))
    if summary.overturned is not None:
        reasons.append(
            f"explains both interactions 1 to {summary.overturned + 1}, after which another was "
            "sure, and those since, so the robot may have changed on the way"
        )
    if summary.misspecification_probability >= MISSPECIFIED:
        reasons.append(
            "is as probable as that the robot is built otherwise, or has changed on the way "
            f"({100 * summary.misspecification_probability:.0f} %)"
        )
    clauses = ", or ".join(reasons)
    if summary.coverage < SUFFICIENT_COVERAGE:
        return (
            f"NO BODY THAT WAS FOUND {clauses}. But the searches found different ones, so that a "
            "better one may have been missed: more movements help, and a problem that leaves less "
            "open."
        )
    otherwise = _otherwise(summary).removeprefix(", ")
    best = f" The one that explains most is {otherwise}." if otherwise else ""
    return f"NO BODY THAT THIS PROBLEM ALLOWS {clauses}.{best}"


def _otherwise(summary: PosteriorSummary) -> str:
    """Clause: what the robot has otherwise than its problem says, or which causes compete."""
    competing = not summary.knows_cause(SURE)
    causes = [cause for cause in summary.causes if cause.probability > _NEGLIGIBLE][:_MAX_CAUSES]
    causes = causes or list(summary.causes[:1] if competing else ())
    if not causes:
        return ""
    # Where no body explains the readings, probabilities are shares of what the table holds.
    unlisted = summary.misspecification_probability if summary.explained else 0.0

    def percent(share: float) -> str:
        return f"{100 * share * (1 - unlisted):.0f} %"

    words = [f"{cause.sentence} ({percent(cause.probability)}: {cause.check})" for cause in causes]
    if unlisted > _NEGLIGIBLE:
        words.append(f"something that no check looks for ({100 * unlisted:.0f} %)")
    stated = summary.probability_as_stated
    if stated <= _NEGLIGIBLE:
        return f", on a robot that is not as the problem says: it has {' or '.join(words)}"
    differs = f"has {' or '.join(words)}"
    as_stated = f"is as the problem says ({percent(stated)})"
    stated_first = stated >= causes[0].probability
    clauses = f"{as_stated}, or {differs}" if stated_first else f"{differs}, or {as_stated}"
    return f", on a robot that {clauses}"


def _what_tells(summary: PosteriorSummary, joints: Sequence[str]) -> str:
    movement = summary.next_movement
    if movement is None or not movement.bits_about_causes or summary.knows_cause(SURE):
        return ""
    if movement.bits_about_causes < _MIN_CAUSE_BITS:
        return " No movement was found that tells them apart."
    return f" A movement that tells them apart: {program_in_words(movement.program, joints)}."


def program_in_words(program: Sequence[float], joints: Sequence[str]) -> str:
    """Target angles of the joints that move, degrees.

    Args:
        program: Target angles, rad, in motor order.
        joints: Names of the joints, in motor order.
    """
    return ", ".join(
        f"{name} to {math.degrees(angle):+.0f}°"
        for name, angle in zip(joints, program, strict=True)
        if angle
    )


def _not_the_robots(contradictions: Sequence[str]) -> str:
    return f"THIS PROBLEM IS NOT THE ROBOT'S: {'; '.join(contradictions)}."


def _but_outliers(fit: FitVerdict) -> str:
    if not fit.unexplained:
        return ""
    number = fit.unexplained[0].interaction + 1
    return f" but interaction {number}, an outlier or a fault that came or went"


def _reasons(fit: FitVerdict, interactions: int) -> list[str]:
    """Clauses: what a body leaves unexplained, out of so many interactions."""
    reasons = []
    numbers = [str(item.interaction + 1) for item in fit.unexplained]
    if not fit.has_only_outliers(interactions):
        sensors = sorted({name for item in fit.unexplained for name in item.sensors})
        misfits = f"interactions {', '.join(numbers[:-1])} and {numbers[-1]}"
        where = f" ({', '.join(sensors)})" if sensors else ""
        if len(numbers) == 1:
            misfits = f"interaction {numbers[0]}" + (", the only one" if interactions == 1 else "")
            (only,) = fit.unexplained
            if only.residual > LARGEST_OUTLIER:
                where += (
                    ", in which something happened that this model does not contain: readings lie "
                    f"{only.residual:.0f} standard deviations off"
                )
        reasons.append(f"explains {misfits}{where}")
    if fit.noisy:
        reasons.append(
            f"explains {' and '.join(fit.noisy)} without more than twice the noise that is expected"
        )
    if fit.contradicting:
        is_plural = len(fit.contradicting) > 1
        numbered = " and ".join(str(sensor + 1) for sensor in fit.contradicting)
        measured = f"sensors {numbered} measure" if is_plural else f"sensor {numbered} measures"
        reasons.append(f"explains what touch {measured}")
    return reasons
