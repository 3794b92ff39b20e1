"""Writes a diagnosis as a run directory, readable as any other: the body as it is by now.

Attachments are stated by the bodies that the diagnosis leaves of the identification's, and never as
surer than the searches of the identification vouch for. Few bodies stand for what was identified,
and none is the robot's exactly: where next to none is left, the diagnosis's readings count less.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from estimator.body.morphology import Array
from estimator.errors import EstimatorError
from estimator.identification.posterior_method import indistinguishable_in
from estimator.posterior.checks.verdict import STRIKING, have_sure_paths
from estimator.posterior.fitted import FittedPosterior
from estimator.posterior.indistinguishable import Indistinguishable
from estimator.posterior.model.sensor_data import COLUMNS, DENSITIES
from estimator.posterior.model.special import softmax
from estimator.posterior.posterior import Mode, Posterior
from estimator.posterior.summary import attachments_stated
from estimator.readings.observation import Observation
from estimator.storage.posteriors import (
    AttachmentsStated,
    PredictedInteraction,
    StoredChange,
    StoredPosterior,
    UnexplainedInteraction,
)
from estimator.storage.records import Counters
from estimator.storage.store import RunStore
from estimator.use.diagnosis import Diagnosis, Verdict, said
from estimator.use.weighing_changes import ChangeParticles, ChangeWeigher

_SAMPLES: Final = 256
_UNEXPLAINED: Final = 0.5  # probability of an outlier
_FEW_BODIES: Final = 5.0  # effective bodies of the identification, fewer of which say little
_LEAST_POWER: Final = 0.3  # to which the readings' likelihood is taken, so that more count


def write_run(
    directory: Path, store: RunStore, weigher: ChangeWeigher, diagnosis: Diagnosis, robot: str
) -> None:
    """Makes a run directory of what a diagnosis found: it holds all of that, or no run.

    Args:
        directory: The directory that is made.
        store: The run that identified the robot.
        weigher: Weigher that the diagnosis used.
        diagnosis: The diagnosis; it must name a change, or that nothing has changed.
        robot: Where the robot is.

    Raises:
        EstimatorError: The diagnosis names nothing.
        RunDirectoryError: There is a run already, or the directory cannot be made.
    """
    if diagnosis.verdict in (Verdict.NONE_OF_THESE, Verdict.UNDECIDED):
        raise EstimatorError(
            "nothing is named, so there is no body to go on with: look at the robot, and identify "
            "it anew"
        )
    observations = diagnosis.observations
    settings = store.settings.model_copy(
        update={"robot": robot, "interactions": max(1, len(observations)), "sure": None}
    )
    posteriors = []
    identified = replace(weigher.known, changes=())
    attached = partial(_attached, identified, indistinguishable_in(store, identified.predictor))
    for count in range(1, len(observations) + 1):
        seen = observations[:count]
        is_last = count == len(observations)
        weighed = diagnosis.weighed if is_last else weigher.weigh(seen)
        particles = diagnosis.changes[0] if is_last else weighed.particles[0]
        share = diagnosis.probability if is_last else float(weighed.probabilities[0])
        posteriors.append(_stored(weigher, particles, share, seen, attached))

    def fill(new: RunStore) -> None:
        for number, (observation, reason, posterior) in enumerate(
            zip(observations, diagnosis.reasons, posteriors, strict=True)
        ):
            new.plan(number, observation.angles, reason=reason)
            new.observe(number, observation)
            new.save_posterior(number, posterior, Counters(), None)

    client_id = str(uuid.uuid4())  # another run's requests must not be taken for this one's
    RunStore.create(directory, settings, store.capabilities, client_id, fill=fill).close()


def _attached(
    identified: FittedPosterior, indistinguishable: Indistinguishable, drawn: ChangeParticles
) -> AttachmentsStated:
    """What bodies that were drawn say of attachments; lengths are as they were identified."""
    old, summary = identified.posterior, identified.summary
    assert summary is not None
    total: Array = np.bincount(drawn.rows, drawn.weights, minlength=len(identified)).astype(float)
    left = np.flatnonzero(total)
    values, weights = old.values[left], total[left]
    keys = identified.unknowns.keys(values)
    former, modes = {mode.attachments: mode for mode in old.modes}, []
    for key in dict.fromkeys(keys):
        own = np.flatnonzero([one == key for one in keys])
        ess = float(weights[own].sum() ** 2 / np.sum(weights[own] ** 2))
        known = former.get(key)
        modes.append(
            Mode(
                attachments=key,
                probability=min(1.0, float(weights[own].sum())),
                point=values[own[np.argmax(weights[own])]],
                ess=ess if known is None else min(ess, known.ess),
                found=(False,) * len(old.modes[0].found) if known is None else known.found,
            )
        )
    posterior = Posterior(
        values=values,
        scales=old.scales[left],
        weights=weights,
        modes=tuple(sorted(modes, key=lambda mode: -mode.probability)),
        adequate_fit=old.adequate_fit,
    )
    stated = attachments_stated(posterior, identified.predictor, indistinguishable)
    within, coverage = stated.probability_within_problem, min(stated.coverage, summary.coverage)
    return stated._replace(
        probability_within_problem=None if within is None else min(within, coverage),
        coverage=coverage,
        low_ess=stated.low_ess or summary.low_ess,
    )


def _stored(
    weigher: ChangeWeigher,
    one: ChangeParticles,
    probability: float,
    seen: tuple[Observation, ...],
    attached: Callable[[ChangeParticles], AttachmentsStated],
) -> StoredPosterior:
    """A change's bodies as the posterior after some movements."""
    known, old = weigher.known, weigher.known.summary
    assert old is not None
    spread = _spread(one)
    drawn = spread.drawn(_SAMPLES, 0.5)
    stated = attached(drawn)
    changes = tuple(
        change.model_copy(update={"amounts": tuple(np.array(change.amounts)[drawn.rows].tolist())})
        for change in old.changes
    )
    if one.change is not None:
        changes += (
            StoredChange(
                name=one.change.name,
                sentence=said(one, known),
                probability=probability,
                amounts=tuple(drawn.theta.tolist()),
            ),
        )
    predicted, unexplained = _predicted(weigher, drawn, seen)
    few_are_left = spread.effective_bodies < _FEW_BODIES
    return StoredPosterior(
        **stated._replace(low_ess=stated.low_ess or few_are_left)._asdict(),
        genes=tuple(map(tuple, known.samples[drawn.rows].tolist())),
        amounts={
            name: tuple(np.array(column)[drawn.rows].tolist())
            for name, column in old.amounts.items()
        },
        scales=tuple(map(tuple, weigher.scales(drawn).tolist())),
        weights=(1 / _SAMPLES,) * _SAMPLES,
        changes=changes,
        diagnosed=True,
        predicted=predicted,
        unexplained=unexplained,
        # what casts doubt on the identification does so on what is built on it
        noisy=old.noisy,
        contradicting=old.contradicting,
        too_early=old.too_early,
        misspecification_probability=old.misspecification_probability,
    )


