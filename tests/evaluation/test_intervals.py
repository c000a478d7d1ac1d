"""Statistics over rows, each against a closed form or a slow plain version of itself."""

from dataclasses import replace
from itertools import combinations, product
from math import comb, inf, isnan, nan, sqrt
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import binom, norm, trim_mean

from bug_gym.evaluation.rows import FIELD_TYPES, OUTCOMES, EpisodeRow
from bug_gym.evaluation.summary import COMPARED, OVERALL, Summary, compare, paired_difference, summarise
from bug_gym.intervals import (
    exact_mcnemar,
    holm,
    interquartile_mean,
    interquartile_means,
    means,
    stratified_bootstrap,
    wilson_interval,
)

FloatArray = NDArray[np.float64]
BLANK = EpisodeRow(
    "a", "box", 0, 0, "success", "", True, 8.0, 80, 8.0, 0.2, 8.0, 1.0, nan, 0.5, 0, 0.0, 0.001, 0.002, 0.1
)


def row(policy: str, seed: int, outcome: str = "success", **changes: Any) -> EpisodeRow:
    """A row with an SPL that fits its outcome, and what else is given."""
    success = outcome == "success"
    basics = {"policy": policy, "seed": seed, "outcome": outcome, "success": success, "spl": float(success)}
    return replace(BLANK, **{**basics, **changes})


@pytest.mark.parametrize("confidence", [0.5, 0.9, 0.95, 0.999])
@pytest.mark.parametrize(("successes", "n"), [(0, 1), (1, 1), (0, 50), (1, 50), (25, 50), (50, 50), (333, 1000)])
def test_wilson_bounds_are_the_shares_that_the_score_test_just_rejects(
    successes: int, n: int, confidence: float
) -> None:
    share, z = successes / n, norm.isf((1.0 - confidence) / 2.0)

    def score(p: float) -> float:
        return float(abs(share - p) - z * sqrt(p * (1.0 - p) / n))

    low, high = wilson_interval(successes, n, confidence=confidence)
    # The score is negative near the share itself and positive at the far ends; at 0 and n one root is the end.
    inside = share if 0 < successes < n else min(max(share, 1e-9), 1.0 - 1e-9)
    assert low == pytest.approx(0.0 if successes == 0 else brentq(score, 0.0, inside, xtol=1e-14), abs=1e-9)
    assert high == pytest.approx(1.0 if successes == n else brentq(score, inside, 1.0, xtol=1e-14), abs=1e-9)


def test_wilson_interval_of_failures_mirrors_that_of_successes() -> None:
    low, high = wilson_interval(7, 30)
    mirrored = wilson_interval(23, 30)
    assert (low, high) == pytest.approx((1.0 - mirrored.high, 1.0 - mirrored.low))


@pytest.mark.parametrize(("successes", "n"), [(0, 0), (-1, 5), (6, 5)])
def test_wilson_refuses_impossible_counts(successes: int, n: int) -> None:
    with pytest.raises(ValueError, match="successes"):
        wilson_interval(successes, n)


@pytest.mark.parametrize("confidence", [0.0, 1.0, 95.0, nan])
def test_confidence_must_lie_between_0_and_1(confidence: float) -> None:
    with pytest.raises(ValueError, match="confidence"):
        wilson_interval(1, 2, confidence=confidence)


@pytest.mark.parametrize("n", range(1, 30))
def test_interquartile_mean_is_the_trimmed_mean(n: int) -> None:
    values = np.random.default_rng(n).normal(size=n) ** 3
    assert interquartile_mean(values) == pytest.approx(trim_mean(values, 0.25), rel=1e-12)


def test_interquartile_mean_of_rows_is_that_of_each_row() -> None:
    samples = np.random.default_rng(0).normal(size=(7, 11))
    assert interquartile_means(samples) == pytest.approx(trim_mean(samples, 0.25, axis=1), rel=1e-12)


