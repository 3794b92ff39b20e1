import errno
import fcntl
import json
import math
import os
import resource
import shlex
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from random import Random

import pytest

from estimator.errors import ProblemError, RunDirectoryError
from estimator.posterior.fitted import FittedPosterior
from estimator.readings.observation import Observation
from estimator.storage.database import DATABASE, is_locked, reading
from estimator.storage.records import (
    Counters,
    Finish,
    Generation,
    Prediction,
    Ticket,
    first_id,
)
from estimator.storage.run_config import RunSettings
from estimator.storage.store import LOCK, RunStore
from tests.estimator.model_robot import PROBLEM, make_capabilities
from tests.estimator.report.made_runs import made_run

SETTINGS = RunSettings(
    method="paper",
    explore="random",
    search="deterministic-crowding",
    objective="largest",
    reference="pybullet",
    robot="tcp://127.0.0.1:5750",
    problem="legs",
    problem_text=PROBLEM,
    physics="pybullet",
    modalities=("tilt",),
    seed=1,
    interactions=2,
    population=4,
    generations=1,
)
OBSERVATION = Observation(
    angles=(0.1, -0.2, 0.3, 1 / 3), touch=(True, None, False, True), tilt=(0.1, None)
)
PROGRAM = (0.1, -0.2, 0.3, 1 / 3)


def make_generation(number: int) -> Generation:
    return Generation(
        number=number,
        iteration=0,
        errors=(1.0, float("inf")),
        best=(0.1, 0.2),
        counters=Counters(simulations_requested=number),
    )


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    RunStore.create(tmp_path / "run", SETTINGS, make_capabilities(), "me").close()
    return tmp_path / "run"


def test_a_run_keeps_how_well_its_robot_was_calibrated(tmp_path: Path) -> None:
    robot = make_capabilities()
    known = replace(robot, joints=tuple(replace(one, zero_sigma=0.002) for one in robot.joints))
    asked = SETTINGS.model_copy(update={"method": "posterior"})
    RunStore.create(tmp_path / "run", asked, known, "me").close()
    with RunStore.open(tmp_path / "run") as store:
        rows = store.problem.table
    assert {row.narrow for row in rows if row.group == "zero_deg"} == {0.002}


def test_the_advice_about_a_run_with_a_blank_in_its_name_can_be_typed(tmp_path: Path) -> None:
    place = tmp_path / "my run"
    RunStore.create(place, SETTINGS, make_capabilities(), "me").close()
    with pytest.raises(RunDirectoryError) as caught:
        RunStore.check_free(place)
    _, command, _ = str(caught.value).split("`")
    assert shlex.split(command) == ["estimator", "resume", str(place)]


def test_what_was_stored_comes_back_exactly(directory: Path) -> None:
    with RunStore.open(directory) as store:
        store.plan(0, PROGRAM)
        store.ask(0, Ticket(request_id=7, session="s"))
        store.observe(0, OBSERVATION)
        store.plan(1, PROGRAM)
        store.save(make_generation(0), {"population": [[1 / 3]], "random": 2**127 + 1})
    with RunStore.open(directory, to_write=False) as store:
        assert (store.settings, store.capabilities) == (SETTINGS, make_capabilities())
        first, second = store.interactions()
        assert first.observation == OBSERVATION
        assert first.ticket == Ticket(request_id=7, session="s")
        assert (second.program, second.ticket, second.observation) == (PROGRAM, None, None)
        assert store.generations() == [make_generation(0)]
        checkpoint = store.checkpoint()
        assert checkpoint is not None
        assert checkpoint.number == 0
        assert checkpoint.state == {"population": [[1 / 3]], "random": 2**127 + 1}


def test_a_failed_request_leaves_no_ticket(directory: Path) -> None:
    with RunStore.open(directory) as store:
        store.plan(0, PROGRAM)
        store.ask(0, Ticket(request_id=7, session="s"))
        store.ask(0, None)
        assert store.interactions()[0].ticket is None


def test_no_two_connections_share_a_request_id(directory: Path) -> None:
    with RunStore.open(directory) as store:
        firsts = [first_id(0), store.new_connection(), store.new_connection()]
    with RunStore.open(directory) as store:
        firsts.append(store.new_connection())
    assert all(later - earlier > 10**6 for earlier, later in pairwise(firsts))