def _spread(one: ChangeParticles) -> ChangeParticles:
    """Particles of which enough bodies are left, as far as their weights can be evened out."""
    logs = np.log(np.maximum(one.weights, 1e-300))
    for power in np.linspace(1.0, _LEAST_POWER, 15):
        spread = replace(one, weights=softmax(power * logs))
        if spread.effective_bodies >= _FEW_BODIES:
            break
    return spread


def _predicted(
    weigher: ChangeWeigher, drawn: ChangeParticles, seen: tuple[Observation, ...]
) -> tuple[tuple[PredictedInteraction, ...], tuple[UnexplainedInteraction, ...]]:
    """Each movement as the body of median amount predicts it, and movements left unexplained."""
    known = weigher.known
    middle = int(np.argsort(drawn.theta)[len(drawn) // 2])
    bodies, count = weigher.bodies(drawn), len(seen)
    likelihood = known.likelihood_of(seen)
    data = likelihood.data
    readings = known.predictor.read(bodies, np.full(count, middle), data.programs)
    misfits = likelihood.misfits_of_bodies(known.predictor, bodies)
    outliers = 1 - likelihood.inlier_share(misfits, scales=weigher.scales(drawn)).mean(axis=0)
    residuals = {
        name: density.standardised_residual(
            misfits[middle][:, COLUMNS[name]], data.observed[name], known.noise.of(name)
        )
        for name, density in DENSITIES.items()
    }
    counts = {name: data.observed[name].count for name in residuals}
    surely = np.flatnonzero(outliers > _UNEXPLAINED)  # of which none lands elsewhere by a trifle
    programs = data.programs[surely]
    surely = surely[have_sure_paths(known.predictor, bodies, drawn.weights, programs)]
    predicted = PredictedInteraction.each(readings, residuals, counts, outliers)
    return predicted, tuple(
        UnexplainedInteraction(
            interaction=at,
            sensors=tuple(name for name, values in residuals.items() if abs(values[at]) > STRIKING),
            residual=float(max(abs(values[at]) for values in residuals.values())),
        )
        for at in surely.tolist()
    )
