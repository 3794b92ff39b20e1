"""Bodies that deviate from a problem are fitted alike, whoever does it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from estimator.body.arrays import ACCELEROMETER, TOO_HIGH
from estimator.body.morphology import Array, Base
from estimator.executors import ThisProcess, WorkerProcesses
from estimator.physics.base import Pair
from estimator.physics.statics import StaticsPhysics
from estimator.posterior.checks.misspecification import (
    clearly_better,
    fit_alternatives,
    observable_deviations,
    outliers_left,
    probability_misspecified,
    with_consequence,
)
from estimator.posterior.model.deviations import (
    Alternative,
    Askew,
    Density,
    Deviation,
    Limp,
    OffCentre,
    OffZero,
    Thickness,
    TiltGain,
    TooHigh,
    Travel,
    TurnedHinge,
    TurnedMount,
    log_priors,
)
from estimator.posterior.model.likelihood import FORKS, GRAVITY_TILTS, Noise, apart
from estimator.posterior.model.sensor_data import SensorData
from estimator.posterior.model.unknowns import Predictor, Unknowns, deviating_points
from estimator.posterior.posterior import Mode, Posterior
from estimator.problem.genome import Genome
from estimator.problem.problem import Problem
from estimator.readings.observation import Observation, PredictedReadings
from tests.estimator.model_robot import PROBLEM
from tests.estimator.two_unknown_rows import CAP, MODALITIES, NOISE, draw, equally_likely, programs

POINT = np.array([0.1, 0.4, 0.5, 0.2, 0.6, 0.4, 0.5])
MOVED = programs(32, seed=5)
THICK = Thickness(text="parts {} times as thick", amount=2.0)
THICKER = Thickness(text="parts {} times as thick", amount=2.8)
ONE_THICK = Thickness(text="a thick leg", amount=2.5, part=1)
ASKEW = TurnedHinge(text="a turned hinge", part=0, about=0, amount=math.radians(30))
ROUND = TurnedHinge(text="a hinge turned about its axis", part=0, about=1, amount=1.0)
ASIDE = TurnedMount(text="a leg that points aside", part=0, amount=math.radians(30))
EXPLAINED = np.zeros(3)
LENGTH = 2  # of the part that deviates
DEAD = Limp(text="a dead servo", part=0)
OFF_ZERO = OffZero(text="a servo off its zero", part=0, amount=math.radians(12))
HEAVY = Density(text="heavy parts", amount=4.0)
OFF_CENTRE = OffCentre(text="a battery at one end", axis=0, amount=0.25)
TURNED = Askew(text="an accelerometer askew", column=ACCELEROMETER, amount=math.radians(6))
FAR = Travel(text="servos that turn too far", amount=1.1)
ONE_FAR = Travel(text="a servo that turns too far", amount=1.25, part=0)
STEEP = TiltGain(text="an accelerometer that feels too much", amount=1.1)
RAISED = TooHigh(text="a distance sensor that reads too much", column=TOO_HIGH, amount=0.005)
LOOKED_AT = (
    *(THICK, THICKER, ONE_THICK, ASKEW, ASIDE, DEAD),
    *(OFF_ZERO, HEAVY, OFF_CENTRE, TURNED, FAR, ONE_FAR, STEEP, RAISED),
)


fit = partial(fit_alternatives, workers=ThisProcess())


def around(point: np.ndarray) -> Posterior:
    values = np.tile(point, (12, 1))
    values[:, [2, 6]] = np.random.default_rng(1).uniform(0.3, 0.7, (12, 2))
    return equally_likely(values, point)


def explained_by(predictor: Predictor, data: SensorData) -> tuple[Alternative, ...]:
    return fit(around(POINT), predictor, data, NOISE, LOOKED_AT, reference=StaticsPhysics())


def felt_by(predictor: Predictor) -> SensorData:
    return draw(predictor, POINT, MOVED, np.random.default_rng(11), outlier=0.0)


def felt_by_one_with(deviation: Deviation, predictor: Predictor) -> SensorData:
    deviating, point = predictor.deviating([deviation]), deviating_points(POINT[None], 0)[0]
    return draw(deviating, point, MOVED, np.random.default_rng(11), outlier=0.0)


@pytest.mark.parametrize("true", LOOKED_AT, ids=lambda true: true.name)
def test_a_robot_that_departs_from_the_problem_is_noticed(
    predictor: Predictor, true: Deviation
) -> None:
    better = clearly_better(explained_by(predictor, felt_by_one_with(true, predictor)))
    assert better is not None
    assert better.text == true.text


@pytest.mark.parametrize("mistaken", [0.05, 0.95])
def test_a_departure_is_found_though_the_best_body_makes_up_for_it_by_a_length(
    predictor: Predictor, mistaken: float
) -> None:
    wrong = POINT.copy()
    wrong[LENGTH] = mistaken
    data = felt_by_one_with(ONE_FAR, predictor)
    posterior = equally_likely(np.tile(wrong, (12, 1)), wrong)
    (alternative,) = fit(posterior, predictor, data, NOISE, (ONE_FAR,), reference=StaticsPhysics())
    assert alternative.point[LENGTH] == pytest.approx(POINT[LENGTH], abs=0.05)


@pytest.mark.parametrize("size", [0.9, 1.3])
@pytest.mark.parametrize("kind", [ASIDE, ONE_FAR, RAISED], ids=lambda kind: kind.name)
def test_how_far_it_departs_is_found(predictor: Predictor, kind: Deviation, size: float) -> None:
    true = kind.sized(size)
    better = clearly_better(explained_by(predictor, felt_by_one_with(true, predictor)))
    assert better is not None
    assert better.text == true.text
    assert better.amount == pytest.approx(true.amount, rel=0.1)


def test_a_robot_that_does_not_is_not_suspected(predictor: Predictor) -> None:
    observed = felt_by(predictor)
    assert clearly_better(explained_by(predictor, observed)) is None
    left = {
        alternative.deviation.text
        for alternative in explained_by(predictor, observed)
        if alternative.is_left
    }
    assert left <= {HEAVY.text}  # one movement of 32 tells, and that may be an outlier


class Engine(StaticsPhysics):
    """Another engine: whatever it is asked, it says what one body of some deviation feels."""

    def __init__(self, deviation: Deviation, predictor: Predictor):
        super().__init__()
        self._deviating = predictor.deviating([deviation])

    def read(self, pairs: Sequence[Pair]) -> PredictedReadings:
        moved = np.array([program for _, program in pairs])
        return self._deviating.read_all(deviating_points(POINT[None], 0), moved)


@pytest.mark.parametrize(("said", "named"), [(OFF_ZERO, False), (OFF_CENTRE, True)])
def test_what_bodies_of_the_problem_feel_in_the_simulator_is_no_departure(
    predictor: Predictor, said: Deviation, named: bool
) -> None:
    data, reference = felt_by_one_with(OFF_ZERO, predictor), Engine(said, predictor)
    one = fit(around(POINT), predictor, data, NOISE, [OFF_ZERO], reference=reference)
    assert (clearly_better(one) is not None) == named


def test_a_rival_that_explains_the_readings_is_no_departure(predictor: Predictor) -> None:
    rival = POINT.copy()
    rival[5] = 0.1  # yaw instead of up
    data = draw(predictor, rival, MOVED, np.random.default_rng(11), outlier=0.0)
    alone = around(POINT)
    both = replace(alone, modes=(*alone.modes, Mode((1,), 0.3, rival, 12.0, (True, True))))
    gains = [
        max(
            alternative.gains.sum()
            for alternative in fit(
                one, predictor, data, NOISE, LOOKED_AT, reference=StaticsPhysics()
            )
        )
        for one in (alone, both)
    ]
    assert gains[0] > -5.0
    assert gains[1] < -10.0


def test_what_few_movements_cannot_tell_stays_a_doubt(predictor: Predictor) -> None:
    flat = replace(felt_by(predictor)[:1], programs=np.zeros((1, 4)))
    still = draw(predictor, POINT, flat.programs, np.random.default_rng(11), outlier=0.0)
    left = {
        alternative.deviation.text
        for alternative in explained_by(predictor, still)
        if alternative.is_left
    }
    assert ASKEW.text in left  # an axis shows when the leg interactions


def test_a_hinge_turned_about_its_own_axis_is_the_same_hinge(predictor: Predictor) -> None:
    assert observable_deviations((ASKEW, ROUND), POINT, predictor, MOVED, MODALITIES) == (ASKEW,)
    without_tilt = observable_deviations((TURNED, ROUND), POINT, predictor, MOVED, ("touch",))
    assert without_tilt == ()


def odds_departed(alternatives: Sequence[Alternative], outliers: Array) -> float:
    share = probability_misspecified(alternatives, outliers, NOISE)
    return share / (1 - share)


def test_what_departs_has_the_prior_s_share_until_movements_have_told(predictor: Predictor) -> None:
    fitted = explained_by(predictor, felt_by(predictor))
    unlearnt = [replace(alternative, gains=np.zeros(3), log_share=0.0) for alternative in fitted]
    assert probability_misspecified(unlearnt, np.zeros(0), NOISE) == pytest.approx(1 / 6)
    alone = replace(unlearnt[0], log_prior=0.0)
    assert probability_misspecified([alone], np.zeros(0), NOISE) == pytest.approx(1 / 6)
    present = [replace(alternative, gains=np.array([-3.0, 0.0, -4.0])) for alternative in unlearnt]
    one_left = [unlearnt[0], *present[1:]]
    one_size_left = [replace(unlearnt[0], log_share=-1.0), *present[1:]]
    others = odds_departed(present, EXPLAINED)
    assert 0.2 / 6 * 0.7**3 < others < 0.2 / 4 * 0.7**3
    one = odds_departed(one_left, EXPLAINED) - others
    families = [alternative.deviation.family for alternative in fitted]
    of_its_family = families.count(families[0])
    assert one == pytest.approx(0.8 / 5 / len(set(families)) / of_its_family, rel=0.05)
    assert odds_departed(one_size_left, EXPLAINED) - others < 0.5 * one
    clear = [replace(unlearnt[0], gains=np.full(3, 400.0)), *present[1:]]
    assert probability_misspecified(clear, EXPLAINED, NOISE) == pytest.approx(1.0)
    assert probability_misspecified((), np.ones(3), NOISE) == 0.0


def test_a_family_of_departures_is_as_probable_as_another_of_fewer(predictor: Predictor) -> None:
    turned = [replace(TURNED, amount=math.radians(degrees)) for degrees in (-30, -15, 15, 30)]
    both = {TURNED.family, THICK.family}
    assert len(both) == 2
    odds = []
    for left, refuted in (((THICK,), turned), (turned, (THICK,))):
        deviations = [*left, *refuted]
        gains = [0.0] * len(left) + [-20.0] * len(refuted)
        present = [
            Alternative(
                deviation=deviation, point=POINT, gains=np.array([gain]), log_prior=log_prior
            )
            for deviation, gain, log_prior in zip(
                deviations, gains, log_priors(deviations).tolist(), strict=True
            )
        ]
        odds.append(odds_departed(present, np.zeros(1)))
    assert odds[0] == pytest.approx(odds[1], rel=1e-6)


def test_what_no_body_explains_speaks_for_ways_that_are_not_looked_at(predictor: Predictor) -> None:
    present = [
        replace(one, gains=np.full(3, -9.0)) for one in explained_by(predictor, felt_by(predictor))
    ]
    shares = [
        probability_misspecified(present, np.repeat([1.0, 0.05, 0.0], counts), NOISE)
        for counts in ((0, 0, 6), (0, 1, 6), (1, 0, 6), (2, 0, 5), (1, 0, 16))
    ]
    explained, perhaps, one, two, one_of_many = shares
    assert explained < 0.006
    assert perhaps == pytest.approx(explained)  # 0.05 is what the mixture takes of any
    assert 0.2 < one < 0.5
    assert two > 0.9
    assert one_of_many < 0.02


def test_nothing_is_doubted_where_no_departure_can_be_felt(predictor: Predictor) -> None:
    observed = felt_by(predictor)
    assert fit(around(POINT), predictor, observed, NOISE, (), reference=StaticsPhysics()) == ()


def test_one_movement_that_only_a_departure_explains_is_no_outlier(predictor: Predictor) -> None:
    fitted = explained_by(predictor, felt_by(predictor))
    best = replace(fitted[0], gains=np.array([19.0, -0.5, 0.3, -1.0]))
    assert clearly_better([best, *fitted[1:]]) == best.deviation
    worse = replace(best, gains=np.array([19.0, -8.0, 0.3, -2.0]))
    assert clearly_better([worse, *fitted[1:]]) is None


ELSEWHERE = 1  # a movement in which parts twice as thick are observed by 5°


def one_ended_elsewhere(data: SensorData, predictor: Predictor) -> SensorData:
    thick = felt_by_one_with(THICK, predictor)
    observed = {name: replace(one, values=one.values.copy()) for name, one in data.observed.items()}
    for name, one in observed.items():
        one.values[ELSEWHERE] = thick.observed[name].values[ELSEWHERE]
    return replace(data, observed=observed)


def test_one_movement_that_ended_elsewhere_says_nothing(predictor: Predictor) -> None:
    data = one_ended_elsewhere(felt_by(predictor), predictor)
    assert clearly_better(explained_by(predictor, data)) is None


def test_a_departure_is_not_blamed_for_what_the_simulator_was_not_asked(
    predictor: Predictor,
) -> None:
    data = one_ended_elsewhere(felt_by_one_with(OFF_ZERO, predictor), predictor)
    for reference in (StaticsPhysics(), Engine(THICK, predictor)):
        (one,) = fit(around(POINT), predictor, data, NOISE, [OFF_ZERO], reference=reference)
        assert one.gains[ELSEWHERE] == pytest.approx(0.0, abs=2.0)  # neither explains it


def test_what_the_simulator_explains_speaks_for_no_other_robot(predictor: Predictor) -> None:
    data = one_ended_elsewhere(felt_by(predictor), predictor)
    by_statics = np.zeros(len(data))
    by_statics[ELSEWHERE] = 1.0
    for reference, left in ((StaticsPhysics(), 1.0), (Engine(THICK, predictor), 0.0)):
        outliers = outliers_left(
            by_statics, around(POINT), predictor, data, NOISE, reference=reference
        )
        assert outliers[ELSEWHERE] == pytest.approx(left, abs=0.01)
        assert not np.delete(outliers, ELSEWHERE).any()


def test_a_departure_is_named_with_what_it_means_for_lengths_outside_their_intervals() -> None:
    spread = np.array([[-0.003], [0.0], [0.003]])
    summarised = np.array([0.2, 0.1]) + spread * [1.0, 20.0]  # the second is hardly known
    for lengths, said in (
        ([0.212, 0.1], "parts 2 times as thick (then legs are up to 12 mm longer)"),
        ([0.188, 0.12], "parts 2 times as thick (then legs are up to 12 mm shorter)"),
        ([0.201, 0.12], "parts 2 times as thick"),
        ([0.204, 0.1], "parts 2 times as thick"),  # not worth saying
    ):
        assert with_consequence(THICK, np.array(lengths), summarised) == said


def test_a_single_unknown_length_can_be_doubted() -> None:
    first, *others = PROBLEM.split("length = [0.05, 0.25]")
    text = first + "length = [0.05, 0.25]" + "length = 0.15".join(others)
    genome = Genome(Problem.parse(text, "one length"), Base(size=(0.14, 0.14, 0.085), mass=1.0))
    predictor, point = Predictor(Unknowns(genome), StaticsPhysics()), np.array([0.5])
    data = draw(predictor, point, MOVED, np.random.default_rng(11), outlier=0.0)
    alone = equally_likely(np.full((12, 1), 0.5), point)
    (alternative,) = fit(alone, predictor, data, NOISE, [THICK], reference=StaticsPhysics())
    assert alternative.deviation.text == THICK.text
    assert alternative.gain < 0


@pytest.mark.parametrize("mistaken", [(0.5, 0.92), (0.99, 0.99), (0.05, 0.05)])
def test_lengths_of_a_whole_leg_that_make_up_for_a_departure_are_undone(
    mistaken: tuple[float, float],
) -> None:
    base = Base(size=(0.14, 0.14, 0.085), mass=1.0)
    predictor = Predictor(Unknowns(Genome(Problem.load("parametric"), base)), StaticsPhysics())
    true = np.array([0.3, 0.7, 0.73, 0.71, 0.3, 0.35, 0.34, 0.35])
    wrong, leg = true.copy(), [0, 4]  # upper and lower part
    wrong[leg] = mistaken
    moved = np.zeros((7, 8))  # chosen by a run that was deceived
    moved[:, :4] = np.radians(
        [
            (-23, -27, 13, -23),
            (-26, -8, -29, 13),
            (23, -29, 22, -16),
            (-30, -30, -27, -7),
            (-15, -30, -1, -27),
            (-23, -17, -7, 3),
            (23, -16, -7, -29),
        ]
    )
    far = Travel(text="a servo that turns too far", amount=1.2, part=0)
    deviating, rng = predictor.deviating([far]), np.random.default_rng(11)
    data = draw(deviating, deviating_points(true[None], 0, 1.4)[0], moved, rng, outlier=0.0)
    posterior = equally_likely(np.tile(wrong, (12, 1)), wrong)
    noise = Noise(tilt=0.0063, clearance=0.0013)
    (alternative,) = fit(posterior, predictor, data, noise, (far,), reference=StaticsPhysics())
    assert alternative.point[leg].sum() == pytest.approx(true[leg].sum(), abs=0.1)
    assert alternative.deviation.amount == pytest.approx(far.sized(1.4).amount, abs=0.05)


def observation(readings: PredictedReadings, row: int, program: Array) -> Observation:
    return Observation(
        angles=tuple(program.tolist()),
        touch=tuple(bool(bit) for bit in readings.touch[row]),
        tilt=(float(readings.tilt[row, 0]), float(readings.tilt[row, 1])),
        clearance=float(readings.clearance[row]),
    )


def test_to_which_side_a_body_falls_speaks_for_no_departure() -> None:
    genome = Genome(Problem.parse(PROBLEM, "legs"), Base(size=(0.14, 0.14, 0.085), mass=1.0))
    predictor, point = Predictor(Unknowns(genome), StaticsPhysics()), np.full(4, 0.85)
    moved = np.random.default_rng(0).uniform(-0.5, 0.5, (4000, 4))
    observed = [
        predictor.read_all(point[None], moved, np.tile(lean, (4000, 1))) for lean in GRAVITY_TILTS
    ]
    plumb, *leaning = observed
    turned = [apart(plumb, one, NOISE) for one in leaning]
    narrow = np.flatnonzero(turned[-1] & ~np.any(turned[: len(FORKS)], axis=0))[:3]
    sure = np.flatnonzero(~np.any(turned, axis=0))[:6]
    assert (len(narrow), len(sure)) == (3, 6)
    data = SensorData.of(
        [
            observation(readings, row, moved[row])
            for readings, rows in ((leaning[-1], narrow), (plumb, sure))
            for row in rows.tolist()
        ],
        MODALITIES,
        CAP,
    )
    alone = equally_likely(np.tile(point, (12, 1)), point)
    aside = [
        OffCentre(text="a battery at one side", axis=axis, amount=amount)
        for axis in (0, 1)
        for amount in (-0.05, 0.05)
    ]
    left = fit(alone, predictor, data, NOISE, aside, reference=StaticsPhysics())
    assert clearly_better(left) is None
    assert left[0].gain < 1


def test_who_fits_what_departs_makes_no_difference(predictor: Predictor) -> None:
    data, few = felt_by(predictor), (THICK, ASKEW, DEAD, HEAVY)
    fitted, costs = [], []
    with WorkerProcesses(1) as another:
        for workers in (ThisProcess(), another):
            counting, reference = Predictor(predictor.unknowns, StaticsPhysics()), StaticsPhysics()
            fitted.append(
                fit_alternatives(
                    *(around(POINT), counting, data, NOISE, few),
                    reference=reference,
                    workers=workers,
                )
            )
            costs.append(counting.simulations)
    one, other = fitted
    assert [alternative.deviation for alternative in one] == [
        alternative.deviation for alternative in other
    ]
    assert all(np.array_equal(a.gains, b.gains) for a, b in zip(one, other, strict=True))
    assert costs[0] == costs[1] > 1000