def test_interquartile_mean_ignores_an_outlier() -> None:
    assert interquartile_mean([1.0, 2.0, 3.0, 1e9]) == 2.5


@pytest.mark.parametrize("values", [[], [[1.0, 2.0]], [1.0, nan], [1.0, inf]])
def test_interquartile_mean_refuses_what_is_no_sample(values: Any) -> None:
    with pytest.raises(ValueError, match="values"):
        interquartile_mean(values)


def test_bootstrap_covers_the_mean_of_a_normal_as_often_as_it_says() -> None:
    rng, trials, n = np.random.default_rng(5), 1000, 40
    samples = rng.normal(3.0, 2.0, (trials, n))
    intervals = [stratified_bootstrap([sample], means, resamples=400, seed=seed) for seed, sample in enumerate(samples)]
    covered = np.mean([low <= 3.0 <= high for low, high in intervals])
    # The percentile interval is about 1.96 standard deviations (with n, not n - 1) of the mean wide to either side,
    # which a t variable of 39 degrees keeps with 94 %; 400 resamples cost up to another 1 %. The standard error is
    # 0.75 %, and an interval of 90 % would cover 89 %.
    assert 0.915 <= covered <= 0.965


def test_bootstrap_covers_the_interquartile_mean_of_a_skewed_distribution() -> None:
    rng, trials, n = np.random.default_rng(6), 600, 60
    samples = rng.exponential(size=(trials, n))
    # Middle half of the exponential: the integral of -log(1 - q) over q from 1/4 to 3/4, over 1/2.
    truth = 2.0 * (0.5 + 0.25 * np.log(0.25) - 0.75 * np.log(0.75))
    intervals = [
        stratified_bootstrap([sample], interquartile_means, resamples=400, seed=seed)
        for seed, sample in enumerate(samples)
    ]
    covered = np.mean([low <= truth <= high for low, high in intervals])
    assert 0.91 <= covered <= 0.975


def test_bootstrap_of_a_share_has_the_quantiles_of_the_binomial() -> None:
    values = [0.0] * 30 + [1.0] * 20
    low, high = stratified_bootstrap([values], means, resamples=40_000, seed=1)
    assert (low * 50, high * 50) == pytest.approx(binom.ppf((0.025, 0.975), 50, 0.4), abs=1e-9)


def test_bootstrap_bounds_move_with_the_confidence() -> None:
    values = [0.0] * 30 + [1.0] * 20
    low, high = stratified_bootstrap([values], means, resamples=40_000, seed=1, confidence=0.5)
    assert (low * 50, high * 50) == pytest.approx(binom.ppf((0.25, 0.75), 50, 0.4), abs=1e-9)


def test_bootstrap_leaves_the_spread_between_strata_out() -> None:
    rng = np.random.default_rng(2)
    strata = [rng.normal(1000.0 * index, 1.0, 50) for index in range(4)]
    low, high = stratified_bootstrap(strata, means, resamples=4000, seed=1)
    # The standard error of a stratified mean: spreads within strata only. Unstratified it would be about 79.
    error = sqrt(sum(float(np.var(stratum)) * 50 for stratum in strata)) / 200
    assert high - low == pytest.approx(2.0 * 1.96 * error, rel=0.05)


def test_bootstrap_keeps_the_size_of_each_stratum() -> None:
    low, high = stratified_bootstrap([[0.0] * 30, [1.0] * 10], means, resamples=500)
    assert low == high == 0.25


def test_bootstrap_is_the_same_for_the_same_seed_and_another_for_another() -> None:
    values = np.random.default_rng(3).normal(size=30)
    first, again, other = (stratified_bootstrap([values], means, resamples=200, seed=seed) for seed in (1, 1, 2))
    assert first == again != other


def test_bootstrap_in_blocks_makes_all_resamples() -> None:
    sizes: list[int] = []

    def count(samples: FloatArray) -> FloatArray:
        sizes.append(len(samples))
        return means(samples)

    stratified_bootstrap([np.arange(300_000.0)], count, resamples=7)
    assert sum(sizes) == 7 and len(sizes) > 1


