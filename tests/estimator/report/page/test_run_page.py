"""A run's page in a real browser: turned, posed, read back, and on its own."""

from __future__ import annotations

import json
import math
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from typer.testing import CliRunner

from estimator.cli.command_line import app
from estimator.report.evaluations import SCORE, TRUTH, read_validation, score_of
from estimator.report.page.run_page import commands, run_page
from estimator.report.summarise import summarise
from estimator.storage.store import RunStore
from tests.browser import watched_page
from tests.estimator.kinematics import tips
from tests.estimator.report.made_runs import capabilities_with, made_run
from tests.estimator.report.page.screenshots import LOOKS, take_screenshots

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

SHIPPED = ("parametric", "topological", "topological-20", "topological-24")
OWN = ("file:", "data:")
COARSE = 0.25  # pixels of the screen for each of a page, along either side: drawn in less time
HOSTILE = "</script><img src=x onerror='window.owned=1'>&amp;$\\frac{\u202e\""
LARGEST = 5_000_000  # bytes


def report(directory: Path, *options: str | Path) -> Path:
    ended = CliRunner().invoke(app, ["report", str(directory), *map(str, options)])
    assert ended.exit_code == 0, ended.output
    return directory / "report.html"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run with rivals."""
    directory = made_run(tmp_path_factory.mktemp("page") / "run", "topological-24", "posterior")
    report(directory)
    return directory


def slide(page: Page, joint: int, degrees: float) -> None:
    page.locator(f"input[data-joint='{joint}']").evaluate(
        "(slider, value) => { slider.value = value; slider.dispatchEvent(new Event('input')); }",
        degrees,
    )


def ends(page: Page) -> np.ndarray:
    """The table of the parts' ends, m."""
    cells = page.locator("#ends tbody tr").evaluate_all(
        "rows => rows.map(row => [...row.cells].slice(1).map(cell => Number(cell.textContent)))"
    )
    return np.array(cells) / 1000


def test_the_page_poses_bodies_as_our_own_kinematics_do(run: Path, browser: Browser) -> None:
    with RunStore.open(run, to_write=False) as store:
        genome = store.genome
        modes = store.posteriors()[-1][0].modes
        performed = store.observations()[1].angles
    angles = [-25.0, 30.0, 12.5, -7.5, 22.0, -18.0, 3.0, 28.5]
    with watched_page(browser, *OWN, device_scale_factor=COARSE) as page:
        page.goto((run / "report.html").as_uri())
        page.locator("summary", has_text="ends of the parts").click()
        for chosen, mode in ((0, modes[0]), (3, modes[3])):
            page.locator("#whose").select_option(str(chosen))
            body = genome.decode(np.array(mode.genes))
            page.locator("#poses button", has_text="2").click()
            assert ends(page) == pytest.approx(tips(body, performed), abs=6e-5)
            for joint, angle in enumerate(angles):
                slide(page, joint, angle)
            assert "by hand" in page.locator("#pose-says").inner_text()
            expected = tips(body, np.radians(angles))
            assert ends(page) == pytest.approx(expected, abs=6e-5)
        assert page.locator("#sliders output").all_inner_texts()[:2] == ["-25.0°", "30.0°"]


def wait_until_seen_otherwise(page: Page, was: str) -> None:
    page.wait_for_function("was => document.getElementById('seen-from').value !== was", arg=was)


def test_the_body_is_turned_by_mouse_and_by_keys(run: Path, browser: Browser) -> None:
    with watched_page(browser, *OWN, device_scale_factor=COARSE) as page:
        page.goto((run / "report.html").as_uri())
        canvas = page.locator("#views canvas").first
        canvas.scroll_into_view_if_needed()
        seen = page.locator("#seen-from")
        pictures, sights = [canvas.screenshot()], [seen.inner_text()]
        box = canvas.bounding_box()
        assert box is not None
        page.mouse.move(box["x"] + 200, box["y"] + 150)
        page.mouse.down()
        page.mouse.move(box["x"] + 60, box["y"] + 120, steps=3)
        page.mouse.up()
        wait_until_seen_otherwise(page, was=sights[0])
        pictures.append(canvas.screenshot())
        sights.append(seen.inner_text())
        canvas.press("ArrowUp")
        wait_until_seen_otherwise(page, was=sights[1])
        pictures.append(canvas.screenshot())
    assert len(set(pictures)) == 3  # what is told is what is drawn
    assert sights[0] == "32° to the right of ahead, 30° up"


def test_it_shows_rivals_side_by_side_and_hides_uncertainty(run: Path, browser: Browser) -> None:
    with watched_page(browser, *OWN, device_scale_factor=COARSE) as page:
        page.goto((run / "report.html").as_uri())
        titles = page.locator("#views figcaption b").all_inner_texts()
        assert titles == ["Best body", "Rival 1", "Rival 2", "Rival 3"]
        labels = page.locator("#views canvas").evaluate_all(
            "all => all.map(item => item.ariaLabel)"
        )
        assert labels[0] == "Best body: attachments 60.0 % probable"
        canvas = page.locator("#views canvas").first
        hazy = canvas.screenshot()
        page.locator("#uncertainty").uncheck()
        page.evaluate("new Promise(requestAnimationFrame)")
        assert canvas.screenshot() != hazy
        assert not page.locator("#flat").is_visible()


