"""D2T and eACO of Sellers et al. (2026): Table 2, clustering, ants against the exact way, a beach with pedestrians.

The paper's maps are not given; these are of their kinds (d2t_worlds). Every planner here is given the map. Some 45 x 30 m
with 22 large and with 55 small obstacles stand for its two scenarios, a town of 30 x 30 m for its clustering, a beach of
50 x 100 m with 28 obstacles for its dynamic scene. With a folder of recorded pedestrians (`--data`) these are crossed too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bug_gym.agents import AGENTS
from bug_gym.agents.planning.ants import Colony
from bug_gym.agents.planning.triangulated import clusters_of
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.summary import PRIVILEGED
from bug_gym.reproductions import d2t_crossing, d2t_tables, d2t_worlds
from bug_gym.reproductions.claims import as_percent, mean, numbers, of, run
from bug_gym.reproductions.hd_bug_real import SCENES, crossing
from bug_gym.reproductions.replayable import Replayable, replayable
from bug_gym.reproductions.result import Curves, Reproduction, Settings, Table

RUNS, TOWNS, SLEEVES, ANT_SEEDS, EPISODES = 50, 200, 60, 10, 50
SHOWN = (1, 2, 3, 5, 7, 10, 15, 20, 30, 40, 50)
"""Iterations of the curve."""
PEDESTRIANS = (0, 2, 10, 20)
DRIVERS: dict[str, dict[str, Any]] = {
    "d2t_eaco": {"name": "d2t_eaco"},
    "a_star, velocity obstacles": {"name": "a_star", "parameters": {"follower": "velocity_obstacle"}},
    "d_star_lite, velocity obstacles": {"name": "d_star_lite", "parameters": {"follower": "velocity_obstacle"}},
    "rrt_star, velocity obstacles": {"name": "rrt_star", "parameters": {"follower": "velocity_obstacle"}},
    "velocity_obstacle alone": {"name": "velocity_obstacle"},
}


def reproduce(settings: Settings) -> Reproduction:
    """Run all of it; `seeds` cuts every part to so many runs, towns, sleeves and episodes."""
    claims: list[tuple[str, bool]] = []
    tables, data, episodes = [], {}, []
    for part in (table_2, clustering, ants, two_pedestrians, beach):
        found, own, checked, shown = part(settings)
        tables += found
        episodes += shown
        data[part.__name__] = own
        claims += checked
    tables.append(said(data))
    curves = convergence_curves(settings)
    if settings.data is not None:
        found, data["recorded"], shown = recorded(settings)
        tables += found
        episodes += shown
    tables.append(
        Table(
            "Claims that are checked", ["claim", "holds"], [[text, "yes" if is_so else "NO"] for text, is_so in claims]
        )
    )
    data["claims"] = dict(claims)
    holds = all(is_so for _, is_so in claims)
    return Reproduction("d2t-eaco", tables, NOTES, data, holds, [curves], episodes=episodes)


def said(data: Mapping[str, Any]) -> Table:
    """What the paper says of itself beside what was found, out of what JSON keeps."""
    both = [data["table_2"][name] for name in ("S1", "S2")]
    shorter = ", ".join(
        f"{middle:+.1f} % ({low:+.1f} to {high:+.1f})" for middle, low, high in map(against_next_best, both)
    )
    edges = ", ".join(
        f"{100.0 * (1.0 - one['d2t_eaco']['length'] / one['d2t_dijkstra']['length']):+.1f} %" for one in both
    )
    times = ", ".join(f"{one['d2t_eaco']['ms']:.0f} ms against {one['a_star']['ms']:.1f} ms" for one in both)
    exact = ", ".join(f"{one['d2t_eaco, funnel']['ms']:.1f} ms" for one in both)
    gaps = {name: data["ants"].get(f"{name}, 9-20", {"median_p90_max": [0.0]})["median_p90_max"][0]
            for name in ("eaco", "aco (no Levy flights)")}  # fmt: skip
    turned = [
        100.0 * value for name, pair in data["ants"]["sensitivity"].items() if name != "as printed" for value in pair
    ]
    plain = 100.0 * data["ants"]["sensitivity"]["as printed"]
    sway = f"{plain:.2f} %; {min(turned):.2f} to {max(turned):.2f} % with a quarter more or less"
    rows = [
        ["shorter than the next best by 6.6 % and 1.3 % (printed lengths)", shorter],
        ["significantly shorter than a graph search's way", edges],
        ["fastest: 6.2 % and 10.2 % below A*", f"{times} (exactly, by the funnel: {exact})"],
        ["Levy flights help to escape local optima", " against ".join(f"{gaps[name]:.2f} % with {name}" for name in gaps)],
        ["robust to small changes of the parameters", sway],
        ["converges within a few dozen iterations", f"stops after {data['ants']['iterations']:.0f} in the mean"],
    ]  # fmt: skip
    return Table("What the paper says, and what was found", ["said", "found"], rows)


def against_next_best(own: Mapping[str, Any]) -> tuple[float, float, float]:
    """By how much the ants' way is shorter than the best over cells, and its 95 % interval [%]; ways over cells never vary."""
    low, high = own["d2t_eaco"]["interval"]
    best = min(own[one]["length"] for one in GRID)
    middle, least, most = (100.0 * (1.0 - length / best) for length in (own["d2t_eaco"]["length"], high, low))
    return middle, least, most


