from dataclasses import replace
from pathlib import Path

import pytest

from estimator.errors import TruthError
from estimator.evaluation.truth.body import check_robot
from protocol.wire.capabilities import Capabilities
from tests.estimator.evaluation.test_score import write_truth
from tests.estimator.model_robot import make_capabilities

ROBOT = make_capabilities()


@pytest.fixture
def truth(tmp_path: Path) -> Path:
    return write_truth(tmp_path / "truth.urdf", lengths=(0.16,) * 4)


def test_the_robots_own_urdf_is_taken(truth: Path) -> None:
    check_robot(truth, ROBOT)
    check_robot(truth, replace(ROBOT, base_size=(0.142, 0.138, 0.033)))
    weighed = truth.read_text().replace(
        '<link name="body">', '<link name="body"><inertial><mass value="0.32"/></inertial>'
    )
    truth.write_text(weighed)
    check_robot(truth, ROBOT)


@pytest.mark.parametrize(
    ("robot", "sentence"),
    [
        (replace(ROBOT, base_size=(0.14, 0.20, 0.03)), "140 x 140 x 30 mm, and model, .*140 x 200"),
        (replace(ROBOT, base_radius=0.07), "it has a box, and model, .*, a round main body"),
        (replace(ROBOT, joints=ROBOT.joints[:3], part_radii=None), "the joints"),
        (replace(ROBOT, joints=ROBOT.joints[::-1]), "the run talked to, back, right, front, left"),
    ],
)
def test_another_robots_urdf_is_refused(truth: Path, robot: Capabilities, sentence: str) -> None:
    with pytest.raises(TruthError, match=f"is another robot's: .*{sentence}"):
        check_robot(truth, robot)


def test_a_main_body_of_another_mass_is_another_robots(truth: Path) -> None:
    heavy = '<link name="body"><inertial><mass value="0.6"/></inertial>'
    truth.write_text(truth.read_text().replace('<link name="body">', heavy))
    with pytest.raises(TruthError, match=r"a main body of 0\.6 kg, .* 0\.3 kg"):
        check_robot(truth, ROBOT)
