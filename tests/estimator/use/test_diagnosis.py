"""What has changed on a robot: noticed, named, and none of these, with statics as the robot."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from shutil import copytree
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from estimator import FittedPosterior, load
from estimator.body.arrays import Bodies
from estimator.cli import use
from estimator.cli.command_line import app
from estimator.exploration import best_programs
from estimator.posterior.model.likelihood import FORKS, GRAVITY_TILTS, apart
from estimator.readings.observation import Observation, Program
from estimator.storage.database import holds_run
from estimator.storage.posteriors import LOW_ESS, StoredMode, StoredPosterior
from estimator.storage.records import Counters
from estimator.storage.store import RunStore
from estimator.use import competitor, movements, surprise
from estimator.use.detectable_changes import DetectableChange, detectable_changes_of
from estimator.use.diagnosis import Diagnosis, Verdict, diagnose
from estimator.use.movements import Hypotheses
from estimator.use.record import write_run
from estimator.use.watch import HAZARD, Watch
from estimator.use.weighing_changes import ChangeWeigher
from tests.estimator.evaluation.test_score import make_ended_run
from tests.estimator.model_robot import (
    TRUE_LENGTHS,
    ModelRobot,
    make_capabilities,
    make_posterior,
    make_problem,
    serving,
    without_plots,
)
from tests.estimator.posterior_run import make_posterior_run
from tests.estimator.use.test_pose import ASKEW, SPREAD, TRUTH, sampled


@pytest.fixture(autouse=True)
def little_effort(monkeypatch: pytest.MonkeyPatch) -> None:
    """All of it, with fewer bodies and movements to choose from."""
    monkeypatch.setattr(movements, "HYPOTHESES", 96)
    monkeypatch.setattr(movements, "_CANDIDATES", 60)
    monkeypatch.setattr(movements, "_MORE_DRAWS", 200)
    monkeypatch.setattr(movements, "_DRAWS", 96)
    monkeypatch.setattr(best_programs, "_LIKELY", 20)
    monkeypatch.setattr(best_programs, "_FINALISTS", 6)
    monkeypatch.setattr(competitor, "_CHAINS", 24)
    monkeypatch.setattr(surprise, "_REPLICATES", 200)
    monkeypatch.setattr(use, "write_report", without_plots)
    monkeypatch.setattr(competitor, "_TEMPERATURES", np.append(0.0, np.geomspace(5e-3, 1.0, 10)))


TILT, CLEARANCE = math.radians(0.2), 0.8e-3


@cache
def weigher() -> ChangeWeigher:
    rng = np.random.default_rng(11)
    known = sampled(64)
    return ChangeWeigher.of(known, detectable_changes_of(known, rng), rng)


def change(name: str) -> DetectableChange:
    (one,) = (one for one in weigher().changes if one.name == name)
    return one


def damaged(*changes: tuple[str, float]) -> Bodies:
    """The true body with some changes, by name and amount."""
    body = weigher().known.unknowns.bodies(TRUTH[None])
    for name, amount in changes:
        body = change(name).row.applied(body, amount)
    return body


def robot(body: Bodies, seed: int = 1) -> Callable[[Program, str], Observation]:
    """Reads what a body feels, with noise."""
    known: FittedPosterior = weigher().known
    rng = np.random.default_rng(seed)

    def act(program: Program, reason: str) -> Observation:
        felt = known.predictor.read(body, np.zeros(1, dtype=np.intp), np.array([program]))
        tilt = felt.tilt[0] + rng.normal(0, TILT, 2)
        return Observation(
            angles=program,
            touch=tuple(felt.touch[0].tolist()),
            tilt=tuple(tilt.tolist()),
            clearance=float(felt.clearance[0] + rng.normal(0, CLEARANCE)),
        )

    return act


def named(found: Diagnosis) -> list[str]:
    return [one.change.name for one in found.changes if one.change is not None]


FRONT = "the leg of front shortened"


@pytest.mark.parametrize(
    ("name", "amount", "within"),
    [
        (FRONT, -0.6, 0.03),  # it ends in an edge
        ("plugs of left and back exchanged", 1.0, 0.0),
        ("accelerometer's own tilt, left/right", math.radians(4.0), math.radians(0.6)),
    ],
)
def test_one_change_is_noticed_and_named(name: str, amount: float, within: float) -> None:
    act = robot(damaged((name, amount)))
    watch = Watch(weigher())
    while not watch.alarm:
        watch.take(act(tuple(watch.next_movement().tolist()), ""))
        assert watch.movements <= 5
    assert watch.none_of_these < 0.05
    suspects = {one.change.name: share for one, share in watch.suspects() if one.change is not None}
    assert suspects[name] > 0.1
    assert suspects[name] > max(suspects.values()) - 0.1  # what feels the same is as probable
    found = diagnose(weigher(), act)
    assert found.verdict is Verdict.CHANGED
    assert named(found) == [name]
    assert found.probability > 0.95
    middle, low, high = found.changes[0].amount()
    assert middle == pytest.approx(abs(amount), abs=max(within, 1e-9))
    assert low <= middle <= high


def test_nothing_has_changed() -> None:
    act, watch = robot(damaged(), seed=2), Watch(weigher())
    for program in watch.patrol(8):
        watch.take(act(tuple(program.tolist()), ""))
    assert watch.odds < 10 * HAZARD
    found = diagnose(weigher(), act)
    assert found.verdict is Verdict.UNCHANGED
    assert "Nothing has changed" in found.in_words(weigher().known)


LIFTED = Observation(
    angles=(), touch=(False,) * 4, tilt=(0.0, 0.0), clearance=0.2, clearance_saturated=True
)


@pytest.mark.parametrize("how", ["still", "lifted", "reversed"])
def test_what_no_body_explains_is_noticed_and_none_of_these(how: str) -> None:
    act = robot(damaged(), seed=4)
    seen: dict[str, Callable[[Program], Observation]] = {
        "still": lambda program: act((0.0,) * 4, ""),
        "lifted": lambda program: LIFTED,
        "reversed": lambda program: act(tuple(-angle for angle in program), ""),
    }
    watch = Watch(weigher())
    while not watch.alarm:
        program = tuple(watch.next_movement().tolist())
        watch.take(seen[how](program).model_copy(update={"angles": program}))
        assert watch.movements <= 5
    assert watch.movements > 1
    assert watch.none_of_these > 0.95
    assert not watch.suspects()


def test_what_somebody_else_moves_is_none_of_these_and_nothing_is_suspected() -> None:
    """Its readings are those of other programs than it was given."""
    undamaged, rng = robot(damaged(), seed=4), np.random.default_rng(8)
    low, high = weigher().known.program_range.T

    def act(program: Program, reason: str) -> Observation:
        seen = undamaged(tuple(rng.uniform(low, high).tolist()), reason)
        return seen.model_copy(update={"angles": program})

    mine = ChangeWeigher.of(weigher().known, weigher().changes, rng)
    found = diagnose(mine, act)
    assert found.verdict is Verdict.NONE_OF_THESE
    assert len(found.observations) <= 8
    assert found.in_words(weigher().known) == (
        "None of the changes that are known explains the readings."
    )


def test_one_movement_that_nothing_explains_is_no_alarm_and_others_take_it_back() -> None:
    """Such as one in which somebody held the robot."""
    act, watch = robot(damaged(), seed=5), Watch(weigher())
    for number, program in enumerate(watch.patrol(6)):
        seen = act(tuple(program.tolist()), "")
        watch.take(seen if number != 1 else LIFTED.model_copy(update={"angles": seen.angles}))
        assert not watch.alarm
        if number == 1:
            held = watch.odds
    assert held > HAZARD
    assert watch.odds < HAZARD


def test_an_identification_that_left_bodies_open_gives_no_alarm() -> None:
    """The watch learns which of them the robot has: most have a front leg 20 mm too long."""
    rng = np.random.default_rng(1)
    genes = rng.normal(TRUTH, SPREAD / 0.2, (64, 4))
    genes[3:, 1] += 0.02 / 0.2
    known = make_posterior(make_problem(), make_capabilities(), np.clip(genes, 0, 1), best=TRUTH)
    watch = Watch(ChangeWeigher.of(known, detectable_changes_of(known, rng), rng))
    act = robot(damaged(), seed=2)
    low, high = known.program_range.T
    for program in np.random.default_rng(3).uniform(low, high, (20, 4)):
        watch.take(act(tuple(program.tolist()), ""))
        assert watch.odds < 0.1


def test_two_things_at_once_are_none_of_these() -> None:
    act = robot(damaged((FRONT, 0.6), ("servo of left jammed", math.radians(-20.0))), seed=3)
    found = diagnose(weigher(), act)
    assert found.verdict is not Verdict.CHANGED
    assert "None of the changes" in found.in_words(weigher().known)


def test_changes_that_cannot_be_told_from_model_error_are_left_out() -> None:
    """Nor is anything drawn that is smaller."""
    own_tilt = change("accelerometer's own tilt, left/right")
    drawn = own_tilt.amounts(own_tilt.drawn(np.linspace(0, 1, 50)))
    assert np.min(np.abs(drawn)) >= math.radians(1.0)
    assert np.exp(own_tilt.log_density(own_tilt.drawn(np.array([0.2, 0.8])))).min() > 0
    total = np.exp(own_tilt.log_density(np.linspace(-8, 8, 4001))).sum() * 16 / 4000
    assert total == pytest.approx(1.0, abs=0.01)
    assert sum(math.exp(one.log_prior) for one in weigher().changes) == pytest.approx(1.0)


def test_an_edge_reaches_less_far_than_a_round_end_that_lifts_as_high() -> None:
    """And what a stump ends in is found with where it does."""
    known = weigher().known
    program = np.radians([[0.0, -30.0, 0.0, 0.0]])

    def front_up(share: float) -> float:
        felt = known.predictor.read(damaged((FRONT, share)), np.zeros(1, dtype=np.intp), program)
        return math.degrees(felt.tilt[0, 1])

    leans = math.radians(30.0 - front_up(-0.6))
    ends = (1 - math.tan(leans / 2)) * 0.006 / TRUE_LENGTHS[1]
    assert front_up(-0.6) == pytest.approx(front_up(0.6 + ends), abs=0.06)
    assert front_up(0.6) < front_up(-0.6) - 0.15
    low, high = known.program_range.T
    shares = []
    for seed in (4, 5, 6):
        act, rng = robot(damaged((FRONT, -0.6)), seed=seed), np.random.default_rng(seed)
        seen = [act(tuple(rng.uniform(low, high).tolist()), "") for _ in range(6)]
        first = weigher().weigh(seen).particles[0]
        assert first.change is not None
        assert first.change.name == FRONT
        shares.append(first.amount()[0])
    assert np.mean(shares) == pytest.approx(0.6, abs=0.75 * ends)  # not as if it ended round
    again = weigher().weigh(seen).particles[0]
    assert 1 / np.sum(first.weights**2) > 10  # of 704 particles
    assert first.log_evidence == pytest.approx(again.log_evidence, abs=1.0)


def test_an_interval_does_not_hang_on_the_draw_where_few_bodies_are_left() -> None:
    rng = np.random.default_rng(11)
    known = sampled(64, 0.02)
    vague = ChangeWeigher.of(known, [change(FRONT)], rng)
    act, ends = robot(damaged((FRONT, -0.6)), seed=4), []
    low, high = known.program_range.T
    seen = [act(tuple(rng.uniform(low, high).tolist()), "") for _ in range(4)]
    for _ in range(4):
        first = vague.weigh(seen).particles[0]
        assert first.effective_bodies < LOW_ESS
        ends.append(first.amount()[1:])
    assert np.max(np.std(ends, axis=0)) < 0.003


def test_a_robot_that_fell_to_its_other_side_is_no_surprise() -> None:
    known, bodies = weigher().known, damaged()
    rng, one = np.random.default_rng(6), np.zeros(1, dtype=np.intp)
    low, high = known.program_range.T
    own = Hypotheses(bodies=bodies, scales=np.zeros((1, 2)), groups=one)
    for program in rng.uniform(low, high, (500, len(low))):
        here, there = (
            known.predictor.read(bodies, one, program[None], tilt[None])
            for tilt in (GRAVITY_TILTS[0], FORKS[0])
        )
        if apart(here, there, known.noise)[0]:
            break
    for readings, likely in ((here, True), (there, True), (None, False)):
        tilt = np.array([0.4, 0.4]) if readings is None else readings.tilt[0]
        felt = here if readings is None else readings
        seen = Observation(
            angles=tuple(program.tolist()),
            touch=tuple(felt.touch[0].tolist()),
            tilt=tuple(tilt.tolist()),
            clearance=float(felt.clearance[0]),
        )
        drawn, observed = surprise.surprise(weigher(), own, seen)
        assert (np.mean(drawn >= observed) > 0.02) == likely


def test_what_is_drawn_beyond_the_distance_sensors_range_reads_as_out_of_range() -> None:
    known, rng = weigher().known, np.random.default_rng(7)
    standing = known.predict((0.3,) * 4)[:1]
    high = replace(standing, clearance=np.array([known.clearance_cap]))
    like = Observation(angles=(0.3,) * 4, touch=(True,) * 4, tilt=(0.0, 0.0), clearance=0.1)
    drawn = surprise.replicates(
        known, high[np.zeros(400, dtype=int)], np.zeros((400, 2)), like, rng
    )
    beyond = np.array([one.clearance_saturated for one in drawn])
    assert 150 < beyond.sum() < 250
    heights = np.array([one.clearance for one in drawn])
    assert (heights[beyond] == known.clearance_cap).all()
    assert (heights[~beyond] < known.clearance_cap).all()


# --- the commands ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    rng = np.random.default_rng(1)
    lengths = [TRUE_LENGTHS, *map(tuple, rng.normal(TRUE_LENGTHS, SPREAD, (40, 4)).tolist())]
    with make_posterior_run(tmp_path_factory.mktemp("known"), lengths, askew=ASKEW) as store:
        return store.directory


def estimator(*words: str | Path | int) -> Result:
    return CliRunner().invoke(app, [*map(str, words), "--jobs", "1"])


def test_a_cut_leg_is_noticed_named_and_stood_on(run: Path, tmp_path: Path) -> None:
    model = ModelRobot(askew=ASKEW)
    with serving(model) as uri:
        same = estimator("monitor", run, "--robot", uri, "--once", "--yes")
        assert same.exit_code == 0, same.output
        assert "Not changed" in same.stdout
        assert estimator("monitor", run, "--robot", uri, "--once").exit_code == 1  # nobody to ask
        short = sampled(1, 0.0)
        genes = TRUTH.copy()
        genes[1] = (0.6 * TRUE_LENGTHS[1] - 0.05) / 0.2
        model._body = short.genome.decode(genes)
        before = len(model.motions)
        watched = ("monitor", run, "--robot", uri, "--every", "0", "--movements", "9", "--yes")
        noticed = estimator(*watched)
        assert noticed.exit_code == 3, noticed.output
        assert "The body has changed" in noticed.stdout
        lines = (run / "monitor.jsonl").read_text().splitlines()
        assert json.loads(lines[-1])["alarm"]
        assert len(lines) == len(model.motions)
        assert len(model.motions) - before <= 5
        now = tmp_path / "now"
        found = estimator("diagnose", run, "--robot", uri, "--yes", "--out", now)
        assert found.exit_code == 0, found.output
        assert number_in(r"leg of front shortened from 150 to (\d+) mm", found.stdout) == 90
        posed = estimator(
            *("pose", now, "--robot", uri, "--clearance", "45mm", "--tilt-left", "0", "--yes")
        )
        assert posed.exit_code == 0, posed.output
        validated = estimator("validate", now, "--robot", uri, "--programs", "6")
    assert validated.exit_code == 0, validated.output
    assert "6 of 6" in validated.stdout
    with (
        RunStore.open(run, to_write=False) as then,
        RunStore.open(now, to_write=False) as since,
    ):
        assert since.client_id != then.client_id  # else the robot would answer as it did then
    exported = CliRunner().invoke(app, ["export", str(now), "--format", "json"])
    lengths = {
        one["name"]: one["far"] + one["radius"] for one in json.loads(exported.stdout)["links"]
    }
    assert 1000 * lengths["front"] == pytest.approx(90, abs=3)
    result = json.loads((now / "result.json").read_text())
    assert 1000 * result["legs"][1]["length_m"] == pytest.approx(90, abs=3)
    shown = CliRunner().invoke(app, ["show", str(now)])
    assert "Changed since it was identified: the leg of front shortened" in shown.stdout
    front = load(now)
    assert 1000 * front.leg_lengths[:, 1].mean() == pytest.approx(90, abs=3)
    assert front.best_body is not None
    assert 1000 * front.best_body.parts[1].length == pytest.approx(90, abs=3)
    (own_tilt,) = front.unknowns.amounts(front.points).values()
    assert np.allclose(own_tilt, ASKEW)


def test_a_robot_that_no_longer_moves_has_none_of_the_known_changes(
    run: Path, tmp_path: Path
) -> None:
    watched = tmp_path / "watched"
    copytree(run, watched)
    with serving(ModelRobot(askew=ASKEW, travel=0.0)) as uri:
        noticed = estimator("monitor", watched, "--robot", uri, "--once", "--yes", "--seed", 1)
    assert noticed.exit_code == 3, noticed.output
    sentence = " ".join(noticed.stdout.split())
    assert "None of the changes that are known explains the readings, nor does any body" in sentence
    assert "its servos turn" in sentence
    assert f"estimator diagnose {watched} --robot {uri}" in sentence
    assert f"estimator identify --robot {uri}" in sentence
    assert "leg of" not in sentence
    line = json.loads((watched / "monitor.jsonl").read_text().splitlines()[-1])
    assert line["alarm"]
    assert line["none_of_these"] > 0.95
    assert line["suspects"] == {}


ROLL_LEFT, UP = (np.array([4, 2]) + 0.5) / 6


@pytest.mark.parametrize("found_by_both", [True, False])
def test_a_diagnosed_run_states_the_body_that_its_movements_leave(
    tmp_path: Path, found_by_both: bool
) -> None:
    """And it is no surer than the searches of the identification vouch for."""
    rng, back = np.random.default_rng(1), 3
    lengths = [TRUE_LENGTHS, *map(tuple, rng.normal(TRUE_LENGTHS, SPREAD, (60, 4)).tolist())]
    genes = [*TRUTH[:back].tolist(), UP, TRUTH[back]]
    rival = StoredMode(
        probability=0.25,
        ess=50.0,
        genes=tuple(genes),
        indistinguishable=False,
        found=(True, found_by_both),
    )
    hinges = [ROLL_LEFT] * 40 + [UP] * 20
    with make_posterior_run(
        tmp_path, lengths, hinge=ROLL_LEFT, hinges=hinges, rivals=[rival], askew=ASKEW
    ) as store:
        run, now = store.directory, tmp_path / "now"
    assert load(run).attachments[0].value == "roll_left"
    with serving(ModelRobot(askew=ASKEW)) as uri:
        ended = estimator("diagnose", run, "--robot", uri, "--yes", "--out", now)
    assert ended.exit_code == 0, ended.output
    known = load(now)
    (hinge,) = known.attachments
    assert (hinge.value, hinge.probability) == ("up", 1.0)
    assert known.summary is not None
    assert [mode.probability for mode in known.summary.modes] == [1.0]
    assert (known.probability is not None) == found_by_both
    if known.probability is not None:
        assert known.probability > 0.95


@pytest.mark.parametrize(("nats", "is_known"), [(1.0, True), (2.0, False)])
def test_lengths_are_not_known_where_next_to_no_body_is_left(
    tmp_path: Path, nats: float, is_known: bool
) -> None:
    """Of bodies each of which explains less than the one before, by so many nats."""
    rng, now = np.random.default_rng(1), tmp_path / "now"
    lengths = rng.normal(TRUE_LENGTHS, SPREAD, (60, 4))
    with make_posterior_run(tmp_path, list(map(tuple, lengths.tolist())), askew=ASKEW) as store:
        run = store.directory
    with use.identified(run, 1) as (store, known):
        diagnosing = ChangeWeigher.of(known, detectable_changes_of(known, rng)[:1], rng)
        felt = known.predict((0.0,) * 4)
        seen = Observation(
            angles=(0.0,) * 4,
            touch=tuple(felt.touch[0].tolist()),
            tilt=tuple(felt.tilt[0].tolist()),
            clearance=felt.clearance[0],
        )
        found = Diagnosis(
            verdict=Verdict.UNCHANGED,
            changes=(diagnosing.learning(-nats * np.arange(len(known), dtype=float)).as_before(),),
            probability=1.0,
            weighed=diagnosing.weigh([seen]),
            observations=(seen,),
            reasons=("",),
        )
        write_run(now, store, diagnosing, found, "tcp://127.0.0.1:1")
    left = load(now)
    assert left.summary is not None
    assert len(np.unique(left.samples, axis=0)) >= 5
    assert (left.summary.not_known is None) == is_known
    shown = CliRunner().invoke(app, ["show", str(now)]).stdout
    assert ("found to" in shown) == is_known


@pytest.mark.parametrize(("margin", "unexplained"), [(0.5, [0]), (0.0, [])])
def test_a_movement_in_which_a_trifle_decides_is_not_called_unexplained(
    margin: float, unexplained: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = tmp_path / "now"
    with make_posterior_run(tmp_path, [TRUE_LENGTHS] * 6, askew=ASKEW) as store:
        run = store.directory
    rng = np.random.default_rng(1)
    with use.identified(run, 1) as (store, known):
        diagnosing = ChangeWeigher.of(known, detectable_changes_of(known, rng)[:1], rng)
        monkeypatch.setattr(
            type(known.predictor), "margins", lambda self, bodies, rows, *_: rows * 0.0 + margin
        )
        seen = Observation(angles=(0.0,) * 4, touch=(False,) * 4, tilt=(0.6, 0.6), clearance=0.1)
        found = Diagnosis(
            verdict=Verdict.UNCHANGED,
            changes=(diagnosing.as_before(),),
            probability=1.0,
            weighed=diagnosing.weigh([seen]),
            observations=(seen,),
            reasons=("",),
        )
        write_run(now, store, diagnosing, found, "tcp://127.0.0.1:1")
    summary = load(now).summary
    assert summary is not None
    assert [item.interaction for item in summary.unexplained] == unexplained


def test_a_population_is_not_diagnosed_and_nothing_moves(tmp_path: Path) -> None:
    with make_ended_run(tmp_path, TRUE_LENGTHS) as store:
        directory = store.directory
    model, now = ModelRobot(), tmp_path / "now"
    with serving(model) as uri:
        ended = estimator("diagnose", directory, "--robot", uri, "--yes", "--out", now)
        assert ended.exit_code == 1, ended.output
        sentence = " ".join(ended.stderr.split())
        assert "needs one of the method posterior" in sentence
        assert f"estimator identify --robot {uri} --problem legs" in sentence
        watched = estimator(
            *("monitor", directory, "--robot", uri, "--every", "0", "--movements", "1", "--yes")
        )
    assert watched.exit_code == 0, watched.output
    assert len(model.motions) == 1
    assert not now.exists()


@pytest.mark.parametrize("options", [("--movements", "3"), ("--every", "60")])
def test_once_leaves_nothing_else_to_say(run: Path, options: tuple[str, str]) -> None:
    ended = estimator("monitor", run, "--robot", "tcp://127.0.0.1:1", "--once", "--yes", *options)
    assert ended.exit_code == 2
    sentence = " ".join(ended.stderr.replace("│", " ").split())
    assert f"--once is 6 movements without a pause: leave out {options[0]}" in sentence


@pytest.mark.parametrize("command", [("pose", "--highest"), ("monitor", "--once"), ("diagnose",)])
def test_a_record_is_no_robot_that_could_move(run: Path, command: tuple[str, ...]) -> None:
    name, *options = command
    ended = estimator(name, run, "--robot", f"replay:{run}", "--yes", *options)
    assert ended.exit_code == 1
    assert ended.stderr.endswith(
        f"estimator: replay:{run} is a record, which cannot move: give the robot, tcp://HOST:PORT\n"
    )
    assert "observed" not in ended.stdout
    said = " ".join(estimator(name, "--help").stdout.replace("│", " ").split())
    assert "tcp://HOST:PORT; a record cannot move." in said


def test_a_diagnosis_that_could_not_be_kept_moves_nothing(run: Path) -> None:
    model = ModelRobot()
    with serving(model) as uri:
        ended = estimator("diagnose", run, "--robot", uri, "--yes", "--out", run)
    assert ended.exit_code == 1
    assert f"{run} holds a run already" in ended.stderr
    assert not model.motions


def test_a_diagnosis_of_the_run_here_is_kept_beside_it(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = set(run.parent.iterdir())
    monkeypatch.chdir(run)
    with serving(ModelRobot(askew=ASKEW)) as uri:
        ended = estimator("diagnose", ".", "--robot", uri, "--yes")
    assert ended.exit_code == 0, ended.output
    (made,) = set(run.parent.iterdir()) - before
    assert made.name.startswith(f"{run.name}-")
    assert f"Run: {made} " in ended.stdout


def test_a_diagnosis_is_kept_whole_or_not_at_all_and_resume_leaves_it(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now, model, save = tmp_path / "now", ModelRobot(askew=ASKEW), RunStore.save_posterior

    def broken_off(store: RunStore, number: int, *rest: Any) -> None:
        if number:
            raise KeyboardInterrupt
        save(store, number, *rest)

    with serving(model) as uri:
        command = ("diagnose", run, "--robot", uri, "--yes", "--out", now)
        with monkeypatch.context() as patch:
            patch.setattr(RunStore, "save_posterior", broken_off)
            broken = estimator(*command)
        assert broken.exit_code == 1
        assert "interrupted" in broken.stderr
        assert not holds_run(now)
        again = estimator(*command)
        assert again.exit_code == 0, again.output
        kept, moved = stored(now), len(model.motions)
        resumed = estimator("resume", now)
    assert resumed.exit_code == 0, resumed.output
    assert len(model.motions) == moved
    assert stored(now) == kept


def stored(directory: Path) -> list[tuple[StoredPosterior, Counters]]:
    with RunStore.open(directory, to_write=False) as store:
        return store.posteriors()


def number_in(pattern: str, text: str) -> int:
    match = re.search(pattern, text)
    assert match is not None, text
    return round(int(match[1]), -1)