Part = tuple[list[Table], dict[str, Any], list[tuple[str, bool]], list[Replayable]]
"""Tables, numbers, claims and whether they hold, and what was driven."""


def table_2(settings: Settings) -> Part:
    """Times and lengths on both maps."""
    runs = settings.seeds or RUNS
    tables: list[Table] = []
    data: dict[str, Any] = {}
    claims: list[tuple[str, bool]] = []
    for name, task in (("S1", d2t_worlds.scenario_1()), ("S2", d2t_worlds.scenario_2())):
        measured = {planner: d2t_tables.measure(one, runs) for planner, one in d2t_tables.planners(task).items()}
        best = measured["shortest way (ours)"].lengths[0]
        lines: list[list[str]] = []
        own: dict[str, Any] = {}
        for planner, found in measured.items():
            lengths = [one for one in found.lengths if math.isfinite(one)]
            length, low, high = d2t_tables.interval(lengths)
            time, *between = (1e3 * value for value in d2t_tables.median_interval(found.times))
            printed = d2t_tables.PRINTED[name].get(planner)
            label = planner if len(lengths) == runs else f"{planner}, a way in {len(lengths)}"
            told = [f"{printed[1]:.2f}", f"{printed[0]:.2f}"] if printed else ["", ""]
            over = 100.0 * (length / best - 1.0)
            lines.append(
                [
                    label,
                    f"{length:.2f} [{low:.2f}, {high:.2f}]",
                    f"{over:.2f}",
                    "{:.1f} [{:.1f}, {:.1f}]".format(time, *between),
                    *told,
                ]
            )
            numbers_of = {"length": length, "interval": [low, high], "over_shortest": length / best - 1.0, "ms": time}
            own[planner] = {**numbers_of, "ms_interval": between, "found": len(lengths)}
        header = ["planner", "length [m]", "over shortest [%]", "time [ms]", "printed [m]", "printed [s]"]
        title = f"Table 2, {name}: {runs} runs; all are given the map{PRIVILEGED}"
        tables.append(Table(title, header, lines))
        data[name] = own
        claims += _claims_of_lengths(name, own)
    lines = [
        [name, "{:+.1f} [{:+.1f}, {:+.1f}]".format(*against_next_best(data[name])), printed, against_a_star]
        for name, printed, against_a_star in (("S1", "6.6", "9.2"), ("S2", "1.3", "4.1"))
    ]
    header = ["map", "d2t_eaco shorter than the next best [%]", "as the printed lengths say", "against A* there"]
    tables.append(Table("How much shorter", header, lines))
    return tables, data, claims, []


GRID = ("bfs", "d_star", "bidirectional_a_star", "a_star")