def test_bootstrap_of_single_values_feigns_no_certainty() -> None:
    low, high = stratified_bootstrap([[0.4], [0.6]], means)
    assert isnan(low) and isnan(high)


@pytest.mark.parametrize("strata", [[], [[1.0], []], [[1.0, nan]], [[[1.0]]]])
def test_bootstrap_refuses_empty_and_broken_strata(strata: Any) -> None:
    with pytest.raises(ValueError):
        stratified_bootstrap(strata, means)


def test_bootstrap_refuses_to_make_no_resamples() -> None:
    with pytest.raises(ValueError, match="resamples"):
        stratified_bootstrap([[1.0, 2.0]], means, resamples=0)


def test_bootstrap_refuses_a_statistic_that_pools_the_resamples() -> None:
    with pytest.raises(ValueError, match="statistic"):
        stratified_bootstrap([[1.0, 2.0]], lambda samples: np.asarray(samples.mean()))


@pytest.mark.parametrize(("only_a", "only_b"), [(0, 1), (0, 6), (1, 9), (5, 5), (7, 4), (2, 12)])
def test_mcnemar_is_the_share_of_sign_flips_at_least_as_lopsided(only_a: int, only_b: int) -> None:
    flips = np.array(list(product((-1, 1), repeat=only_a + only_b))).sum(axis=1)
    assert exact_mcnemar(only_a, only_b) == pytest.approx((np.abs(flips) >= abs(only_a - only_b)).mean())


def test_mcnemar_of_no_disagreement_is_one() -> None:
    assert exact_mcnemar(0, 0) == 1.0


@pytest.mark.parametrize("counts", [(-1, 3), (3, -1)])
def test_mcnemar_refuses_negative_counts(counts: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="counts"):
        exact_mcnemar(*counts)


@pytest.mark.parametrize("p_values", [(0.04,), (0.01, 0.04), (0.04, 0.01, 0.03, 0.03), (0.5, 0.0, 1.0, 0.02, 0.02)])
def test_holm_rejects_what_bonferroni_rejects_together_with_any_others(p_values: tuple[float, ...]) -> None:
    """The closed test: each set of tests by Bonferroni, and one test by the worst set that it is in."""
    sets = [some for size in range(1, len(p_values) + 1) for some in combinations(range(len(p_values)), size)]
    of_set = {some: min(1.0, len(some) * min(p_values[index] for index in some)) for some in sets}
    expected = [max(p for some, p in of_set.items() if index in some) for index in range(len(p_values))]
    assert holm(p_values) == pytest.approx(expected)


def test_holm_refuses_what_is_no_p_value() -> None:
    assert holm([]) == []
    for wrong in (-0.1, 1.1, nan):
        with pytest.raises(ValueError, match="p values"):
            holm([0.5, wrong])


def test_paired_difference_is_the_mean_over_common_worlds() -> None:
    ours = [row("a", 1, spl=0.9), row("a", 2, spl=0.5), row("a", 3, spl=0.1)]
    theirs = [row("b", 3, spl=0.5), row("b", 2, spl=0.7), row("b", 9, spl=0.0)]
    result = paired_difference(ours, theirs, "spl")
    assert (result.policy, result.baseline, result.field, result.n) == ("a", "b", "spl", 2)
    assert result.mean == pytest.approx((0.5 - 0.7 + 0.1 - 0.5) / 2)


def test_the_same_seed_in_another_scenario_or_robot_is_another_world() -> None:
    ours = [row("a", 1, spl=0.9), row("a", 1, scenario="maze", spl=0.4), row("a", 1, robot=1, spl=0.2)]
    theirs = [row("b", 1, scenario="maze", spl=0.3)]
    assert paired_difference(ours, theirs, "spl").mean == pytest.approx(0.1)


