"""The page of D2T and eACO: ways of planners on two maps, clustering, ants, a beach with pedestrians."""

from __future__ import annotations

from bug_gym.reproductions import d2t_tables
from bug_gym.reproductions.d2t_eaco import against_next_best, marked, said
from result_pages import Page, Record
from result_pages.words import RUN_HEADER, RUN_NOTE, number, percent, picture, run, share, table


def d2t_eaco(found: Record) -> Page:
    """All parts of the reproduction."""
    beside = said(found)
    tables = [table(beside.title, beside.header, beside.rows)]
    tables += [lengths(name, found["table_2"][name]) for name in ("S1", "S2")]
    tables += [clusters(found["clustering"]), ants(found["ants"]), sensitivity(found["ants"]["sensitivity"])]
    tables += [crossing(found["two_pedestrians"]), beach(found["beach"])]
    if "recorded" in found:
        rows = [[*scene_and_driver(key), *run(one)] for key, one in found["recorded"].items()]
        tables.append(table("Recorded pedestrians, who do not see the robot", ["scene", "policy", *RUN_HEADER], rows))
    tables.append(picture("d2t-eaco", "Excess over the exact way against the iterations"))
    return Page(tables, reading(found), list(found["claims"].items()))


def lengths(name: str, own: Record) -> str:
    """Table 2 of one map."""
    rows = []
    for planner, one in own.items():
        printed = d2t_tables.PRINTED[name].get(planner)
        low, high = one["interval"]
        told = [f"{printed[1]:.2f}", f"{printed[0]:.2f}"] if printed else ["-", "-"]
        length = f"{number(one['length'])} ({number(low)} - {number(high)})"
        least, most = one["ms_interval"]
        time = f"{number(one['ms'], 1)} ({number(least, 1)} - {number(most, 1)})"
        rows.append([planner, str(one["found"]), length, number(100.0 * one["over_shortest"]), time, *told])
    header = [
        "planner",
        "ways found",
        "length [m] (95 %)",
        "over the shortest [%]",
        "time, median [ms] (95 %)",
        "printed [m]",
        "printed [s]",
    ]
    return table(f"Table 2, {name}; all are given the map (privileged)", header, rows)


def clusters(own: Record) -> str:
    """What clustering saves over towns, and in one of them at each stage."""
    saved = own["saved"]
    rows = [
        [name, number(saved[name], 1), number(saved[f"{name} clustered"], 1),
         f"{100.0 * (1.0 - saved[f'{name} clustered'] / saved[name]):.0f}", printed]
        for name, printed in d2t_tables.PRINTED_CLUSTERS.items()
    ]  # fmt: skip
    one_town = [
        [name, *(str(own[name][key]) for key in ("obstacles", "nodes", "edges")),
         *(number(own[name][key], 1) for key in ("cluster_ms", "mesh_ms", "plan_ms"))]
        for name in ("without clusters", "with clusters")
    ]  # fmt: skip
    header = ["", "obstacles", "nodes", "edges", "cluster [ms]", "triangulate [ms]", "whole plan [ms]"]
    return "\n\n".join(
        [
            table("Clustering, means over towns", ["", "without", "with", "saved [%]", "printed"], rows),
            table("A town of 30 x 30 m", header, one_town),
        ]
    )


def ants(own: Record) -> str:
    """How much longer than the funnel's the ways of searches are."""
    rows = [
        [*key.rsplit(", ", 1), str(one["sleeves"]), percent(round(one["within_1"], 3)),
         *(number(value) for value in one["median_p90_max"])]
        for key, one in own.items()
        if isinstance(one, dict) and "within_1" in one
    ]  # fmt: skip
    header = ["search", "edges", "sleeves", "within 1 % [%]", "median [%]", "p90 [%]", "max [%]"]
    return table("Longer than the exact way", header, rows)


def sensitivity(own: Record) -> str:
    """Medians with a quarter less and more of each parameter."""
    rows = [[name, *map(number, [100.0 * one for one in pair])] for name, pair in own.items() if name != "as printed"]
    title = (
        f"Median gap [%] with each parameter a quarter less and more; as printed {number(100.0 * own['as printed'])}"
    )
    return table(title, ["parameter", "x 0.75", "x 1.25"], rows)