def _claims_of_lengths(name: str, own: dict[str, Any]) -> list[tuple[str, bool]]:
    """What must hold of the lengths on a map."""
    length = {planner: found["length"] for planner, found in own.items()}
    same = max(abs(length[one] - length["a_star"]) for one in ("d_star", "bidirectional_a_star"))
    return [
        (f"{name}: D*, bidirectional A* and A* are equally long", same < 1e-6),
        (f"{name}: A* is no longer than BFS", length["a_star"] <= length["bfs"] + 1e-6),
        (f"{name}: A* with a bound that says too much is no shorter", length["a_star, Manhattan"] >= length["a_star"] - 1e-6),
        (f"{name}: refined ants within 1 % of the funnel", length["d2t_eaco, refined"] <= 1.01 * length["d2t_eaco, funnel"]),
        (f"{name}: the funnel within 1 % of the shortest", length["d2t_eaco, funnel"] <= 1.01 * length["shortest way (ours)"]),
    ]  # fmt: skip


def clustering(settings: Settings) -> Part:
    """The ablation on a town, the beach's count, and what is saved over many towns."""
    town, beach_task = d2t_worlds.urban(), d2t_worlds.beach()
    lines: list[list[str]] = []
    data: dict[str, Any] = {}
    for label, use_clusters in (("without clusters", False), ("with clusters", True)):
        d2t_tables.graph_of(town, use_clusters=use_clusters)
        found = d2t_tables.graph_of(town, use_clusters=use_clusters)
        times = [f"{value:.2f}" for value in (found.cluster_ms, found.mesh_ms, found.plan_ms)]
        lines.append([label, *map(str, found[:3]), *times])
        data[label] = found._asdict()
    header = ["town of 30 x 30 m", "obstacles", "nodes", "edges", "cluster [ms]", "triangulate [ms]", "whole plan [ms]"]
    count = settings.seeds or TOWNS
    saved = d2t_tables.savings(count)
    data["saved"] = saved
    rows = [
        [name, f"{saved[name]:.1f}", f"{saved[f'{name} clustered']:.1f}",
         f"{100.0 * (1.0 - saved[f'{name} clustered'] / saved[name]):.0f}", printed]
        for name, printed in d2t_tables.PRINTED_CLUSTERS.items()
    ]  # fmt: skip
    clusters = len(clusters_of(beach_task, d2t_tables.MANNER))
    data["beach"] = [len(beach_task.obstacles), clusters]
    tables = [
        Table("Clustering: the ablation", header, lines),
        Table(f"Clustering: means of {count} towns", ["", "without", "with", "saved [%]", "printed"], rows),
        Table("Clustering: the beach", ["obstacles", "clusters"], [[str(len(beach_task.obstacles)), str(clusters)]]),
    ]
    halved = saved["obstacles clustered"] <= 0.5 * saved["obstacles"]
    return tables, data, [("the beach: 28 -> 9", clusters == 9), ("towns: at most half of the obstacles", halved)], []


