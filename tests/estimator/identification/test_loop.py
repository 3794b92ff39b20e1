import pytest

from estimator.errors import InteractionError
from estimator.identification.loop import carry_out
from estimator.identification.method import Listener
from estimator.identification.record_link import Record
from estimator.identification.robot_link import OnProgress
from estimator.readings.observation import Observation, Program
from estimator.storage.records import InteractionRecord, Ticket
from protocol.errors import RobotError, RobotRestartedError, RobotUnreachableError
from tests.estimator.model_robot import make_capabilities

PROGRAM = (0.1, 0.2, 0.3, 0.4)
OBSERVATION = Observation(angles=PROGRAM)
OLD = Ticket(request_id=1, session="before")
NOT_PLANAR = RobotError("not_planar", "It leans by 5 degrees.")


class ScriptedLink:
    """A link whose every answer is written down beforehand; ``log`` is what happened, in order."""

    def __init__(self, *performs: object, outcome: object = None):
        self.capabilities = make_capabilities()
        self.recorded: tuple[Program, ...] | None = None
        self.log: list[object] = []
        self._performs = list(performs)
        self._outcome = outcome
        self._ids = iter(range(100, 200))

    def ticket(self) -> Ticket | None:
        return Ticket(request_id=next(self._ids), session="now")

    def perform(
        self, number: int, program: Program, ticket: Ticket | None, on_progress: OnProgress
    ) -> Observation:
        assert ticket is not None
        self.log.append(("performed", ticket.request_id))
        on_progress("moving", 0.5)
        return self._say(self._performs.pop(0))

    def outcome(
        self, program: Program, ticket: Ticket, on_progress: OnProgress
    ) -> Observation | None:
        self.log.append(("asked again", ticket.request_id))
        return None if self._outcome is None else self._say(self._outcome)

    def close(self) -> None:
        self.log.append("closed")

    def commit(self, ticket: Ticket | None) -> None:
        self.log.append(("committed", ticket and ticket.request_id))

    def _say(self, answer: object) -> Observation:
        if isinstance(answer, BaseException):
            raise answer
        assert isinstance(answer, Observation)
        return answer


class Person(Listener):
    """Notes what is said, and agrees to every retry."""

    def __init__(self) -> None:
        self.heard: list[str] = []
        self.phases: list[str] = []

    def say(self, sentence: str) -> None:
        self.heard.append(sentence)

    def moving(self, number: int, phase: str, fraction: float) -> None:
        self.phases.append(phase)

    def may_retry(self, error: RobotError) -> bool:
        self.heard.append(error.code)
        return True


def run(
    link: ScriptedLink, ticket: Ticket | None = None, listener: Listener | None = None
) -> object:
    planned = InteractionRecord(program=PROGRAM, ticket=ticket)
    return carry_out(link, 0, planned, link.commit, listener or Person())


def test_the_id_is_on_disk_before_the_request_leaves() -> None:
    link, person = ScriptedLink(OBSERVATION), Person()
    assert run(link, listener=person) == OBSERVATION
    assert link.log == [("committed", 100), ("performed", 100)]
    assert person.phases == ["moving"]


def test_a_person_may_put_the_robot_right_and_retry_under_a_new_id() -> None:
    link, person = ScriptedLink(NOT_PLANAR, OBSERVATION), Person()
    assert run(link, listener=person) == OBSERVATION
    assert person.heard == ["not_planar"]
    ids = [("committed", 100), ("performed", 100), ("committed", None)]
    assert link.log == [*ids, ("committed", 101), ("performed", 101)]


def test_without_a_person_the_advice_is_the_last_word() -> None:
    link = ScriptedLink(NOT_PLANAR)
    with pytest.raises(InteractionError, match=r"interaction 1: It leans.*as it lay or stood"):
        run(link, listener=Listener())
    assert link.log[-1] == ("committed", None)


def test_what_no_retry_can_mend_is_not_asked_about() -> None:
    person = Person()
    with pytest.raises(InteractionError, match="fell off"):
        run(ScriptedLink(RobotError("fault", "A servo fell off.")), listener=person)
    assert not person.heard


@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (RobotRestartedError("who are you"), "daemon restarted.*Going on performs it again"),
        (RobotUnreachableError("nothing answers"), "nothing answers"),
    ],
)
def test_a_motion_of_unknown_fate_stops_the_run_and_keeps_its_ticket(
    error: Exception, sentence: str
) -> None:
    link = ScriptedLink(error)
    with pytest.raises(InteractionError, match=sentence):
        run(link)
    assert link.log == [("committed", 100), ("performed", 100)]


def test_an_outcome_that_is_still_there_is_taken_without_moving() -> None:
    link = ScriptedLink(outcome=OBSERVATION)
    assert run(link, OLD) == OBSERVATION
    assert link.log == [("asked again", 1)]


@pytest.mark.parametrize(
    ("outcome", "said"),
    [
        (None, "never carried out"),
        (RobotRestartedError("new session"), "restarted since"),
        (RobotError("aborted_silent", "It fell silent."), "It fell silent"),
    ],
)
def test_without_an_outcome_the_program_is_performed_anew_and_that_is_said(
    outcome: object, said: str
) -> None:
    link, person = ScriptedLink(OBSERVATION, outcome=outcome), Person()
    assert run(link, OLD, person) == OBSERVATION
    assert link.log == [("asked again", 1), ("committed", 100), ("performed", 100)]
    assert said in person.heard[0]


def test_a_record_that_lacks_a_movement_leaves_its_ticket() -> None:
    """The robot may have made it: who goes on with the robot must be able to ask."""
    record = Record(make_capabilities(), ((0.1,) * 4,), (Observation(angles=(0.1,) * 4),))
    planned = InteractionRecord(program=(0.2,) * 4, ticket=OLD)
    commits: list[Ticket | None] = []
    with pytest.raises(InteractionError, match="the record does not hold"):
        carry_out(record, 0, planned, commits.append, Listener())
    assert commits == []
