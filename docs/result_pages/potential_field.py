"""The page of the potential field with wall following: scenes, routes, traps, what each part is worth, drift."""

from __future__ import annotations

from collections.abc import Sequence

from bug_gym.reproductions.apf_wall_following import ALPHAS, CYCLES, METHODS, OURS, PARTS, falls, has_phases, leans
from bug_gym.reproductions.oni_wang_table_1 import allowed_difference
from result_pages import Page, Record
from result_pages.words import code, listed, number, percent, picture, share, table

SCENES = ("scene 1", "scene 2", "scene 3")
"""Those of the paper's comparison."""
LIMITS = {
    "radius": "median turning radius [m]",
    "reversals": "reversals a 100 m",
    "switches": "switches a 100 m",
    "standing": "share of steps on the spot",
}
"""What the paper names as its own limits: wide turns, uneven lines, abrupt switching."""
AT_A_WALL = {
    "distance": "Distance from a straight wall [m]",
    "expected": "Direction that it expects, towards that wall [degrees]",
    "driven": "Direction that it goes, towards that wall [degrees]",
}
"""What Fig. 6 tells over time."""
PHASE = {
    "begins": "from [s]",
    "ends": "to [s]",
    "entered": "to the target then [m]",
    "left": "and then [m]",
    "from_wall": "still wall at [m]",
}
"""What is told of a wall that was followed."""
FELT = 2.2
"""How far the field feels anything [m]: where no still wall is so near, what is followed moves."""
BRIEF = 1.0
"""Time below which a wall is hardly followed [s]."""
GOALS = ("a beacon", "a beacon", "by odometry")
"""What the target is in each sweep of the drift."""