def test_generation_and_checkpoint_are_one(directory: Path) -> None:
    with RunStore.open(directory) as store:
        store.save(make_generation(0), {"at": 0})
        with pytest.raises(sqlite3.IntegrityError):
            store.save(make_generation(0), {"at": 1})
        checkpoint = store.checkpoint()
        assert checkpoint is not None
        assert checkpoint.state == {"at": 0}


def test_predictions_stand_and_get_their_outcomes(directory: Path) -> None:
    prediction = Prediction(program=PROGRAM, readings={"best": {"tilt": [[0.1, None]]}})
    with RunStore.open(directory) as store:
        assert store.validations.predict([prediction, prediction]) == 0
        store.validations.ask(0, 1, Ticket(request_id=9, session="s"))
        store.validations.observe(0, 1, OBSERVATION)
        assert store.validations.predict([prediction]) == 1
        first, second = store.validations.all()
    assert first[0] == prediction
    assert first[1].observation == OBSERVATION
    assert first[1].readings == prediction.readings
    assert second == [prediction]


def test_a_run_is_never_overwritten(directory: Path) -> None:
    with pytest.raises(RunDirectoryError, match=r"holds a run already.*estimator resume"):
        RunStore.create(directory, SETTINGS, make_capabilities(), "me")


@pytest.mark.parametrize("name", ["readings.csv", "robot.json"])
def test_what_was_written_down_by_hand_is_never_overwritten(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("by hand", encoding="utf-8")
    with pytest.raises(RunDirectoryError, match=rf"holds a {name} that is of no run there.*--out"):
        RunStore.create(tmp_path, SETTINGS, make_capabilities(), "me")
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_two_writers_at_once_are_refused(directory: Path) -> None:
    with RunStore.open(directory):
        with pytest.raises(RunDirectoryError, match="Another process works on"):
            RunStore.open(directory)
        RunStore.open(directory, to_write=False).close()
    RunStore.open(directory).close()


def test_a_second_writer_ends_the_first_where_its_lock_was_deleted(directory: Path) -> None:
    with RunStore.open(directory) as first:
        first.plan(0, PROGRAM)
        (directory / LOCK).unlink()
        with RunStore.open(directory) as second:
            second.ask(0, Ticket(request_id=7, session="s"))
            for write in (
                lambda: first.observe(0, OBSERVATION),
                lambda: first.validations.predict([]),
                lambda: first.search_end.save_best_fit(None),
            ):
                with pytest.raises(RunDirectoryError, match="Another process has begun to write"):
                    write()
            second.observe(0, OBSERVATION)
    with RunStore.open(directory, to_write=False) as store:
        assert store.observations() == [OBSERVATION]
        assert not store.search_end.is_reached


def test_a_file_system_without_locks_has_one_writer_too(
    directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_locks(descriptor: int, operation: int) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", no_locks)
    with RunStore.open(directory) as first:
        assert not is_locked(directory, LOCK)
        with RunStore.open(directory) as second:
            second.plan(0, PROGRAM)
        with pytest.raises(RunDirectoryError, match="or its file system has none"):
            first.plan(1, PROGRAM)


ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT"


@pytest.mark.parametrize("table", ["meta", "posteriors", "interactions", "predictions"])
@pytest.mark.parametrize(
    "instead",
    [
        f"CREATE VIEW {{0}} AS {ENDLESS} i AS key, i AS value FROM n",
        "CREATE TABLE {0} (key TEXT, value TEXT AS (hex(zeroblob(400000000))))",
        None,
    ],
)
def test_tables_that_compute_what_is_read_are_refused_unread(
    directory: Path, table: str, instead: str | None
) -> None:
    with closing(sqlite3.connect(directory / DATABASE)) as database:
        database.execute(f"DROP TABLE {table}")
        if instead is not None:
            database.execute(instead.format(table))
    with pytest.raises(RunDirectoryError, match=f"what it holds as {table} is not the table of a"):
        RunStore.open(directory, to_write=False)


def test_a_trigger_is_no_part_of_a_run(directory: Path) -> None:
    with closing(sqlite3.connect(directory / DATABASE)) as database:
        database.execute(
            "CREATE TRIGGER more AFTER INSERT ON posteriors BEGIN DELETE FROM interactions; END"
        )
    with pytest.raises(RunDirectoryError, match="what it holds as more is not the table"):
        RunStore.open(directory)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (None, "holds no run"),
        (b"", "holds no run: .* it was ended before it had begun"),
        (b"these are not the bytes of a database" * 40, "is not a run"),
    ],
)
def test_what_is_no_run_is_refused(tmp_path: Path, content: bytes | None, sentence: str) -> None:
    if content is not None:
        (tmp_path / DATABASE).write_bytes(content)
    with pytest.raises(RunDirectoryError, match=sentence):
        RunStore.open(tmp_path)


