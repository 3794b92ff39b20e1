"""The outcome of a run, from what its store holds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

import numpy as np

from estimator.body.arrays import Bodies
from estimator.body.limbs import driven_limbs, leg_lengths
from estimator.body.morphology import BASE, Array, Morphology, Part
from estimator.identification.paper.reference_check import pairs_turned
from estimator.posterior.fitted import FittedPosterior
from estimator.problem.problem import Problem
from estimator.readings.observation import Observation, touched
from estimator.report.posterior_report import PosteriorReport, posterior_report
from estimator.report.range_ends import LengthAtEnd
from estimator.report.result import (
    MAIN_BODY,
    FitReport,
    LegResult,
    ModelResult,
    PartResult,
    ReferenceResult,
    Result,
    versions_of,
)
from estimator.report.verdict import verdict_on_best_model
from estimator.storage.records import BestFit, Counters, Finish
from estimator.storage.store import RunStore
from protocol.wire.capabilities import Capabilities

_BEST_MODELS: Final = 10
_GUESSED: Final = 0.25  # of the median: a length with a wider interval is little more than guessed


def summarise(store: RunStore) -> Result:
    """The outcome of a run as far as it has come."""
    settings, capabilities, problem = store.settings, store.capabilities, store.problem
    observations, is_paper = store.observations(), not settings.keeps_samples
    latest, posteriors = store.latest_generation(), store.posteriors()
    counters = Counters() if latest is None else latest.counters
    if posteriors:
        counters = posteriors[-1][1]
    fitted, bodies, errors, samples = FittedPosterior.of(store), [], [], None
    if fitted is not None:
        listed = fitted.ranked[:_BEST_MODELS] if posteriors else fitted.ranked
        bodies = fitted.bodies_at(fitted.model_points[listed])
        errors = _errors(fitted)[: len(listed)]
        if posteriors:
            samples = fitted.genome.bodies(fitted.samples), fitted.weights
    end = store.search_end.finish()
    if end is not None:
        counters = counters.including(end, len(observations))
    legs = _legs(bodies, observations, capabilities, converges=not posteriors)
    posterior = None if fitted is None or not posteriors else posterior_report(store, fitted)
    error = errors[0][0] if errors else None
    is_diagnosed = bool(posteriors) and posteriors[-1][0].diagnosed
    guessed = () if is_diagnosed else _guessed(legs, posterior)  # whose lengths are of others
    at_ends = () if posterior is None else posterior.at_ends
    warnings = (
        *_contradictions(problem, capabilities),
        *_lean(problem, weighed=not is_paper and problem.reads_zero_pose),
        *map(_at_end, at_ends),
        *_warnings(guessed, observations),
    )
    if bodies and error is None and posterior is None:
        warnings = (
            "No model could be simulated, so nothing here says anything about the robot.",
            *warnings,
        )
    return Result(
        complete=store.complete,
        method=settings.method,
        problem=problem.name,
        problem_asked=settings.problem,
        searched=tuple(gene.name for gene in store.genome.genes),
        physics=settings.physics,
        reference=settings.reference,
        search=settings.search if is_paper else None,
        objective=settings.objective if is_paper else None,
        explore=settings.explore,
        modalities=settings.modalities,
        seed=settings.seed,
        population=settings.population if is_paper else None,
        generations=settings.generations if is_paper else None,
        versions=versions_of(store),
        robot_uri=settings.robot,
        robot=capabilities.to_map(),
        interactions=len(observations),
        simulations_requested=counters.simulations_requested,
        simulations_run=counters.simulations_run,
        simulations_invalid=counters.simulations_invalid if is_paper else None,
        simulations_undecided=counters.simulations_undecided if is_paper else None,
        steps=counters.steps,
        wall_seconds=counters.wall_seconds,
        sensor_error=error,
        legs=legs,
        best_models=tuple(
            _model(
                body,
                model_errors,
                problem,
                capabilities,
                samples,
            )
            for body, model_errors in list(zip(bodies, errors, strict=True))[:_BEST_MODELS]
        ),
        finish=_finish(end),
        fit=_fit(store),
        posterior=posterior,
        warnings=warnings,
    )


def _errors(fitted: FittedPosterior) -> list[tuple[float | None, float | None]]:
    """Subjective errors of the models, best first: those that count, and those of the search."""
    if fitted.errors is None or fitted.searched is None:
        return [(None, None)] * len(fitted.model_points)
    return [
        (finite(fitted.errors[row]), finite(fitted.searched[row])) for row in fitted.ranked.tolist()
    ]


def _finish(end: Finish | None) -> ReferenceResult | None:
    if end is None:
        return None
    turned, pairs = pairs_turned(end)
    return ReferenceResult(
        models=len(end.models),
        pairs=pairs,
        pairs_turned=turned,
        best_changed=bool(end.models) and int(np.argmin(end.simulated)) != 0,
    )


def _fit(store: RunStore) -> FitReport | None:
    fit = store.search_end.best_fit()
    if fit is None:
        return None
    contradictions = tuple(store.problem.contradictions(store.capabilities))
    return FitReport(
        **{name: getattr(fit, name) for name in BestFit.model_fields},
        contradictions=contradictions,
        verdict=verdict_on_best_model(fit, contradictions),
    )


def _legs(
    bodies: Sequence[Morphology],
    observations: Sequence[Observation],
    capabilities: Capabilities,
    *,
    converges: bool,
) -> tuple[LegResult, ...]:
    if not bodies:
        return ()
    lengths = leg_lengths(bodies if converges else bodies[:1])
    low, high = lengths.min(axis=0), lengths.max(axis=0)
    return tuple(
        LegResult(
            joint=_joint(limb.motor, capabilities) or "",
            mount=limb.mount,
            length_m=limb.length,
            population_m=(float(low[index]), float(high[index])) if converges else None,
            touched=touched(limb.sensors, observations),
        )
        for index, limb in enumerate(driven_limbs(bodies[0]))
    )


def _model(
    body: Morphology,
    errors: tuple[float | None, float | None],
    problem: Problem,
    capabilities: Capabilities,
    samples: tuple[Bodies, Array] | None,
) -> ModelResult:
    names = [rule.name for rule in problem.parts]
    return ModelResult(
        sensor_error=errors[0],
        searched_error=errors[1],
        leg_lengths_m=tuple(limb.length for limb in driven_limbs(body)),
        parts=tuple(
            PartResult(
                name=name,
                parent=MAIN_BODY if part.parent == BASE else names[part.parent],
                mount=body.mount(row).name,
                hinge=body.hinge(row).name,
                length_m=part.length,
                joint=_joint(part.motor, capabilities),
                agreement=None if samples is None else _agreement(row, part, *samples),
            )
            for row, (name, part) in enumerate(zip(names, body.parts, strict=True))
        ),
    )


def finite(error: float) -> float | None:
    """An error for JSON, which has no infinity: ``None`` in its place."""
    return float(error) if math.isfinite(error) else None


def _agreement(row: int, part: Part, samples: Bodies, weights: Array) -> float:
    """Weight of the samples that attach a part in the same way."""
    same = samples.parent[:, row] == part.parent
    same &= (samples.mount[:, row] == part.mount) & (samples.hinge[:, row] == part.hinge)
    return min(1.0, math.fsum(weights[same]))


def _joint(motor: int | None, capabilities: Capabilities) -> str | None:
    return None if motor is None else capabilities.joints[motor].name


def _contradictions(problem: Problem, capabilities: Capabilities) -> Iterator[str]:
    """Sentences about what the problem says otherwise than the robot."""
    for sentence in problem.differences(capabilities):
        yield f"{sentence[0].upper()}{sentence[1:]}."


def _lean(problem: Problem, *, weighed: bool) -> Iterator[str]:
    """What a lean in the zero pose means for the result."""
    if problem.supposed.lean:
        yield (
            f"In its zero pose the robot leaned by {math.degrees(problem.supposed.lean):.1f}°: put "
            "a spirit level on the ground and on the main body. "
        ) + (
            "Ground that slopes is taken for an accelerometer that is turned."
            if weighed
            else "Neither ground that slopes nor an accelerometer that is turned is weighed, so "
            "lengths may be wrong."
        )


def _at_end(length: LengthAtEnd) -> str:
    """The question that a length at an end of its range asks, and what to write in the problem."""
    parts, longer = " and ".join(length.parts), length.end == "longest"
    comparative = (
        f"{'longer' if longer else 'shorter'}{' together' if len(length.parts) > 1 else ''}"
    )
    return (
        f"May {parts} be {comparative} than {1000 * length.length_m:.1f} mm, the {length.end} that "
        "the problem allows? The readings press the length against this end of its range. If it "
        f"may, write a {'larger second' if longer else 'smaller first'} number into length = "
        "[shortest, longest] there, and identify the robot anew."
    )


def _guessed(legs: Sequence[LegResult], posterior: PosteriorReport | None) -> Iterator[str]:
    """Joints of legs that never touched the ground and whose lengths nothing else tells."""
    for index, leg in enumerate(legs):
        if leg.touched is False:
            length = None if posterior is None else posterior.lengths_m[index]
            if length is None or length.width > _GUESSED * length.median:
                yield leg.joint


def _warnings(guessed: Iterable[str], observations: Sequence[Observation]) -> tuple[str, ...]:
    warnings = [
        f"The leg at {joint} never touched the ground: its length is little more than a guess."
        for joint in guessed
    ]
    unsettled = [
        str(number)
        for number, item in enumerate(observations, 1)
        if not item.settled and item.tilt != (None, None)
    ]
    if unsettled:
        warnings.append(
            f"The robot was not at rest when interaction {', '.join(unsettled)} was read."
        )
    elif not all(item.settled for item in observations):
        warnings.append("The robot cannot tell whether it was at rest: it has no accelerometer.")
    at_end = sorted({name for item in observations for name in item.saturated_joints})
    if at_end:
        warnings.append(f"At the end of what they can reach stood, at times: {', '.join(at_end)}.")
    kinds = {name: kind for item in observations for name, kind in item.off_target.items()}
    for name, kind in kinds.items():  # each as it was last called: the robot knows most by then
        interactions = [
            str(number) for number, item in enumerate(observations, 1) if name in item.off_target
        ]
        warnings.append(
            f"The joint {name} is {kind}: it was not where it was sent in interaction "
            f"{', '.join(interactions)}."
        )
    return tuple(warnings)