def test_names_and_problems_from_others_stay_text(tmp_path: Path, browser: Browser) -> None:
    text = (Path(__file__).parents[4] / "estimator/problem/library/topological.toml").read_text()
    text = text.replace('name = "topological"', f"name = {json.dumps(HOSTILE)}")
    text = f"# {HOSTILE}\n" + text
    joints = tuple(f"{number}{HOSTILE}" for number in range(8))
    for method in ("paper", "posterior"):
        directory = made_run(
            tmp_path / method,
            text,
            "paper" if method == "paper" else "posterior",
            capabilities=capabilities_with(joints, HOSTILE),
        )
        file = report(directory)
        assert file.stat().st_size < LARGEST
        with watched_page(browser, *OWN, device_scale_factor=COARSE) as page:
            page.goto(file.as_uri())
            assert page.evaluate("window.owned") is None
            assert "window.owned" in page.locator(".kicker").inner_text()
            assert "0</script><img" in page.locator("#sliders").inner_text()
            assert page.locator("img").count() == 1  # the flat picture


def test_the_page_runs_no_script_but_its_own(run: Path, browser: Browser, tmp_path: Path) -> None:
    page_file = tmp_path / "report.html"
    text = (run / "report.html").read_text("utf-8")
    page_file.write_text(text.replace("</main>", "<script>window.owned = 1</script></main>"))
    page = browser.new_page(device_scale_factor=COARSE)
    refusals: list[str] = []
    page.on("console", lambda message: refusals.append(message.text))
    page.goto(page_file.as_uri())
    assert page.evaluate("window.owned") is None
    page.close()
    assert any("Content Security Policy" in refusal for refusal in refusals)


def test_without_webgl_there_is_the_picture(run: Path, browser: Browser) -> None:
    page = browser.new_page()
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page.goto((run / "report.html").as_uri())
    assert page.locator("#flat").is_visible()
    assert not page.locator("#stage").is_visible()
    page.close()


def test_it_looks_right_in_the_light_in_the_dark_on_a_phone_and_on_paper(
    run: Path, browser: Browser, tmp_path: Path
) -> None:
    take_screenshots(browser, run / "report.html", tmp_path)
    sizes = {look: (tmp_path / f"report-{look}.png").stat().st_size for look in LOOKS}
    assert min(sizes.values()) > 20_000, sizes  # something is drawn
    assert max(sizes.values()) < 400_000, sizes


@pytest.mark.parametrize(("problem", "method"), list(zip(SHIPPED, cycle(("paper", "posterior")))))
def test_every_shipped_problem_has_a_page(problem: str, method: str, tmp_path: Path) -> None:
    directory = made_run(
        tmp_path / "run",
        problem,
        "paper" if method == "paper" else "posterior",
        complete=method == "paper",
        explained=False,
    )
    text = report(directory).read_text("utf-8")
    assert ("This run is not finished" in text) == (method == "posterior")
    assert ("NO BODY THAT THIS PROBLEM ALLOWS explains interactions 1 and 2 (tilt)" in text) == (
        method == "posterior"
    )
    with RunStore.open(directory, to_write=False) as run:
        recorded = len(run.observations())
    again = f"--robot replay:{directory} --problem {problem} --method {method}"
    assert f"{again} --interactions {recorded} " in text
    assert "tells &lt;b&gt;1&lt;/b&gt; apart" in text or method == "paper"
    assert text.count("<svg") == 3
    assert ("undecided)" in text) == (method == "paper")


def test_a_run_that_moved_for_masses_is_made_again_so(tmp_path: Path) -> None:
    directory = made_run(tmp_path / "run", "parametric", "posterior")
    with RunStore.open(directory, to_write=False) as store:
        settings = store.settings
    for learn, said in (("all", []), ("mass", ["--learn", "mass"])):
        asked = settings.model_copy(update={"learn": learn})
        for command in commands(asked, directory, 3):
            words = command.split()
            assert words[words.index("--explore") + 2 :] == said


def test_a_run_that_has_learnt_nothing_yet_has_a_page(tmp_path: Path) -> None:
    directory = made_run(tmp_path / "run", "parametric", "paper", complete=False)
    with RunStore.open(directory) as store:
        store._database.execute("DELETE FROM generations")
        store._database.execute("DELETE FROM checkpoint")
    text = report(directory).read_text("utf-8")
    assert "Nothing is known of this body yet" in text
    assert "3 of 5 interactions are done" in text


def test_damaged_files_beside_a_run_are_passed_over(tmp_path: Path) -> None:
    directory = made_run(tmp_path / "run", "parametric", "paper", complete=False)
    (directory / SCORE).write_text("{")
    (directory / TRUTH).write_bytes(b"\xff\x00")
    (directory / "validation.json").mkdir()
    with RunStore.open(directory, to_write=False) as store:
        result = summarise(store)
        page, _ = run_page(store, result)
    assert (score_of(directory, result), read_validation(directory)) == (None, None)
    assert "True body" not in page


def test_a_damaged_run_is_a_sentence(tmp_path: Path) -> None:
    directory = made_run(tmp_path / "run", "parametric", "posterior")
    with RunStore.open(directory) as store:
        store._database.execute("UPDATE posteriors SET posterior = '{}'")
    ended = CliRunner().invoke(app, ["report", str(directory)])
    assert ended.exit_code == 1
    assert "it is damaged" in ended.stderr
    assert not (directory / "report.html").exists()


def test_the_angles_of_the_table_are_the_driven_joints(run: Path) -> None:
    with RunStore.open(run, to_write=False) as store:
        angles = store.observations()[0].angles
    said = ", ".join(f"{round(math.degrees(one)):+d}°".replace("-", "−") for one in angles)
    assert said in (run / "report.html").read_text("utf-8")
