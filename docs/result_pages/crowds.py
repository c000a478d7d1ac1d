"""What the page of ORCA says: robots across a circle, and crowds that cross."""

from __future__ import annotations

from bug_gym.reproductions import circle_swap as made
from result_pages import Page, Record
from result_pages.words import between, listed, number, p_value, percent, points, table

HEADER = ("runs", "reached [%]", "all arrive [%] (95 %)", "contacts", "least gap [m]", "time [s]", "path / shortest")


def cells(one: Record) -> list[str]:
    """The cells of HEADER of the runs of one policy's robots."""
    return [
        str(one["n"]),
        percent(one["success"]),
        f"{percent(one['all_arrive'])} ({between(*one['all_arrive_interval'])})",
        str(one["contacts"]),
        number(one["least_gap"], 3),
        number(one["time"], 1),
        number(one["path_ratio"], 3),
    ]


def circle_swap(found: Record) -> Page:
    """Robots that change places, and beside it each robot alone."""
    circles, crowds = found["circles"], found["crowds"]
    rows = [
        [kinematics, str(robots), *cells(one), number(one["longest"], 1), number(1e6 * one["decision_time_mean"], 0)]
        for kinematics in made.KINEMATICS
        for robots in made.ROBOTS
        if (one := circles[f"{kinematics}, {robots}"])
    ]
    compared = [
        [
            label,
            f"`{policy}`",
            *cells(one),
            *(["", ""] if one is ours else [f"{points(one, ours):+.1f}", p_value(one, ours)]),
        ]
        for label in made.CROWDS
        if (ours := crowds[f"{label}, orca"])
        for policy in ("orca", *made.ALONE)
        if (one := crowds[f"{label}, {policy}"])
    ]
    runs = sum(one["n"] for one in circles.values())
    touched = sum(one["contacts"] for one in [*circles.values(), *(crowds[f"{label}, orca"] for label in made.CROWDS)])
    slowest = {kinematics: circles[f"{kinematics}, {made.ROBOTS[-1]}"] for kinematics in made.KINEMATICS}
    told = " and ".join(
        f"{number(one['path_ratio'], 2)} times the straight way ({kinematics})" for kinematics, one in slowest.items()
    )
    few, many = made.ROBOTS[1], made.ROBOTS[-1]
    grows = " and ".join(
        number(
            many
            * circles[f"{one}, {many}"]["decision_time_mean"]
            / (few * circles[f"{one}, {few}"]["decision_time_mean"]),
            1,
        )
        for one in made.KINEMATICS
    )
    return Page(
        [
            table(
                "Changing places across a circle with `orca`",
                ["kinematics", "robots", *HEADER, "longest [s]", "decision of a robot [us]"],
                rows,
            ),
            table(
                "Crowds that cross: robots that know of one another, and each alone",
                ["worlds", "policy", *HEADER, "points against `orca`", "p (McNemar, exact; worlds where all arrive)"],
                compared,
            ),
        ],
        "A contact counts for both robots; the gap is the smallest of a body to anything, walls too. Time and ratio are "
        "means over the runs that arrive. Intervals count worlds, since robots that share one are not independent.\n\n"
        f"In {runs:,} runs across the circle, and in the crowds, `orca` touched anything {touched} times. With "
        f"{made.ROBOTS[-1]} robots the way is {told}.\n\n"
        f"To decide for all {many} robots takes {grows} times as long as for {few} ({listed(made.KINEMATICS)}); in proportion "
        f"to the robots it would be {many / few:.1f}, which is about what the authors of RVO2 report of theirs. A robot here "
        "reads its scan, too.",
        [
            (
                "no two robots that run `orca` touch on the circle",
                all(one["contacts"] == 0 for one in circles.values()),
            ),
            ("all of them arrive", all(one["success"] == 1.0 for one in circles.values())),
        ],
    )
