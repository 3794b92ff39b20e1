"""Whether some body of the problem explains the readings, as sentences."""

from __future__ import annotations

from collections.abc import Sequence

from estimator.storage.beliefs import ACCIDENTS, AGREED, OTHERWISE, Belief, NotKnown


def verdict_on_fit(belief: Belief, contradictions: Sequence[str] = ()) -> str:
    """Whether some body of the problem explains the readings, as sentences.

    Args:
        belief: What is believed.
        contradictions: Between the problem and what the robot states.
    """
    if contradictions:
        listed = "; ".join(contradictions)
        return f"THIS PROBLEM IS NOT THE ROBOT'S: {listed}. {verdict_on_fit(belief)}"
    if belief.explained:
        rest = ""
        if belief.unexplained:
            number = belief.unexplained[0].interaction + 1
            rest = f" but interaction {number}, an accident or a fault that came or went"
        if belief.not_known is NotKnown.POOR_FIT:
            rest += (
                ", but poorly: a better one may have been missed, the problem may be another "
                "robot's, or the sensors noisier than announced"
            )
        return f"Some body that this problem allows explains every interaction{rest}."
    reasons = []
    numbers = [str(item.interaction + 1) for item in belief.unexplained]
    if numbers and (len(numbers) > ACCIDENTS or len(belief.foretold) <= ACCIDENTS):
        sensors = sorted({name for item in belief.unexplained for name in item.sensors})
        listed = f"interactions {', '.join(numbers[:-1])} and {numbers[-1]}"
        if len(numbers) == 1:
            listed = f"interaction {numbers[0]}, the only one"
        where = f" ({', '.join(sensors)})" if sensors else ""
        reasons.append(f"explains {listed}{where}")
    if belief.noisy:
        reasons.append(
            f"explains {' and '.join(belief.noisy)} without more than twice the noise that is "
            "expected"
        )
    if belief.contradicting:
        several = len(belief.contradicting) > 1
        those = " and ".join(str(sensor + 1) for sensor in belief.contradicting)
        felt = f"sensors {those} feel" if several else f"sensor {those} feels"
        reasons.append(f"explains what touch {felt}")
    if belief.overturned is not None:
        first = (
            "interaction 1"
            if not belief.overturned
            else f"interactions 1 to {belief.overturned + 1}"
        )
        reasons.append(
            f"explains both {first}, after which another was sure, and those since, so the robot "
            "may have changed on the way"
        )
    if belief.departure:
        reasons.append(
            f"explains the readings as well as one with {belief.departure}, so neither attachments "
            "nor lengths can be trusted"
        )
    elif belief.departed >= OTHERWISE:
        reasons.append(
            "is as probable as that the robot is built otherwise, or has changed on the way "
            f"({100 * belief.departed:.0f} %)"
        )
    listed = ", or ".join(reasons)
    if belief.met_in_common < AGREED:
        return (
            f"NO BODY THAT WAS FOUND {listed}. But the searches found different ones, so that a "
            "better one may have been missed: more movements help, and a problem that leaves less "
            "open."
        )
    return f"NO BODY THAT THIS PROBLEM ALLOWS {listed}."
