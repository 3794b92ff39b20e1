from estimator.reproduction.paper_runs import (
    FIGURES,
    SEEDS,
    VARIANTS,
    Budget,
    planned_runs,
    topological_runs,
)


def test_seeds_are_those_that_nothing_was_tuned_on() -> None:
    assert tuple(range(1000, 1030)) == SEEDS


def test_variants_come_in_the_captions_order() -> None:
    assert [variant.name for variant in VARIANTS] == [
        *("touch+tilt+clearance", "tilt+clearance", "touch+clearance", "touch+tilt"),
        *("touch", "tilt", "clearance"),
    ]
    assert [variant.number for variant in VARIANTS] == list(range(1, 8))


def test_the_whole_paper_is_230_runs_each_once() -> None:
    runs = planned_runs(FIGURES, None, Budget())
    assert len(runs) == len(set(runs)) == 7 * 30 + 10 + 10
    assert [run.problem for run in runs[:10]] == ["topological"] * 10  # the longest first
    assert [run.problem for run in runs[10:20]] == ["topological-20"] * 10
    assert len({run.name for run in runs}) == 230


def test_figures_share_their_runs() -> None:
    one = planned_runs(["fig3"], 3, Budget())
    assert set(planned_runs(["fig2"], 3, Budget())) < set(one)
    assert len(one) == 7 * 3
    assert planned_runs(["fig4", "fig5", "fig6"], 4, Budget()) == topological_runs(4, Budget())


def test_budgets_are_the_papers_unless_told_otherwise() -> None:
    (parametric,) = planned_runs(["fig2"], None, Budget())[:1]
    (topological,) = topological_runs(1, Budget())
    assert parametric.work == 100 * (4 + 10 * (1 + 2 + 3 + 4))
    assert topological.work == 300 * (9 + 40 * 45 + 20)
    order = topological.order("tcp://127.0.0.1:1")
    assert (order.interactions, order.population, order.generations) == (None, None, None)
    assert Budget().is_the_papers
    assert not Budget(interactions=2).is_the_papers