def test_another_format_is_refused(directory: Path) -> None:
    database = sqlite3.connect(directory / DATABASE)
    database.execute("UPDATE meta SET value = '99' WHERE key = 'format'")
    database.commit()
    database.close()
    with pytest.raises(RunDirectoryError, match="run format 99"):
        RunStore.open(directory)


def test_a_directory_that_cannot_be_made_is_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RunDirectoryError, match="cannot be made"):
        RunStore.create(tmp_path / "file" / "run", SETTINGS, make_capabilities(), "me")


WRITER = """
import sys
from itertools import pairwise
from pathlib import Path
from estimator.storage.store import RunStore
from tests.estimator.storage.test_store import make_generation
with RunStore.open(Path(sys.argv[1])) as store:
    for number in range(10**6):
        store.save(make_generation(number), {"at": number, "ballast": "x" * 20_000})
        print(number, flush=True)
"""


def test_kill_minus_9_loses_nothing_that_was_committed(directory: Path) -> None:
    for kills in range(4):
        writer = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(directory)], stdout=subprocess.PIPE, text=True
        )
        assert writer.stdout is not None
        for _ in range(3 + 4 * kills):
            said = int(writer.stdout.readline())
        os.kill(writer.pid, signal.SIGKILL)
        rest = writer.stdout.read().split()
        said = int(rest[-1]) if rest else said
        writer.stdout.close()
        writer.wait()
        with RunStore.open(directory) as store:
            checkpoint, generations = store.checkpoint(), store.generations()
            assert checkpoint is not None
            assert [item.number for item in generations] == list(range(len(generations)))
            assert checkpoint.state["at"] == checkpoint.number == len(generations) - 1
            assert said <= checkpoint.number <= said + 1
        database = sqlite3.connect(directory / DATABASE)
        database.execute("DELETE FROM generations")
        database.commit()
        database.close()


def test_a_full_disk_is_named_and_leaves_the_run_as_it_was(directory: Path) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    with RunStore.open(directory) as store:
        store.plan(0, PROGRAM)
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, before[1]))
        try:
            with pytest.raises(sqlite3.OperationalError) as full:
                store.observe(0, OBSERVATION)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        assert "rollback" not in str(full.value)
        assert store.interactions()[0].observation is None
        store.observe(0, OBSERVATION)
    with RunStore.open(directory) as store:
        assert store.interactions()[0].observation == OBSERVATION


@pytest.mark.parametrize(
    ("table", "column", "value"),
    [
        ("meta", "value", "{"),
        ("interactions", "program", "[0.1, 0.2]"),
        ("interactions", "program", '[0.1, 0.2, 0.3, "x"]'),
        ("interactions", "observation", '{"angles": [0.1, -0.2, 0.3, 0.3], "tulch": []}'),
        ("interactions", "observation", '{"angles": [0.1]}'),
        ("generations", "errors", "[1.0, null]"),
        ("generations", "counters", "{"),
        ("checkpoint", "value", '{"number": 0, "stave": {}}'),
        ("checkpoint", "value", '{"number": 0, "state": {"populatiol": []}}'),
        ("checkpoint", "value", '{"number": 0, "state": {"population": [[0.1], [0.1, 0.2]]}}'),
        ("checkpoint", "value", '{"number": 0, "state": {"population": [[0.1]]}}'),
        ("checkpoint", "value", '{"number": 0, "state": {"population": [[0.1], [0.2]]}}'),
        ("checkpoint", "value", f'{{"number": 0, "state": {{"population": {[[9] * 4] * 2}}}}}'),
    ],
)
def test_a_damaged_run_is_a_sentence(directory: Path, table: str, column: str, value: str) -> None:
    with RunStore.open(directory) as store:
        store.plan(0, PROGRAM)
        store.observe(0, OBSERVATION)
        store.save(make_generation(0), {"population": [[0.1, 0.2, 0.3, 0.4], [0.3, 0.4, 0.5, 0.6]]})
    with closing(sqlite3.connect(directory / DATABASE, isolation_level=None)) as database:
        database.execute(f"UPDATE {table} SET {column} = ?", (value,))
    with pytest.raises(RunDirectoryError, match=r"run.sqlite is not a run: .* copy of it"):
        read_all(directory)


