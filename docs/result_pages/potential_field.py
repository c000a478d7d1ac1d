"""The page of the potential field with wall following: scenes, routes, traps, what each part is worth, drift."""

from __future__ import annotations

from bug_gym.reproductions.apf_wall_following import CYCLES, METHODS, OURS, PARTS
from bug_gym.reproductions.oni_wang_table_1 import allowed_difference
from result_pages import Page, Record
from result_pages.words import code, listed, number, percent, picture, share, table

SCENES = ("scene 1", "scene 2", "scene 3")
"""Those of the paper's comparison."""


def apf_wall_following(found: Record) -> Page:
    """Lengths beside the opponents', and the sentences of the paper put to the test."""
    scenes, parts = found["scenes"], found["What parts are worth, traps"]
    return Page(
        [
            picture("apf-wall-following", "Distance, angle and drift"),
            table("Still scenes, length [m]", ["scene", *METHODS, "walls"], scene_rows(scenes)),
            table("Moving scenes", ["scene", "length [m]", "walls", "clearance [m]"], moving_rows(found["moving"])),
            table("The map of Oni and Wang, length [m]", ["turn, route", *next(iter(found["routes"].values()))], [
                [route, *(f"{one:.2f}" if isinstance(one, float) else one for one in kinds.values())]
                for route, kinds in found["routes"].items()
            ]),
            *(many(f"{title}", found[title]) for title in ("Traps", "Mazes")),
            many("What parts are worth, in traps", parts),
            table("Limits, a differential robot in traps", ["", *next(iter(found["limits"].values()))], [
                [f"`{name}`", *map(number, one.values())] for name, one in found["limits"].items()
            ]),
            *map(drift_table, found["drift"]),
        ],
        "\n\n".join(
            [
                f"These are the numbers of `--seeds {found['seeds']}`.",
                *(say(found) for say in (against_the_others, worth, against_drift, own_limits)),
            ]
        ),
        claims(found),
    )  # fmt: skip


def scene_rows(scenes: Record) -> list[list[str]]:
    """A row a scene."""
    return [
        [name, *(one[label]["ending"] for label in METHODS), str(one[OURS]["walls"])] for name, one in scenes.items()
    ]


def moving_rows(moving: Record) -> list[list[str]]:
    """A row a scene and robot."""
    return [[name, one["ending"], str(one["walls"]), number(one["clearance"])] for name, one in moving.items()]


def many(title: str, results: Record) -> str:
    """Success, wrong claims and length over many worlds."""
    rows = [
        [f"`{name}`", share(one), str(one["wrong"]), number(one["path_length"]), number(one["length_ratio"])]
        for name, one in results.items()
    ]
    worlds = next(iter(results.values()))["n"]
    header = ["", "reached [%] (95 %)", "touched or wrong", "length [m]", "to the first"]
    return table(f"{title}, {worlds} worlds", header, rows)


def drift_table(one: Record) -> str:
    """Success against one kind of drift."""
    rows = [[f"`{name}`", *(percent(point["success"]) for point in row)] for name, row in one["policies"].items()]
    return table(f"Success [%] against {one['label']}", ["", *(f"{value:g}" for value in one["values"])], rows)


def is_length(ending: str) -> bool:
    """Whether an ending tells a length, so that the robot arrived."""
    return ending.replace(".", "").isdigit()


def against_the_others(found: Record) -> str:
    """The paper's claim that it is shorter."""
    told = []
    for name in SCENES:
        one = found["scenes"][name]
        beaten = [
            label
            for label in METHODS
            if label != OURS
            and not (is_length(one[label]["ending"]) and float(one[label]["ending"]) <= float(one[OURS]["ending"]))
        ]
        told.append(f"in {name} {one[OURS]['ending']} m, better than {code(beaten) if beaten else 'nobody'}")
    return (
        "The paper reports shorter paths than the minimum risk method, TangentBug and Bug2, one scene each; its table of "
        f"lengths is lost. Here it goes {'; '.join(told)}. TangentBug sees 2 m ahead and chooses the shorter side, which a "
        "robot that follows the wall it met cannot."
    )


def worth(found: Record) -> str:
    """What conditions 1 and 3 are worth."""
    parts = found["What parts are worth, traps"]
    told = [f"`{name}` {percent(parts[name]['success'])} %" for name in PARTS]
    low, high = parts["whole"]["success_interval"]
    apart = [name for name in PARTS if (own := parts[name]["success_interval"])[0] > high or own[1] < low]
    return (
        f"In random traps arrive: {listed(told)}. Of these the intervals of {code(apart) if apart else 'none'} lie apart "
        "from that of the whole. The reset gains nothing: on the map all lengths are the same without it, and as it takes "
        "the angle to the target anew between -180 and 180 degrees it may lose a whole turn. The projection is what the "
        "three routes into the pocket of the map need, where the two rules that the paper calls too simple cycle too."
    )


def against_drift(found: Record) -> str:
    """The paper's reason for the method."""
    bias, beacon, computed = found["drift"]
    lines = []
    for one in (bias, beacon, computed):
        last = {name: percent(row[-1]["success"]) for name, row in one["policies"].items()}
        lines.append(f"{one['label']} {one['values'][-1]:g}: " + ", ".join(f"`{k}` {v} %" for k, v in last.items()))
    return (
        "At the greatest drift arrive, with a beacon twice and then with the goal by odometry: "
        + "; ".join(lines)
        + "."
    )


def own_limits(found: Record) -> str:
    """What it cannot do."""
    mazes = found["Mazes"][OURS]
    return (
        f"In mazes it reaches {percent(mazes['success'])} %: inside an outer wall that also holds the target a lap turns "
        "away from the wall by a full turn, the angle never comes back, and after two laps it says looping. Its conditions "
        "carry no distance, so that nothing shrinks from wall to wall."
    )


def claims(found: Record) -> list[tuple[str, bool]]:
    """What was looked at."""
    scenes, moving, routes = found["scenes"], found["moving"], found["routes"]
    own = [one for kinds in routes.values() for one in (kinds["straight"], kinds["field"])]
    close = [
        is_length(one["straight"])
        and abs(float(one["straight"]) - one["ideal"]) <= allowed_difference(one["ideal"]) + 0.01
        for one in routes.values()
    ]
    cycles = {tuple(name.split()) for name, one in routes.items() if one["straight, no projection"] == "looping"}
    wrong = [
        one["wrong"] for title in ("Traps", "Mazes", "What parts are worth, traps") for one in found[title].values()
    ]
    return [
        ("it arrives in every still scene", all(is_length(one[OURS]["ending"]) for one in scenes.values())),
        ("among boxes as in Fig. 12a it follows two walls", scenes["12a"][OURS]["walls"] == 2),
        (
            "it arrives in every moving scene, with either robot",
            all(is_length(one["ending"]) for one in moving.values()),
        ),
        ("24 of 24 routes of the map arrive, straight and in the field", all(map(is_length, own))),
        ("straight until contact their lengths are the ideal ones, within 1.5 % or three steps", all(close)),
        ("without the projection the three known routes cycle, and no other", cycles == CYCLES),
        ("nobody touches anything or calls an open goal unreachable", sum(wrong) == 0),
    ]