def crossing(own: Record) -> str:
    """Two pedestrians who cross the way."""
    first, second = own["deviations"]
    rows = [
        ["slows down at step, turns at step", f"{own['slowed']}, {own['turned']}", "slows first"],
        ["least gap between the bodies [m]", number(own["gap"]), "1.2"],
        ["least distance of the centres [m]", number(own["between_centres"]), "1.2"],
        ["off the way at the first, at the second [m]", f"{number(first)}, {number(second)}", "the second smaller"],
    ]
    return table("Two pedestrians on the beach", ["", "found", "printed"], rows)


def beach(own: Record) -> str:
    """The dynamic scene."""
    rows = [
        [*scene_and_driver(key), share(one), str(one["collisions"]), number(one["time"]), number(one["path_length"])]
        for key, one in own.items()
    ]
    header = ["beach", "policy", "reached [%] (95 %)", "collisions", "time [s]", "way [m]"]
    return table("The beach", header, rows)


MOST_OVER = 6.0
"""What the ants' way through a sleeve of up to 20 edges may be over the exact one [%]; a bar of ours, not the paper's."""


def missed(found: Record) -> str:
    """By how much the ants miss their bar, in a sentence; nothing where they don't."""
    worst = max(own["median_p90_max"][2] for key, own in found["ants"].items() if key in ("eaco, n <= 8", "eaco, 9-20"))
    if worst <= MOST_OVER:
        return ""
    return (
        f" Through one sleeve of up to 20 edges their way is {worst:.1f} % over the exact one, where {MOST_OVER:g} % were "
        "to be the most (a bar of ours): that claim is false."
    )


def standing(own: Record) -> str:
    """How often the navigator without a way comes to stand, in a sentence."""
    alone = {scene: one for key, one in own.items() for scene, driver in [key.split(", ", 1)] if driver == ALONE}
    counts = ", ".join(
        f"{one['outcomes'].get('timeout', 0)} of {one['n']} with {scene}" for scene, one in alone.items()
    )
    return f"On the beach the navigator alone, with no way to follow, comes to stand before something still: {counts}."


ALONE = "velocity_obstacle alone"


def scene_and_driver(key: str) -> list[str]:
    """The two names in a key of the numbers of what was driven."""
    scene, driver = key.split(", ", 1)
    return [scene, marked(driver)]


def reading(found: Record) -> str:
    """What the numbers say."""
    both = [found["table_2"][name] for name in ("S1", "S2")]
    shorter = " and ".join(f"{against_next_best(one)[0]:.1f} %" for one in both)
    edges = " and ".join(
        f"{100.0 * (1.0 - one['d2t_eaco']['length'] / one['d2t_dijkstra']['length']):.1f} %" for one in both
    )
    times = " and ".join(f"{one['d2t_eaco']['ms']:.0f} ms ({one['a_star']['ms']:.1f} ms)" for one in both)
    return (
        f"The ants' way is {shorter} shorter than the best over cells of 1 m (printed lengths: 6.6 % and 1.3 %), and "
        f"{edges} shorter than Dijkstra's along the edges of the same graph (below 0: longer). It takes {times} "
        "where A* over such cells "
        "takes what stands in brackets: that it is the fastest too, as printed, was not found. The funnel finds the "
        "exact way in the same triangles in less. The length has one minimum, so there is none for Levy flights to "
        f"escape from. Ants stop after {found['ants']['iterations']:.0f} iterations in the mean.{missed(found)} "
        f"{standing(found['beach'])}\n\n"
        "Planners are given the map. RRT*, the exact shortest way, cells of 0.1 m and the rows with a comma are not the "
        "paper's. The printed BFS is shorter than the printed A*: none whose bound never says too much is; with the "
        f"Manhattan distance, which does, it may be longer. {RUN_NOTE}"
        + ("" if "recorded" in found else " This run was without recorded pedestrians (`--data`).")
    )