def test_paired_difference_does_not_see_what_both_share() -> None:
    rng = np.random.default_rng(4)
    hardness = rng.uniform(0.2, 0.8, 60)
    ours = [row("a", seed, spl=float(value + 0.1)) for seed, value in enumerate(hardness)]
    theirs = [row("b", seed, spl=float(value)) for seed, value in enumerate(hardness)]
    result = paired_difference(ours, theirs, "spl")
    assert (result.low, result.high) == pytest.approx((0.1, 0.1))


def test_paired_difference_changes_its_sign_when_turned_round() -> None:
    rng = np.random.default_rng(5)
    ours = [row("a", seed, spl=float(rng.uniform())) for seed in range(20)]
    theirs = [row("b", seed, spl=float(rng.uniform())) for seed in range(20)]
    one, other = paired_difference(ours, theirs, "spl"), paired_difference(theirs, ours, "spl")
    assert (one.mean, one.low, one.high) == pytest.approx((-other.mean, -other.high, -other.low))


def test_paired_success_counts_the_disagreements() -> None:
    # 3 worlds solved by both, 6 by a only, 1 by b only, 2 by neither.
    outcomes = [("success", "success")] * 3 + [("success", "timeout")] * 6 + [("timeout", "success")]
    outcomes += [("timeout", "collision")] * 2
    ours = [row("a", seed, ours) for seed, (ours, _) in enumerate(outcomes)]
    theirs = [row("b", seed, theirs) for seed, (_, theirs) in enumerate(outcomes)]
    result = paired_difference(ours, theirs, "success")
    assert result.mean == pytest.approx((6 - 1) / 12) and result.n == 12
    assert result.p_value == pytest.approx(2.0 * (comb(7, 0) + comb(7, 1)) / 2.0**7)
    assert result.low < result.mean < result.high


def test_p_value_is_for_success_only() -> None:
    ours, theirs = [row("a", 1), row("a", 2)], [row("b", 1), row("b", 2)]
    assert isnan(paired_difference(ours, theirs, "spl").p_value)


def test_time_is_compared_where_both_succeeded() -> None:
    ours = [row("a", 1, time=9.0), row("a", 2, "collision", time=1.0), row("a", 3, time=5.0)]
    theirs = [row("b", 1, time=6.0), row("b", 2, time=8.0), row("b", 3, "timeout", time=60.0)]
    result = paired_difference(ours, theirs, "time")
    assert (result.n, result.mean) == (1, 3.0) and isnan(result.low)


@pytest.mark.parametrize("field", ["steps", "path_length", "time_ratio", "min_clearance", "turns", "total_turning"])
def test_nothing_that_a_failure_cuts_short_is_compared_with_a_success(field: str) -> None:
    """A crash after a second is no short way with few turns."""
    kind = FIELD_TYPES[field]
    ours = [row("a", 1, **{field: kind(3)}), row("a", 2, "collision", **{field: kind(0)}), row("a", 3)]
    theirs = [
        row("b", 1, **{field: kind(1)}),
        row("b", 2, **{field: kind(9)}),
        row("b", 3, "timeout", **{field: kind(0)}),
    ]
    result = paired_difference(ours, theirs, field)
    assert (result.n, result.mean) == (1, 2.0)


def test_a_field_that_no_pair_has_gives_nan_over_no_pairs() -> None:
    result = paired_difference([row("a", 1, spl=nan)], [row("b", 1, spl=nan)], "spl")
    assert result.n == 0 and isnan(result.mean) and isnan(result.low) and isnan(result.high)


@pytest.mark.parametrize("field", ["policy", "seed", "robot", "speed"])
def test_paired_difference_refuses_a_field_that_measures_nothing(field: str) -> None:
    with pytest.raises(ValueError, match="field must be one of success, time"):
        paired_difference([row("a", 1)], [row("b", 1)], field)


def test_paired_difference_refuses_policies_that_never_met_the_same_world() -> None:
    with pytest.raises(ValueError, match="no world in common"):
        paired_difference([row("a", 1)], [row("b", 2)], "spl")


