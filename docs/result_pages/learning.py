"""Pages of what is learned: policies, a learning curve, predictors, and scripted policies beside learned ones."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from bug_gym.reproductions import offline, scripted_and_learned
from result_pages import Page, Record
from result_pages.words import between, listed, number, percent, picture, table

TRAINED = Path(__file__).resolve().parents[2] / "agents" / "trained"


def learned(found: Record) -> Page:
    """The shipped models in held-out worlds, beside the records of their trainings."""
    rows, trainings = [], []
    for name, scenarios in found["models"].items():
        record = json.loads((TRAINED / name / "config.json").read_text(encoding="utf-8"))
        runs, settings = record["runs"], record["settings"]
        for scenario, held in scenarios.items():
            seeds = [percent(one["held_out"][scenario]["success"]) for one in runs.values()]
            ends = [percent(held[end]) for end in ("collision", "timeout")]
            success = f"{percent(held['success'])} ({between(held['low'], held['high'])})"
            rows.append([f"`{name}`", f"`{scenario}`", success, *ends, number(held["time"], 1), ", ".join(seeds)])
        last = [one["curve"][-1] for one in runs.values()]
        memory = f"what changed in {listed(map(str, record['history']))} steps" if record["history"] else "-"
        trainings.append(
            [
                f"`{name}`", settings["algo"].upper(), memory,
                f"`{settings['start_from']}`" if settings["start_from"] else "-",
                f"{last[0]['steps']:,}", ", ".join(f"{one['cpu_seconds'] / 60:.1f}" for one in last),
                str(record["seed"]), record["machine"]["cpu"],
            ]
        )  # fmt: skip
    rush = json.loads((TRAINED / "ppo_rush" / "config.json").read_text(encoding="utf-8"))
    card = rush["runs"][str(rush["seed"])]["held_out"]["rush"]["success"]
    ours = found["models"]["ppo_rush"]["rush"]["success"]
    return Page(
        [
            table(
                f"The shipped model of each name in {found['worlds']:,} held-out worlds",
                ["name", "scenario", "success [%] (95 %)", "collision [%]", "timeout [%]", "time [s]", "by seed [%]"],
                rows,
            ),
            table(
                "How they were trained",
                [
                    "name",
                    "algorithm",
                    "memory",
                    "begun from",
                    "steps",
                    "minutes of one core",
                    "shipped seed",
                    "machine",
                ],
                trainings,
            ),
        ],
        "The shipped model is the one of three training seeds that did best in its validation. The last column of the "
        "first table is the same measure of all three, made by torch when they were trained; it and the second table "
        "come from the records in `agents/trained`.\n\n"
        f"The two numbers of the shipped seed of `ppo_rush`, {percent(card)} and {percent(ours)} %, are one model, played "
        "by torch for its record and by onnxruntime here. Their actions agree but for rounding, which differs from one kind of "
        "processor to the next too; among twenty fast movers such a difference grows to another episode within seconds, and "
        "so many worlds tell success to no better than a point or two.",
        [
            (f"`{name}` reaches at least {percent(asked)} % of `{scenario}`", held["success"] >= asked)
            for name, asked in found["targets"].items()
            for scenario, held in found["models"][name].items()
        ],
    )


def ppo_curve(found: Record) -> Page:
    """Success over the time of one core."""
    gate = found["gate"]

    def after(curve: Sequence[Record], asked: float) -> str:
        return number(next((one["seconds"] for one in curve if one["success"] >= asked), None), 0)

    rows = [
        [
            str(seed), f"{curve[-1]['steps']:,}", number(curve[-1]["seconds"], 0), percent(curve[-1]["success"]),
            after(curve, 0.9), after(curve, 0.98),
        ]
        for seed, curve in enumerate(found["curves"])
    ]  # fmt: skip
    last = [curve[-1]["success"] for curve in found["curves"]]
    return Page(
        [
            picture("ppo-curve", "Success of PPO on BugGym/Dynamic-v0 over the seconds of its training"),
            table(
                "PPO on `dynamic`",
                ["seed", "steps", "seconds of one core", "success [%]", "90 % after [s]", "98 % after [s]"],
                rows,
            ),
        ],
        "Validation does not count as time. The step size falls to 0 at the last step: this is a whole training, not the "
        "beginning of a longer one.",
        [(f"each training ends with at least {percent(gate)} % in validation worlds", min(last) >= gate)],
    )


def offline_learning(found: Record) -> Page:
    """Models of recorded episodes, beside who drove them and beside PPO."""

    def line(label: str, runs: Sequence[Record], seeds: str) -> list[str]:
        one = offline.pooled(runs)
        ends = [percent(sum(run[end] for run in runs) / len(runs)) for end in ("collision", "timeout")]
        by_seed = ", ".join(percent(run["success"]) for run in runs)
        success = f"{percent(one['success'])} ({between(one['low'], one['high'])})"
        return [f"`{label}`", seeds, success, by_seed, *ends, number(100 * one["score"], 1), number(one["minutes"], 1)]

    rows = [line(label, runs, str(len(runs))) for label, runs in found["trainings"].items()]
    rows += [line(name, [one], "-") for name, one in found["beside"].items()]
    drivers = offline.MIXED["data"]["policies"]
    best = max(drivers, key=lambda name: float(found["beside"][name]["success"]))
    seeds = f"{found['seeds']} training seed{'s' * (found['seeds'] != 1)}"
    return Page(
        [
            table(
                f"{found['worlds']} held-out worlds of `{found['scenario']}`, {seeds} a row",
                [
                    *("", "seeds", "success [%] (95 %)", "by seed [%]", "collision [%]", "timeout [%]"),
                    *("normalised score", "minutes of one core"),
                ],
                rows,
            ),
            *starts_tables(found.get("starts", [])),
        ],
        f"Each number is of {seeds} of each kind ({offline.SEEDS} unless `--seeds` says otherwise). The interval is of "
        f"the worlds of all seeds together. But these are the same {found['worlds']} for each seed, so that it is rather too "
        "narrow, and it says nothing of how seeds differ. The score is 0 for `random` and 100 for "
        f"`{offline.EXPERT}`, by their mean returns in the same worlds. Minutes are of training, the questions to DAgger's "
        "expert included, collection and validation not; the machine was shared, so they are upper bounds.\n\n"
        f"The mixed dataset holds as many episodes of each of {listed(f'`{name}`' for name in drivers)}, of which `{best}` "
        f"does best ({percent(found['beside'][best]['success'])} %); `filtered_bc_mixed` clones the tenth of them with the "
        "highest returns. The expert remembers obstacles and follows the tracks of what moves; a network that sees one scan, "
        f"or one scan and what changed, cannot tell apart all that it tells apart.{started_from(found.get('starts', []))}",
        list(found["claims"].items()),
    )


def starts_tables(starts: Sequence[Record]) -> list[str]:
    """How soon PPO learnt enough, from nothing and from a clone; none where nobody has looked."""
    rows = [
        [
            str(one["seed"]), number(one["from_nothing"], 2), number(one["from_clone"], 2),
            number(one["clone"]["minutes"], 2), percent(one["clone"]["success"]),
        ]
        for one in starts
    ]  # fmt: skip
    header = ["seed", "from nothing", "from the clone", "the clone's own", "the clone's success [%]"]
    title = f"PPO: minutes of one core to {percent(offline.ENOUGH)} % of validation worlds"
    return [table(title, header, rows)] if starts else []


def started_from(starts: Sequence[Record]) -> str:
    """What the second table is of."""
    if not starts:
        return ""
    changes = offline.ONLINE_CHANGES
    return (
        f"\n\nPPO is the training `{offline.ONLINE_TRAINING}` with {changes['n_timesteps']:,} steps, looked at every "
        f"{changes['eval_freq']:,} in {changes['eval_episodes']} validation worlds; `{offline.CLONE}` of the same seed is what "
        "it begins with in the third column. The collection of what the clone learns from is not counted."
    )


def ratio_table(title: str, found: Record, names: Sequence[str]) -> str:
    """Mean error up to the last time ahead over the Kalman filter's."""
    rows = [
        [
            label, str(one["tracks"]), str(one["worlds"]), number(one["mean"]["kalman"][-1]["value"]),
            *(
                f"{ratio['value']:.2f} ({ratio['low']:.2f} - {ratio['high']:.2f})"
                for name in names
                for ratio in one["mean_ratio"][name][-1:]
            ),
        ]
        for label, one in found.items()
    ]  # fmt: skip
    header = ["movers", "tracks", "worlds", "Kalman [m]", *(f"`{name}` / Kalman (95 %)" for name in names)]
    return table(title, header, rows)


