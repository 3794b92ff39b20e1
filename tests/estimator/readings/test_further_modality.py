"""What docs/architecture.md promises of an entry of ``MODALITIES``, shown with a fourth one."""

from __future__ import annotations

import gc
import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest
from rich.console import Console

from estimator.body.arrays import Flags
from estimator.body.morphology import Array
from estimator.cli.screen import Screen
from estimator.evaluation.validate import compare, validate
from estimator.identification.method import Listener
from estimator.identification.paper.objectives import LargestError
from estimator.physics.pybullet import PyBulletPhysics
from estimator.readings.modalities import MODALITIES, Clearance, Value
from estimator.readings.observation import Observation, PredictedReadings
from estimator.readings.readings_csv import read, write
from estimator.report.evaluations import VALIDATION, print_validation
from estimator.report.page.run_page import run_page
from estimator.report.result import write_document
from estimator.report.summarise import summarise
from tests.estimator.evaluation.test_score import make_ended_run
from tests.estimator.evaluation.test_validate import Fresh, make_prediction
from tests.estimator.model_robot import TRUE_LENGTHS

SEEN = Observation(angles=(0.0,), touch=(False, False), tilt=(0.0, 0.0), clearance=0.053)


class Rise(Clearance):
    """Clearance in centimetres; it stands in the records where clearance does."""

    name = "rise"
    weight = 5.0
    error_factor = 100.0
    error_name = "rise_cm"
    error_limit = 0.2
    error_unit = " cm"
    heading = "rise (cm)"
    column_names = ("rise_mm",)

    def values(self, observation: Observation) -> tuple[Value, ...]:
        return (observation.clearance,)

    def field(self, values: Sequence[Value]) -> Mapping[str, object]:
        return {}

    def predicted(self, readings: PredictedReadings) -> Array | Flags:
        return readings.clearance[:, None]

    def say(self, observation: Observation) -> str:
        return f"rise {100 * (observation.clearance or 0.0):.1f} cm"


@pytest.fixture(autouse=True)
def modalities(monkeypatch: pytest.MonkeyPatch) -> tuple[str, ...]:
    """Names of the modalities, to which ``Rise`` is added."""
    (entries,) = gc.get_referents(MODALITIES)  # what the read-only view is a view of
    monkeypatch.setitem(entries, Rise.name, Rise())
    return tuple(MODALITIES)


def test_the_papers_error_counts_it(modalities: tuple[str, ...]) -> None:
    predicted = PredictedReadings.empty(1, 2)
    predicted.clearance[:], predicted.valid[:] = 0.033, True
    terms = LargestError().terms(predicted, SEEN, modalities)
    assert terms == pytest.approx([10 * 0.02 + 5 * 0.02])


def test_a_table_has_its_column(tmp_path: Path) -> None:
    write(tmp_path / "readings.csv", ["hip"], [SEEN])
    table = read(tmp_path / "readings.csv")
    assert table.counts["rise"] == 1
    assert (tmp_path / "readings.csv").read_text().splitlines()[1].endswith(",53.0000,53.0000")


def test_the_screen_says_it() -> None:
    text = io.StringIO()
    with Screen(Console(file=text, width=200)) as screen:
        screen.observed(0, SEEN)
    assert "53 mm clear, rise 5.3 cm." in text.getvalue()


@pytest.mark.parametrize(("clearance", "as_predicted"), [(0.052, 1), (0.050, 0)])
def test_its_own_limit_decides_what_is_as_predicted(clearance: float, as_predicted: int) -> None:
    prediction = make_prediction(0.0, 0.0, clearance)
    for rows in prediction.readings.values():
        rows["rise"] = rows["clearance"]
    validation = compare([prediction], [SEEN])
    assert validation.best_model["rise_cm"] == pytest.approx(100 * (0.053 - clearance))
    assert validation.as_predicted == as_predicted


def test_a_validated_run_reports_it(tmp_path: Path, physics: PyBulletPhysics) -> None:
    with make_ended_run(tmp_path, TRUE_LENGTHS) as run:
        validation = validate(run, physics, Fresh(), programs=2, saved=None, listener=Listener())
        write_document(run.directory / VALIDATION, validation)
        html, _ = run_page(run, summarise(run))
    text = io.StringIO()
    print_validation(Console(file=text, width=200), validation)
    assert "read as predicted, to 1.5°, 5 mm and 0.2 cm" in text.getvalue()
    assert "rise (cm)" in text.getvalue()
    assert "rise (cm)" in html
    assert "rise 0.0 cm" in html
