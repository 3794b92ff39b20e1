"""The prediction error: how well models predict motor programs that they were not fitted to.

It needs no truth, so it is the measure on a real robot. The predictions of all models are on disk
before the first program is performed. Programs are predicted as they are commanded, so the robot's
rounding of angles counts as prediction error too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Final, TypeAlias

import numpy as np
from pydantic import BaseModel, ConfigDict

from estimator.body.morphology import Array
from estimator.errors import EstimatorError, InteractionError
from estimator.identification.loop import carry_out
from estimator.identification.method import Listener
from estimator.identification.record_link import commanded
from estimator.identification.robot_link import RobotLink
from estimator.physics.base import Physics
from estimator.posterior.fitted import FittedPosterior
from estimator.posterior.model.unknowns import Unknowns, simulated
from estimator.randomness import Stream, generator
from estimator.readings.modalities import MODALITIES
from estimator.readings.observation import Observation, PredictedReadings, Program, same_program
from estimator.storage.records import Prediction
from estimator.storage.store import RunStore
from protocol.text import command_line

BEST: Final = "best_model"
POPULATION: Final = "population_median"
RANDOM: Final = "random_models"
RANDOM_MODELS: Final = 50

PredictionErrors: TypeAlias = dict[str, float | None]
"""Mean errors over the programs by the modalities' ``error_name``; ``None`` where nothing could be
compared."""


class Validation(BaseModel):
    """Prediction errors on fresh motor programs.

    Attributes:
        programs: Number of programs performed.
        best_model: Errors of the best model.
        population_median: Median over the population of each model's errors.
        random_models: Median over models drawn at random of each model's errors, for comparison.
        invalid_predictions: Number of predictions of the three groups that could not be simulated
            and are left out.
        as_predicted: Number of programs after which every sensor read what the best model predicts,
            to the modality's ``error_limit``.
    """

    model_config = ConfigDict(frozen=True)

    programs: int
    best_model: PredictionErrors
    population_median: PredictionErrors
    random_models: PredictionErrors
    invalid_predictions: int
    as_predicted: int

    @property
    def groups(self) -> tuple[tuple[str, PredictionErrors], ...]:
        """The errors of each group of models, by its name."""
        return (
            ("best model", self.best_model),
            ("population, median", self.population_median),
            ("random models, median", self.random_models),
        )


def validate(
    store: RunStore,
    physics: Physics,
    link: RobotLink,
    *,
    programs: int,
    saved: Validation | None,
    listener: Listener,
) -> Validation:
    """Predicts motor programs, performs them and compares.

    A validation that was interrupted is continued; its predictions stand. So is one that had
    performed all programs and whose outcome was not saved: nothing moves then.

    Args:
        store: The run.
        physics: Back-end that predicts.
        link: The robot.
        programs: Number of programs of a new validation.
        saved: The outcome that was saved last; ``None`` where there is none.
        listener: Hears what happens.

    Raises:
        EstimatorError: The run has not ended, so that its models may yet change.
        InteractionError: The robot did not do its part; calling again goes on.
    """
    if not store.complete:
        raise EstimatorError(
            f"{store.directory} has not ended, and other models would be its result: go on with "
            f"`{command_line('estimator', 'resume', store.directory)}` first."
        )
    validations = store.validations.all()
    if validations and not _is_saved(validations[-1], saved):
        number, predictions = len(validations) - 1, validations[-1]
        listener.say(f"Going on with the predictions made before ({len(predictions)} programs).")
    else:
        number = len(validations)
        fresh_programs = _programs(store, link, programs, number)
        listener.expect(2 * len(fresh_programs), 0)
        predictions = _predict(store, physics, fresh_programs, listener)
        store.validations.predict(predictions)
    observations = []
    for index, prediction in enumerate(predictions):
        observation = prediction.observation
        if observation is None:
            commit = partial(store.validations.ask, number, index)
            row = _row(link, prediction.program, index)
            observation = carry_out(link, row, prediction, commit, listener)
            store.validations.observe(number, index, observation)
            listener.observed(index, observation)
            listener.worked(1, f"performed {index + 1} of {len(predictions)}")
        observations.append(observation)
    return compare(predictions, observations)


def _is_saved(predictions: Sequence[Prediction], saved: Validation | None) -> bool:
    """Whether all predicted programs were performed, and their outcome was saved."""
    seen = [item.observation for item in predictions if item.observation is not None]
    return len(seen) == len(predictions) and compare(predictions, seen) == saved


def compare(predictions: Sequence[Prediction], observations: Sequence[Observation]) -> Validation:
    """Prediction errors of the three groups of models."""
    groups = (BEST, POPULATION, RANDOM)
    arrays = {group: [_arrays(item.readings[group]) for item in predictions] for group in groups}
    return Validation(
        programs=len(observations),
        **{group: _median_errors(arrays[group], observations) for group in groups},
        invalid_predictions=sum(
            row is None
            for item in predictions
            for group in groups
            for row in next(iter(item.readings[group].values()))
        ),
        as_predicted=sum(map(_is_as_predicted, arrays[BEST], observations)),
    )


def _is_as_predicted(predicted: Mapping[str, Array], observation: Observation) -> bool:
    """Whether all sensors read what a model predicts; not if it predicts nothing."""
    is_compared = False
    for name, modality in MODALITIES.items():
        errors = modality.prediction_errors(predicted[name], observation)
        if np.any(errors > modality.error_limit):
            return False
        is_compared |= bool(np.any(~np.isnan(errors)))
    return is_compared


def _programs(store: RunStore, link: RobotLink, count: int, number: int) -> list[Program]:
    if link.recorded is None:
        rng = generator(store.settings.seed, Stream.VALIDATION, number)
        drawn = [store.problem.random_program(rng, store.capabilities) for _ in range(count)]
        return [tuple(program.tolist()) for program in drawn]
    fitted = [item.program for item in store.interactions()]
    fitted += [commanded(item.taken, link.capabilities) for item in store.observations()]
    fresh = [
        program
        for program in link.recorded
        if not any(same_program(program, one) for one in fitted)
    ]
    if count > len(fresh):
        fitted_count = len(link.recorded) - len(fresh)
        raise InteractionError(
            f"of the record's {len(link.recorded)} motor programs the models were fitted to "
            f"{fitted_count}, so {len(fresh)} are fresh, not {count}: "
            + ("ask for fewer --programs" if fresh else "take a record of others")
        )
    return fresh[:count]


def _row(link: RobotLink, program: Program, index: int) -> int:
    """Number under which a link performs a predicted motor program."""
    if link.recorded is None:
        return index
    if program not in link.recorded:
        raise InteractionError(
            "the record lacks a motor program that was predicted: take the one of the validation "
            "that was begun"
        )
    return link.recorded.index(program)


def _predict(
    store: RunStore,
    physics: Physics,
    programs: Sequence[Program],
    listener: Listener,
) -> list[Prediction]:
    fitted = FittedPosterior.of(store)
    best = None if fitted is None else fitted.best_point
    if fitted is None or best is None:
        raise EstimatorError(f"{store.directory} has no model yet: resume the run first")
    genome = fitted.genome
    rng = generator(store.settings.seed, Stream.RANDOM_MODELS)
    drawn = genome.permitted(rng.random((RANDOM_MODELS, genome.size)))
    groups = {
        BEST: (fitted.unknowns, best[None]),
        POPULATION: (fitted.unknowns, fitted.model_points),
        RANDOM: (Unknowns(genome), drawn),
    }
    predictions = []
    for program in programs:
        readings = {
            group: _plain(simulated(physics, unknowns, points, np.array([program])))
            for group, (unknowns, points) in groups.items()
        }
        predictions.append(Prediction(program=program, readings=readings))
        listener.worked(1, f"predicted {len(predictions)} of {len(programs)}")
    return predictions


def _plain(readings: PredictedReadings) -> dict[str, Any]:
    """Readings as lists for JSON; ``None`` where a simulation is invalid."""
    columns = {name: modality.predicted(readings) for name, modality in MODALITIES.items()}
    return {
        name: [
            row if valid else None for row, valid in zip(rows.tolist(), readings.valid, strict=True)
        ]
        for name, rows in columns.items()
    }


def _arrays(plain: Mapping[str, Any]) -> dict[str, Array]:
    """Stored readings as arrays of shape (models, values); NaN for ``None``."""
    arrays = {}
    for name, rows in plain.items():
        width = max((len(row) for row in rows if row is not None), default=1)
        missing = [math.nan] * width
        arrays[name] = np.array([missing if row is None else row for row in rows], dtype=float)
    return arrays


def _median_errors(
    predicted: Sequence[Mapping[str, Array]], observations: Sequence[Observation]
) -> PredictionErrors:
    """Mean error of each model over the programs, then the median over the models."""
    return {
        modality.error_name: _median_of_means(
            [
                modality.prediction_errors(arrays[name], observation)
                for arrays, observation in zip(predicted, observations, strict=True)
            ]
        )
        for name, modality in MODALITIES.items()
    }


def _median_of_means(errors: Sequence[Array]) -> float | None:
    """Median over models of mean errors, given per program, (models, values); NaN is left out."""
    all_errors = np.concatenate(errors, axis=1)
    counts = np.sum(~np.isnan(all_errors), axis=1)
    means = np.nansum(all_errors, axis=1)[counts > 0] / counts[counts > 0]
    return float(np.median(means)) if len(means) else None