def predictor_training() -> str:
    """A sentence on how the shipped predictors came to their cost."""
    rl, supervised = (
        json.loads((TRAINED / f"{name}_predictor" / "predictor.json").read_text(encoding="utf-8"))
        for name in ("rl", "supervised")
    )
    curves = [rl["curve"], *rl["repeats"].values()]
    costs = listed(f"{curve[-1]['cost']:.3f}" for curve in curves)
    minutes = listed(f"{curve[-1]['cpu_seconds'] / 60:.0f}" for curve in curves)
    return (
        f"The shipped `rl` learnt by PPO of stable-baselines3, {rl['settings']['tries']} answers tried to each question, "
        "what was tried at a horizon judged there by the mean of the others. Before it had learnt anything its "
        f"validation cost was about the filter's, {rl['curve'][0]['cost']:.2f}; after {rl['curve'][-1]['samples']:,} samples "
        f"it was {costs} with three seeds, the first the shipped one, in {minutes} minutes of one core. Supervision came to "
        f"{supervised['curve'][-1]['cost']:.3f} with {supervised['curve'][-1]['samples']:,} samples in "
        f"{supervised['curve'][-1]['cpu_seconds'] / 60:.0f} minutes of one core (the records in `agents/trained`)."
    )


def predictor_errors(found: Record) -> Page:
    """Errors of all predictors about the same tracks."""
    errors, other = found["errors"], found["other_scene"]
    ahead = found["times"][-1]
    names = [name for name in errors["bounce"]["mean"] if name != "kalman"]
    tables = [ratio_table(f"Mean error up to {ahead:g} s over the Kalman filter's", errors, names)]
    for tested, one in other.items():
        tables.append(
            ratio_table(
                f"{tested}, as shipped and trained on with the other scene", {tested: one}, list(one["mean_ratio"])
            )
        )
    for kind, says in (("mean", "in the mean over the times up to"), ("final", "at")):
        rows = [
            [label, f"`{name}`", *(f"{one['value']:.2f} ({one['low']:.2f} - {one['high']:.2f})" for one in row)]
            for label, of in errors.items()
            for name, row in of[kind].items()
        ]
        header = ["movers", "predictor", *(f"{time:g} s" for time in found["times"])]
        tables.append(table(f"Displacement error [m] (95 %) {says} each time ahead", header, rows))

    def times_filter(scene: str, name: str, seen: str = "") -> str:
        one = other[scene]["mean_ratio"][name + seen][-1]
        return f"{one['value']:.2f} ({one['low']:.2f} - {one['high']:.2f})"

    laws = [one["mean_ratio"]["rl"][-1]["high"] < 1.0 for label, one in errors.items() if label not in other]
    scenes = " ".join(
        f"At {tested} the mean error of `rl` is {times_filter(tested, 'rl')} times the filter's, that of `supervised` "
        f"{times_filter(tested, 'supervised')}; trained on with {seen} {times_filter(tested, 'rl', after)} and "
        f"{times_filter(tested, 'supervised', after)}."
        for tested, seen in (("ETH", "hotel"), ("hotel", "ETH"))
        for after in [f", trained on with {seen}"]
    )
    return Page(
        tables,
        f"Under laws that were seen learning pays in {sum(laws)} of {len(laws)} lines, on people that were not seen it depends "
        f"on the place. {scenes} Reinforcement nearly matches "
        f"supervision and gains nothing beyond it.\n\n{predictor_training()} Other ways to learn, and the second stage "
        "through the map planner's own runs, are on the page of [trials](../trials.md). (Eight of the recorded crossings were "
        "looked at while the training data was designed; none was trained on.) What a better prediction is worth inside "
        "`hd_bug_map` says the page of [hd-bug-dynamic](hd-bug-dynamic.md).",
        list(found["claims"].items()),
    )