def test_a_sound_run_on_a_disk_that_fails_now_is_not_called_damaged(directory: Path) -> None:
    journal = directory / f"{DATABASE}-journal"
    journal.mkdir()
    with pytest.raises(RunDirectoryError, match=r"run.sqlite cannot be read now: disk I/O error"):
        RunStore.open(directory, to_write=False)
    journal.rmdir()
    read_all(directory)


def test_a_run_that_another_program_keeps_locked_is_not_called_damaged(directory: Path) -> None:
    with (
        closing(sqlite3.connect(directory / DATABASE, isolation_level=None)) as other,
        closing(sqlite3.connect(directory / DATABASE, timeout=0.0)) as database,
    ):
        other.execute("BEGIN EXCLUSIVE")
        sentence = r"run.sqlite cannot be read now: database is locked\.$"
        with pytest.raises(RunDirectoryError, match=sentence), reading(directory):
            database.execute("SELECT * FROM meta")


def test_a_run_of_the_posterior_can_be_read(tmp_path: Path) -> None:
    read_all(made_run(tmp_path / "run", PROBLEM, "posterior", capabilities=make_capabilities()))


@pytest.mark.parametrize(
    "damage",
    [
        {"weights": [-0.125, 0.375, *[0.125] * 6]},
        {"weights": [0.1] * 8},
        {"weights": [1.0]},
        {"probability_within_problem": 7},
        {"coverage": -0.1},
        {"misspecification_probability": 1.5},
        {"information_gain_bits": math.inf},
        {"simulated": -1},
        {"ess": -1.0},
        {"best": [0.5]},
        {"best": [0.5, 0.5, 0.5, 1.5]},
        {"unexplained": [{"interaction": 9, "sensors": []}]},
        {"scales": [[0.0]] * 8},
    ],
)
def test_an_impossible_posterior_is_a_sentence(tmp_path: Path, damage: dict[str, object]) -> None:
    run = made_run(tmp_path / "run", PROBLEM, "posterior", capabilities=make_capabilities())
    with closing(sqlite3.connect(run / DATABASE, isolation_level=None)) as database:
        (stored,) = database.execute("SELECT posterior FROM posteriors WHERE number = 0").fetchone()
        damaged = json.dumps({**json.loads(stored), **damage})
        database.execute("UPDATE posteriors SET posterior = ? WHERE number = 0", (damaged,))
    with pytest.raises(RunDirectoryError, match=r"is not a run: .* copy of it") as refused:
        read_all(run)
    assert "validation error" not in str(refused.value)


def test_any_flipped_bit_is_a_sentence_or_no_matter(directory: Path) -> None:
    with RunStore.open(directory) as store:
        store.plan(0, PROGRAM)
        store.observe(0, OBSERVATION)
        store.save(make_generation(0), {"population": [[0.1, 0.2, 0.3, 0.4], [0.3, 0.4, 0.5, 0.6]]})
        store.search_end.save_finish(
            Finish(models=(0,), searched=(1.0,), simulated=(2.0,), simulations=1, steps=1)
        )
    whole = (directory / DATABASE).read_bytes()
    places = [place for place, byte in enumerate(whole) if byte]
    random = Random(1)
    refused = 0
    for _ in range(300):
        damaged = bytearray(whole)
        damaged[random.choice(places)] ^= 1 << random.randrange(8)
        (directory / DATABASE).write_bytes(damaged)
        try:
            read_all(directory)
        except (RunDirectoryError, ProblemError):
            refused += 1
    assert refused > 50


def read_all(directory: Path) -> None:
    with RunStore.open(directory, to_write=False) as store:
        store.interactions()
        store.validations.all()
        FittedPosterior.of(store)