@pytest.mark.parametrize("rows", [[], [row("a", 1), row("c", 2)], [row("a", 1), row("a", 1)]])
def test_paired_difference_refuses_no_rows_mixed_policies_and_repeated_worlds(rows: list[EpisodeRow]) -> None:
    with pytest.raises(ValueError):
        paired_difference(rows, [row("b", 1)], "spl")


def test_compare_takes_each_other_policy_and_field_against_the_baseline() -> None:
    rows = [row(policy, seed, spl=value) for policy, value in (("a", 0.5), ("b", 0.7), ("c", 0.9)) for seed in (1, 2)]
    results = compare(rows, "b")
    assert [(result.policy, result.baseline, result.field) for result in results] == [
        (policy, "b", field) for policy in "ac" for field in COMPARED
    ]
    spls = [result.mean for result in results if result.field == "spl"]
    assert spls == pytest.approx([-0.2, 0.2])


def test_compare_leaves_out_who_has_no_world_in_common_with_the_baseline() -> None:
    rows = [row("a", 1), row("b", 1), row("c", 2)]
    assert {result.policy for result in compare(rows, "a")} == {"b"}


def test_compare_names_the_policies_that_a_baseline_could_be() -> None:
    with pytest.raises(ValueError, match="one of a, came 'b'"):
        compare([row("a", 1)], "b")


def only(summaries: list[Summary], scenario: str) -> Summary:
    """The one summary of a scenario."""
    (found,) = [summary for summary in summaries if summary.scenario == scenario]
    return found


MIXED = [
    row(
        "a",
        1,
        time=10.0,
        path_length=11.7,
        goal_distance=0.3,
        shortest_path_length=8.0,
        spl=8.0 / 12.0,
        min_clearance=0.3,
    ),
    row("a", 2, time=20.0, path_length=9.8, goal_distance=0.2, shortest_path_length=10.0, spl=1.0, min_clearance=0.1),
    row("a", 3, "collision", time=1.0, path_length=1.0, min_clearance=-0.01, decision_time_mean=0.007),
    row("a", 4, "timeout", time=60.0),
    row("a", 5, "gave_up", verdict="stuck"),
    row("a", 6, "gave_up", verdict="unreachable", shortest_path_length=inf, spl=nan),
    row("a", 7, "gave_up", verdict="unreachable", shortest_path_length=inf, spl=nan),
    row("a", 8, time=30.0, shortest_path_length=nan, spl=nan, min_clearance=0.2),
    row("a", 9, time=40.0, shortest_path_length=inf, spl=nan, min_clearance=0.4),
    row("a", 10, "collision"),
]


def test_summary_counts_outcomes_and_verdicts() -> None:
    summary = only(summarise(MIXED), "box")
    assert summary.n == 10
    assert (summary.success, summary.collision, summary.timeout, summary.gave_up) == (0.4, 0.2, 0.1, 0.3)
    assert summary.verdicts == {"stuck": 1, "unreachable": 2}
    assert (summary.success_low, summary.success_high) == wilson_interval(4, 10)


def test_summary_takes_times_and_clearances_of_successes_only() -> None:
    summary = only(summarise(MIXED), "box")
    assert summary.time == pytest.approx((10.0 + 20.0 + 30.0 + 40.0) / 4)
    assert summary.min_clearance == pytest.approx((0.3 + 0.1 + 0.2 + 0.4) / 4)


def test_summary_takes_path_ratios_with_the_rest_of_the_way_where_a_shortest_path_is_known() -> None:
    assert only(summarise(MIXED), "box").path_ratio == pytest.approx((12.0 / 8.0 + 1.0) / 2)