def ants(settings: Settings) -> Part:
    """How near searches come to the funnel, by the number of edges; what each parameter does."""
    count, seeds = (4 * settings.seeds, min(settings.seeds, ANT_SEEDS)) if settings.seeds else (SLEEVES, ANT_SEEDS)
    chosen = d2t_tables.sleeves(count)
    sizes = np.array([len(sleeve.left) for sleeve in chosen])
    lines: list[list[str]] = []
    data: dict[str, Any] = {}
    bars = {}
    for name, search in d2t_tables.SEARCHES.items():
        gap = np.array(d2t_tables.gaps(chosen, search, seeds))
        bars[name] = gap
        for label, mine in (("n <= 8", sizes <= 8), ("9-20", (sizes > 8) & (sizes <= 20)), ("21-50", sizes > 20)):
            if mine.any():
                own = 100.0 * gap[mine]
                stats = [float(np.median(own)), float(np.quantile(own, 0.9)), float(own.max())]
                within = float((own <= 1.0).mean())
                lines.append(
                    [name, label, str(int(mine.sum())), f"{100.0 * within:.0f}", *(f"{one:.2f}" for one in stats)]
                )
                data[f"{name}, {label}"] = {"sleeves": int(mine.sum()), "within_1": within, "median_p90_max": stats}
    header = ["search", "edges", "sleeves", "<= 1 % [%]", "median [%]", "p90 [%]", "max [%]"]
    few, middle = bars["eaco"][sizes <= 8], bars["eaco"][sizes <= 20]
    fair = np.median(middle) <= 0.015 and np.quantile(middle, 0.9) <= 0.035 and middle.max() <= 0.06
    claims = [
        ("ants, n <= 8: always within 1 %", bool((few <= 0.01).all())),
        ("ants, n <= 20: median 1.5 %, nine of ten 3.5 %, all 6 %", bool(fair)),
        ("refined ants, n <= 50: 99 of 100 within 1 %", bool((bars["eaco_refined"] <= 0.01).mean() >= 0.99)),
        ("nothing is shorter than the funnel", bool(min(gap.min() for gap in bars.values()) >= -1e-9)),
    ]
    some = [sleeve for sleeve, size in zip(chosen, sizes, strict=True) if size <= 20][: max(count // 4, 4)]
    plain = d2t_tables.median_gap(some, Colony(), max(seeds // 3, 1))
    turned = d2t_tables.sensitivity(some, max(seeds // 3, 1))
    data["iterations"] = d2t_tables.iterations(some)
    data["sensitivity"] = {"as printed": plain, **{name: list(pair) for name, pair in turned.items()}}
    rows = [["as printed", f"{100 * plain:.2f}", f"{100 * plain:.2f}"]]
    rows += [[name, f"{100 * low:.2f}", f"{100 * high:.2f}"] for name, (low, high) in turned.items()]
    tables = [
        Table(f"Ants: longer than the funnel's exact way, means of {seeds} seeds a sleeve", header, lines),
        Table(
            f"Sensitivity: median gap [%], {len(some)} sleeves of up to 20 edges",
            ["parameter", "x 0.75", "x 1.25"],
            rows,
        ),
    ]
    return tables, data, claims, []


def convergence_curves(settings: Settings) -> Curves:
    """How the ants come nearer to the exact way, with Levy flights and without."""
    few = settings.seeds is not None and settings.seeds < 10
    chosen = [one for one in d2t_tables.sleeves(12 if few else 60) if 8 < len(one.left) <= 20]
    colonies = {"eaco": Colony(patience=50), "aco (no Levy flights)": Colony(patience=50, levy_rate=0.0)}
    found = d2t_tables.convergence(chosen, colonies, 2 if few else ANT_SEEDS)
    lines = {name: [(curve[n - 1],) * 3 for n in SHOWN] for name, curve in found.items()}
    label = "excess over the exact way, share of the first"
    return Curves("Convergence, 9 to 20 edges", "iteration", label, SHOWN, lines)


def pedestrians(count: int) -> list[dict[str, Any]]:
    """So many walkers about the middle of the beach, each in a direction that is drawn."""
    generator = np.random.default_rng(count)
    places = [(float(x), float(y)) for x, y in generator.uniform((17.0, 15.0), (33.0, 85.0), (4 * count, 2))]
    clear = [at for at in places if d2t_worlds.is_clear(at, 0.5)][:count]
    speeds = generator.uniform(0.5, 1.0, count).tolist()
    return [
        {"shape": {"circle": 0.3}, "at": list(at), "motion": {"law": "bounce", "speed": speed}}
        for at, speed in zip(clear, speeds, strict=True)
    ]


def two_pedestrians(settings: Settings) -> Part:
    """The paper's dynamic scene, once: nothing in it is drawn."""
    found = d2t_crossing.cross()
    first, second = found.deviations
    rows = [
        ["slows down, then turns", f"step {found.slowed}, step {found.turned}", "slows first"],
        ["least gap between the bodies [m]", f"{found.gap:.2f}", "1.2"],
        ["least distance of the centres [m]", f"{found.between_centres:.2f}", "1.2"],
        ["off the way at the first, at the second [m]", f"{first:.2f}, {second:.2f}", "the second smaller"],
    ]
    claims = [
        ("two pedestrians: arrives", found.outcome == "success"),
        ("two pedestrians: slows down before it turns", found.slowed < found.turned),
        ("two pedestrians: 1.2 m are kept", abs(found.gap - d2t_crossing.GAP) < 0.1),
        ("two pedestrians: the second deviation is the smaller one", second < first),
    ]
    scene = (found.outcome == "success", found.outcome, "", d2t_crossing.DRIVER, d2t_worlds.BEACH)
    episodes = [Replayable("d2t_eaco", "two pedestrians", 0, *scene)]
    return [Table("Two pedestrians on the beach", ["", "found", "printed"], rows)], found._asdict(), claims, episodes


def marked(label: str) -> str:
    """The label of a driver, with the mark of those that are given the map, as an evaluation has it."""
    return label + PRIVILEGED if AGENTS[DRIVERS[label]["name"]].privileged else label


def driven_by(rows: Sequence[EpisodeRow], label: str, scene: str) -> list[EpisodeRow]:
    """The episodes of a driver in a scene."""
    return of(rows, scenario=scene, policy=marked(label))


def beach(settings: Settings) -> Part:
    """Across the beach among 0, 2, 10 and 20 pedestrians, who look at nobody."""
    seeds = settings.seeds or EPISODES
    robot = {"kinematics": "holonomic", "radius": d2t_worlds.RADIUS, "max_speed": 1.0}
    scenarios = [
        {
            "scenario": {
                "robot": robot,
                "lidar": {"beams": 180, "range": 10.0},
                "time": {"limit": 250.0},
                "world": d2t_worlds.as_world(d2t_worlds.beach(), pedestrians(count)),
            },
            "label": f"{count} pedestrians",
        }
        for count in PEDESTRIANS
    ]
    drivers = {
        label: one for label, one in DRIVERS.items() if not settings.policies or one["name"] in settings.policies
    }
    entries = [{**one, "label": label} for label, one in drivers.items()]
    rows = run(entries, scenarios, seeds, settings, name="d2t-beach")
    lines, data = [], {}
    for scene in scenarios:
        for label in drivers:
            mine = driven_by(rows, label, str(scene["label"]))
            reached = [row for row in mine if row.success]
            hits = len(of(mine, outcome="collision"))
            numbers_of = [mean([row.time for row in reached]), mean([row.path_length for row in reached]),
                          mean([row.min_clearance for row in reached])]  # fmt: skip
            lines.append(
                [str(scene["label"]), marked(label), as_percent(mine), str(hits), *(f"{one:.2f}" for one in numbers_of)]
            )
            data[f"{scene['label']}, {label}"] = {**numbers(mine), "collisions": hits}
    header = ["beach", "policy", "reached [%]", "collisions", "time [s]", "way [m]", "least gap [m]"]
    still = [row for row in rows if row.scenario == "0 pedestrians" and row.policy != "velocity_obstacle alone"]
    claims = [("the beach without pedestrians: every planner arrives", all(row.success for row in still))]
    episodes = replayable(rows, entries, scenarios)
    return [Table(f"The beach, {seeds} runs a line", header, lines)], data, claims, episodes


def recorded(settings: Settings) -> tuple[list[Table], dict[str, Any], list[Replayable]]:
    """Recorded pedestrians, who do not see the robot."""
    assert settings.data is not None
    seeds = settings.seeds or EPISODES
    drivers = [{**DRIVERS[one], "label": one} for one in ("d2t_eaco", "velocity_obstacle alone")]
    scenarios = [{"scenario": crossing(settings.data / scene), "label": scene} for scene in SCENES]
    rows = run(drivers, scenarios, seeds, settings, name="d2t-recorded")
    lines, data = [], {}
    for scene in SCENES:
        for driver in drivers:
            mine = driven_by(rows, str(driver["label"]), scene)
            lines.append(
                [scene, marked(str(driver["label"])), as_percent(mine), str(len(of(mine, outcome="collision")))]
            )
            data[f"{scene}, {driver['label']}"] = numbers(mine)
    tables = [Table("Recorded pedestrians", ["scene", "policy", "reached [%]", "collisions"], lines)]
    return tables, data, replayable(rows, drivers, scenarios)


NOTES = [
    "All planners here are given the map (privileged), those of Table 2 too. RRT*, the exact shortest way, cells of 0.1 m "
    "and the rows after a comma are added; the paper has the other five.",
    "The printed BFS is shorter than the printed A*: no A* whose bound never says too much is. With one that does (the "
    "Manhattan distance) it may be longer, see its row.",
    "Ways of BFS, D*, bidirectional A* and A* run over cells of 1 m, as the printed lengths do.",
    "The length is convex in the crossings: there is no other minimum that Levy flights could escape from.",
]