SCRIPTED = ("bug2", "tangent_bug", "hd_bug", "hd_bug_map", "navigator")
SHOWN = (*SCRIPTED, "ppo_dynamic", "ppo_mixed", "ppo_rush", "sac_dynamic", "dqn_candidates")
"""Policies of the short table of scripted and learned ones."""


def are_apart(one: Record, other: Record) -> bool:
    """Whether the intervals of success have nothing in common."""
    return bool(one["success_low"] > other["success_high"] or other["success_low"] > one["success_high"])


def side_by_side(found: Record) -> Page:
    """Scripted and learned policies in the same worlds."""
    scenarios = list(found["collisions"])
    by = {(one["policy"], one["scenario"]): one for one in found["summaries"]}
    short = [
        [f"`{name}`", *(percent(by[name, place]["success"]) if (name, place) in by else "-" for place in scenarios)]
        for name in SHOWN
    ]
    tables = [table(f"Success [%] of {found['worlds']} worlds", ["", *scenarios], short)]
    header = ["policy", "success [%] (95 %)", "SPL", "time [s]", "collision [%]", "timeout [%]", "gave up [%]"]
    for place in scenarios:
        rows = []
        for (name, scenario), one in by.items():
            if scenario != place:
                continue
            kinds = ", ".join(f"{count} {kind}" for kind, count in found["collisions"][place][name].items())
            success = f"{percent(one['success'])} ({between(one['success_low'], one['success_high'])})"
            ends = [percent(one[end]) for end in ("collision", "timeout", "gave_up")]
            decision = number(1e3 * one["decision_time"], 3)
            rows.append(
                [f"`{name}`", success, number(one["spl"]), number(one["time"], 1), *ends, decision, kinds or "-"]
            )
        tables.append(table(place, [*header, "a decision [ms]", "collisions with"], rows))
    base = scripted_and_learned.BASELINE
    paired = [
        [
            one["scenario"], f"`{one['policy']}`", f"{100 * one['mean']:+.0f}",
            "-" if one["low"] is None else f"{100 * one['low']:+.0f} to {100 * one['high']:+.0f}", f"{one['p_value']:.2g}",
        ]
        for one in found["differences"]
    ]  # fmt: skip
    tables.append(table(f"Success minus that of `{base}` [points]", ["", "policy", "mean", "95 %", "p"], paired))

    def says(name: str, *places: str) -> str:
        return listed(f"{percent(by[name, place]['success'])} % of `{place}`" for place in places)

    nets = [name for name in SHOWN if name not in SCRIPTED]
    best = {place: max(by[name, place]["success"] for name in nets) for place in ("maze", "rooms", "u_trap")}
    fast = ("rush", "denser", "faster")
    apart = [place for place in fast if are_apart(by["ppo_mixed", place], by["hd_bug_map", place])]
    return Page(
        tables,
        f"The worlds are the same for all; SPL where the goal stands, times of successes. The intervals say "
        "what so many worlds tell apart; p is not corrected for the number of comparisons. The real maps were scanned by "
        "robots. No network was trained or validated in these worlds, whose seeds begin at 0. Some settings of `hd_bug`, "
        "`hd_bug_map` and `navigator` were chosen on seeds below 1,000, those of the tracker on the first 80 of `dynamic` and "
        "`rush` ([trials](../trials.md)), so their numbers may be a little too good.\n\n"
        "Among fast and many movers `ppo_mixed`, which learnt what a scan of movers means, reaches "
        f"{says('ppo_mixed', *fast)}; `hd_bug_map`, which tracks and predicts them, {says('hd_bug_map', *fast)}. The "
        f"intervals of the two lie apart in {listed(apart) if apart else 'none of these'}; what a learned predictor adds says "
        "[hd-bug-dynamic](hd-bug-dynamic.md). In mazes, rooms and traps, where one has to remember, the networks "
        f"fail: the best of those above reaches {listed(f'{percent(value)} % of `{place}`' for place, value in best.items())}. "
        f"`hd_bug_map` reaches {says('hd_bug_map', *best)} within the time limit. The networks do well on the map that looks "
        f"like what they learnt on (`ppo_mixed`: {says('ppo_mixed', 'map depot')}) and worse in the narrow one "
        f"({says('ppo_mixed', 'map tb3_sandbox')}). They also are bound to the robot and scanner of their training, and to the "
        "processor: their actions differ by rounding from one kind to the next, which grows to another episode "
        "([learned](learned.md)). On another one the same code had `ppo_rush` arrive in 97 of the 100 worlds of `rush` and "
        "`ppo_mixed` in 94; the rows of `hd_bug` were the same.",
    )  # fmt: skip