def test_summary_takes_spl_over_all_rows_that_have_one() -> None:
    summary = only(summarise(MIXED), "box")
    spls = [8.0 / 12.0, 1.0, 0.0, 0.0, 0.0, 0.0]
    assert summary.spl_n == 6
    assert summary.spl == pytest.approx(np.mean(spls))
    assert summary.spl_iqm == pytest.approx(trim_mean(spls, 0.25))
    assert summary.spl_iqm_low <= summary.spl_iqm <= summary.spl_iqm_high


def test_summary_takes_the_median_of_the_decision_times() -> None:
    rows = [row("a", seed, decision_time_mean=time) for seed, time in enumerate((0.001, 0.002, 0.9))]
    assert only(summarise(rows), "box").decision_time == 0.002


def test_summary_of_a_moving_target_has_a_time_ratio_and_no_spl() -> None:
    rows = [row("a", 1, spl=nan, time_ratio=0.5), row("a", 2, spl=nan, time_ratio=0.8), row("a", 3, "timeout", spl=nan)]
    summary = only(summarise(rows), "box")
    assert summary.time_ratio == pytest.approx(0.65)
    assert summary.spl_n == 0 and isnan(summary.spl) and isnan(summary.spl_iqm) and isnan(summary.spl_iqm_low)


def test_summary_without_a_success_has_no_time() -> None:
    summary = only(summarise([row("a", 1, "timeout"), row("a", 2, "collision")]), "box")
    assert isnan(summary.time) and isnan(summary.path_ratio) and summary.spl == 0.0


def test_summaries_come_by_scenario_then_over_all_for_policies_that_drove_in_each() -> None:
    rows = [row("a", 1, scenario="maze"), row("b", 1, scenario="maze"), row("a", 1, scenario="field")]
    assert [(summary.scenario, summary.policy) for summary in summarise(rows)] == [
        ("maze", "a"),
        ("maze", "b"),
        ("field", "a"),
        (OVERALL, "a"),
    ]


def test_the_summary_over_all_scenarios_pools_their_rows() -> None:
    rows = [row("a", seed, scenario="maze") for seed in range(3)] + [row("a", 1, "timeout", scenario="field")]
    overall = only(summarise(rows), OVERALL)
    assert (overall.n, overall.success) == (4, 0.75)


def test_the_interval_over_all_scenarios_leaves_their_differences_out() -> None:
    # Within either scenario all episodes are alike; an unstratified bootstrap would mix them.
    rows = [row("a", seed, scenario=name, spl=value) for name, value in (("x", 0.2), ("y", 0.8)) for seed in range(20)]
    overall = only(summarise(rows), OVERALL)
    assert overall.spl_iqm == pytest.approx(0.5)
    assert (overall.spl_iqm_low, overall.spl_iqm_high) == pytest.approx((0.5, 0.5))


def test_summaries_are_the_same_every_time() -> None:
    rng = np.random.default_rng(0)
    rows = [row("a", seed, spl=float(rng.uniform())) for seed in range(30)]
    first, again = summarise(rows), summarise(rows)
    assert [summary.as_dict() for summary in first] == [summary.as_dict() for summary in again]


def test_a_summary_is_fit_for_strict_json() -> None:
    data = only(summarise([row("a", 1, spl=nan, min_clearance=inf)]), "box").as_dict()
    assert data["spl"] is None and data["min_clearance"] == "inf"


@pytest.mark.parametrize("rows", [[], [row("a", 1), row("a", 1)], [row("a", 1, scenario=OVERALL)]])
def test_summarise_refuses_no_rows_repeated_rows_and_a_reserved_name(rows: list[EpisodeRow]) -> None:
    with pytest.raises(ValueError):
        summarise(rows)


def test_shares_of_all_outcomes_add_up_to_one() -> None:
    rng = np.random.default_rng(9)
    rows = [row("a", seed, str(rng.choice(OUTCOMES))) for seed in range(50)]
    summary = only(summarise(rows), "box")
    unsolved = summary.collision + summary.timeout + summary.ended + summary.gave_up
    assert summary.success + unsolved == pytest.approx(1.0)