def apf_wall_following(found: Record) -> Page:
    """Lengths beside the opponents', and the sentences of the paper put to the test."""
    scenes, parts = found["scenes"], found["What parts are worth, traps"]
    return Page(
        [
            picture("apf-wall-following", "Distance, angle and drift"),
            table("Still scenes, length [m]", ["scene", *METHODS, "walls"], scene_rows(scenes)),
            table("Moving scenes", ["scene", "length [m]", "walls", "clearance [m]"], moving_rows(found["moving"])),
            phase_table(found["phases"]),
            *(wall_table(found["Fig. 6"], kind) for kind in AT_A_WALL),
            route_table("The map of Oni and Wang, length [m]", "turn, route", found["routes"]),
            route_table("The U and the hook, length [m]", "trap, turn", found["closed forms"]),
            *(many(f"{title}", found[title]) for title in ("Traps", "Mazes")),
            many("What parts are worth, in traps", parts),
            table("Limits, a differential robot in traps", ["", *LIMITS.values()], [
                [f"`{name}`", *(number(one[key]) for key in LIMITS)] for name, one in found["limits"].items()
            ]),
            *(drift_table(one, goal) for one, goal in zip(found["drift"], GOALS, strict=True)),
        ],
        "\n\n".join(
            [
                f"These are the numbers of `--seeds {found['seeds']}`.",
                against_the_others(found),
                at_walls(found["phases"]),
                by_the_field(found),
                *(say(found) for say in (by_alpha, worth, against_drift, own_limits)),
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


def phase_table(phases: Record) -> str:
    """A row a wall that was followed."""
    rows = [[name, *(number(one[key]) for key in PHASE)] for name, told in phases.items() for one in told["phases"]]
    return table("Walls followed in the scenes of Figs. 9 and 12", ["scene, robot", *PHASE.values()], rows)


def route_table(title: str, of: str, routes: Record) -> str:
    """A row a route, beside its ideal length."""
    rows = [
        [route, *(f"{one:.2f}" if isinstance(one, float) else one for one in kinds.values())]
        for route, kinds in routes.items()
    ]
    return table(title, [of, *next(iter(routes.values()))], rows)


def wall_table(one: Record, kind: str) -> str:
    """What Fig. 6 tells of each alpha, over the time since the wall was met."""
    rows = [[f"`{label}`", *(f"{value:z.2f}" for value in told[kind])] for label, told in one["alphas"].items()]
    return table(f"{AT_A_WALL[kind]}, Fig. 6", ["", *(f"{time:g} s" for time in one["times"])], rows)


def many(title: str, results: Record) -> str:
    """Success, wrong claims and length over many worlds."""
    rows = [
        [f"`{name}`", share(one), str(one["wrong"]), number(one["path_length"]), number(one["length_ratio"])]
        for name, one in results.items()
    ]
    worlds = next(iter(results.values()))["n"]
    header = ["", "reached [%] (95 %)", "touched or wrong", "length [m]", "to the first"]
    return table(f"{title}, {worlds} worlds", header, rows)


def drift_table(one: Record, goal: str) -> str:
    """Success against one kind of drift, with the target seen or reckoned."""
    rows = [[f"`{name}`", *(percent(point["success"]) for point in row)] for name, row in one["policies"].items()]
    title = f"Success [%] against {one['label']}, the target {goal}"
    return table(title, ["", *(f"{value:g}" for value in one["values"])], rows)


def is_length(ending: str) -> bool:
    """Whether an ending tells a length, so that the robot arrived."""
    return ending.replace(".", "").isdigit()


def is_as_long(one: Record, kind: str) -> bool:
    """Whether one kind of way is as long as the ideal one, within 1.5 % or three steps."""
    return is_length(one[kind]) and abs(float(one[kind]) - one["ideal"]) <= allowed_difference(one["ideal"]) + 0.01


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


def at_walls(phases: Record) -> str:
    """Fig. 12: how often a wall is followed, and which; Fig. 9: V and the distance."""
    often = {name: how_often(one["phases"]) for name, one in phases.items()}
    walls = [wall for one in phases.values() for wall in one["phases"]]
    nearer = sum(wall["left"] < wall["entered"] for wall in walls)
    apart = " The latter is not twice." if len(phases["12a, differential"]["phases"]) != 2 else ""
    free, rises = (sum(one[key] for one in phases.values()) for key in ("free", "rises"))
    return (
        "The paper's real robot, a Kobuki at 0.3 m/s, follows a wall twice in Fig. 12a, and once in 12b, where it avoids what "
        f"moves in the field. At that speed a holonomic robot follows one {often['12a, holonomic']} here in 12a, and a "
        f"differential one, as a Kobuki is, {often['12a, differential']}.{apart} In 12b they do {often['12b, holonomic']}, "
        f"and {often['12b, differential']}.\n\n"
        f"V, the attractive potential, falls in {free - rises} of {free} steps in the field in which nothing repels. Along a "
        f"wall it need not: {nearer} of {len(walls)} walls are left nearer to the target than they were met."
    )


def how_often(walls: Sequence[Record]) -> str:
    """How often walls were followed, and of these those that were hardly walls."""
    count = len(walls)
    brief = sum(one["ends"] - one["begins"] < BRIEF for one in walls)
    moving = sum(one["from_wall"] > FELT for one in walls)
    told = {1: "once", 2: "twice"}.get(count, f"{count} times")
    told += f", {brief} of them for less than {BRIEF:g} s" if brief else ""
    return told + (f", {moving} of them round what moves" if moving else "")


def by_the_field(found: Record) -> str:
    """Where the field itself goes as far as straight motion until contact does."""
    routes = found["routes"].values()
    near = sum(is_as_long(one, "field") for one in routes)
    return (
        "The ideal lengths are of straight motion until contact. In the U and the hook the field itself keeps to them as well: "
        "it meets the same wall on the same side and leaves it in the same place. On the map, walked at 1 m, it does in "
        f"{near} of {len(routes)} routes: it is caught nearer to a wall than that and has to go back, and where a wall is "
        "askew it slides along it, which may lead round another side."
    )


def by_alpha(found: Record) -> str:
    """Fig. 6: what alpha does, without the feedback of the distance and with it."""
    one = found["Fig. 6"]
    plain, leaning, whole = (one["alphas"][label] for label in ALPHAS)
    soon, late = one["times"].index(5.0), one["times"].index(20.0)
    return (
        "Of its Fig. 6 the paper says that the expected direction leans more to the wall at an alpha of 92 degrees than at 90, "
        f"which leads close to it. So it does along a straight wall that is met at {number(plain['distance'][0])} m: with 90 "
        f"degrees and no feedback the robot stays at {number(plain['distance'][-1])} m, with 92 it is at "
        f"{number(leaning['distance'][late])} m after 20 s and at {number(leaning['distance'][-1])} m in the end. There "
        "our rule holds it, by which no step ends nearer than a little inside the clearance: it expects "
        f"{number(leaning['expected'][-1])} degrees towards the wall and goes along it. Neither alpha has a distance to come "
        "back to. The feedback, ours as what the paper says of adjusting alpha is cut off, brings it to "
        f"{number(whole['distance'][soon])} m after 5 s and to {number(whole['distance'][-1])} m for good, where what it "
        "expects is to go along the wall."
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
    lines = []
    for one, goal in zip(found["drift"], GOALS, strict=True):
        last = {name: percent(row[-1]["success"]) for name, row in one["policies"].items()}
        told = ", ".join(f"`{k}` {v} %" for k, v in last.items())
        lines.append(f"{one['label']} {one['values'][-1]:g}, the target {goal}: {told}")
    return f"At the greatest drift arrive: {'; '.join(lines)}."


def own_limits(found: Record) -> str:
    """What it cannot do, and what the paper names as its own limits."""
    mazes = found["Mazes"][OURS]
    own, other = found["limits"][OURS], found["limits"]["bug2"]
    return (
        f"In mazes it reaches {percent(mazes['success'])} %: inside an outer wall that also holds the target a lap turns "
        "away from the wall by a full turn, the angle never comes back, and after two laps it says looping. Its conditions "
        "carry no distance, so that nothing shrinks from wall to wall.\n\n"
        "As its own limits the paper names abrupt switching, parameters that stay, and from them turns that are too wide and "
        "uneven lines. A differential robot in traps turns "
        f"with a median radius of {number(own['radius'])} m ({code(['bug2'])} {number(other['radius'])} m), changes the sense "
        f"of its turning {number(own['reversals'], 0)} times in 100 m ({number(other['reversals'], 0)}) and its behaviour "
        f"{number(own['switches'], 0)} times ({number(other['switches'], 0)}), and turns on the spot in "
        f"{number(100.0 * own['standing'], 0)} % of its steps ({number(100.0 * other['standing'], 0)})."
    )


def claims(found: Record) -> list[tuple[str, bool]]:
    """What was looked at."""
    scenes, moving, routes = found["scenes"], found["moving"], found["routes"]
    own = [one for kinds in routes.values() for one in (kinds["straight"], kinds["field"])]
    close = [is_as_long(one, "straight") for one in routes.values()]
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
        (
            "without feedback an alpha of 92 degrees leans more to a straight wall than one of 90, and leads nearer to it",
            leans(found["Fig. 6"]["alphas"]),
        ),
        ("24 of 24 routes of the map arrive, straight and in the field", all(map(is_length, own))),
        ("straight until contact their lengths are the ideal ones, within 1.5 % or three steps", all(close)),
        ("without the projection the three known routes cycle, and no other", cycles == CYCLES),
        ("nobody touches anything or calls an open goal unreachable", sum(wrong) == 0),
        *claims_of_walls_and_v(found),
    ]


def claims_of_walls_and_v(found: Record) -> list[tuple[str, bool]]:
    """Walls followed in the scenes of Fig. 12, the fall of V, and the lengths in the U and the hook."""
    phases, traps = found["phases"], found["closed forms"].values()
    return [
        (
            "at 0.3 m/s it follows walls as often as in Fig. 12: two in 12a, a holonomic robot, and one in 12b, either robot",
            has_phases(phases),
        ),
        ("V falls at every step in the field in which nothing repels", falls(phases)),
        (
            "in the U and the hook the lengths are the ideal ones too, so near, straight and in the field",
            all(is_as_long(one, kind) for one in traps for kind in ("straight", "field")),
        ),
    ]
