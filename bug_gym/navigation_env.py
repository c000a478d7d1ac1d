"""One world with one robot as a `gymnasium.Env`; also what the other faces share: a robot's spaces, and pictures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import gymnasium as gym
import numpy as np
from numpy.typing import ArrayLike, NDArray

from bug_gym.config import Scenario, load
from bug_gym.kinematics import discrete_actions
from bug_gym.observation import Sensors, as_dict, dict_space, flat_space
from bug_gym.simulation import Simulation

if TYPE_CHECKING:
    from bug_gym.drawing.canvas import Canvas, Window
    from bug_gym.drawing.clips import Frame

F32 = NDArray[np.float32]
ObservationForm = Literal["dict", "flat"]
ActionForm = Literal["continuous", "discrete"]
Observation = Any  # F32, or F32 by field, as the env was made; a union would make every caller tell them apart
ScenarioSource = str | Path | Mapping[str, Any] | Scenario


class ActionBox(gym.spaces.Box):
    """A Box (2,) from -1 to 1 whose samples are those of any Box, value for value, in a fraction of the time.

    Gymnasium's own way sorts the bounds into four kinds at each sample, which takes longer than a step of the env.
    """

    def __init__(self, seed: int | np.random.Generator | None = None) -> None:
        super().__init__(-1.0, 1.0, (2,), dtype=np.float32, seed=seed)

    def sample(self, mask: None = None, probability: None = None) -> F32:
        """A uniform sample.

        Raises:
            gymnasium.error.Error: a mask or a probability, which no Box has.
        """
        if mask is not None or probability is not None:
            super().sample(mask, probability)
        return self.np_random.uniform(-1.0, 1.0, 2).astype(np.float32)


class RobotSpaces:
    """The spaces of one robot, and the way from them to the core's arrays and back.

    Args:
        simulation: the worlds that the robot lives in.
        observation_form: "dict" or "flat".
        action_form: "continuous" or "discrete".

    Raises:
        ValueError: another form than these.
    """

    def __init__(self, simulation: Simulation, observation_form: str, action_form: str) -> None:
        require_one_of("observation", observation_form, ("dict", "flat"))
        require_one_of("action", action_form, ("continuous", "discrete"))
        self.fields = simulation.fields
        self.is_flat = observation_form == "flat"
        self.is_discrete = action_form == "discrete"
        self.observation: gym.spaces.Space[Any]
        self.observation = flat_space(self.fields) if self.is_flat else dict_space(self.fields)
        self.action: gym.spaces.Space[Any] = ActionBox()
        self._table = discrete_actions(Sensors.of(simulation.scenario).drive).astype(np.float64)
        if self.is_discrete:
            self.action = gym.spaces.Discrete(len(self._table))
        # Most fields are vectors as they are cut; to shape each anew takes an eighth of the env's own step.
        self._parts = [
            (field.name, slice(field.begin, field.end), field.shape if len(field.shape) > 1 else None)
            for field in self.fields
        ]

    def present(self, flat: F32) -> Observation:
        """A flat observation (D,) of the core in the form of the observation space; the fields are views of it."""
        if self.is_flat:
            return flat
        return {name: flat[part] if shape is None else flat[part].reshape(shape) for name, part, shape in self._parts}

    def present_batch(self, flat: F32) -> Observation:
        """Flat observations (n, D) of the core in the form of the observation space; each field is a copy."""
        return flat if self.is_flat else as_dict(flat, self.fields)

    def velocities(self, actions: ArrayLike, batch: tuple[int, ...] = ()) -> NDArray[np.float64]:
        """Actions of a batch (*batch, ...) as the core takes them (*batch, 2).

        Raises:
            ValueError: no numbers, another shape, or discrete actions that are no numbers of actions.
        """
        if not self.is_discrete:
            try:
                array = np.asarray(actions, dtype=np.float64)
            except (TypeError, ValueError):
                raise ValueError(f"an action is numbers of shape {(*batch, 2)}, got {actions!r}") from None
            if array.shape != (*batch, 2):
                raise ValueError(f"an action has shape {array.shape}, expected {(*batch, 2)}")
            return array
        numbers = np.asarray(actions)
        if numbers.shape != batch or numbers.dtype.kind not in "iu":
            raise ValueError(f"an action has shape {numbers.shape} of {numbers.dtype}, expected {batch} of integers")
        if numbers.size and not 0 <= numbers.min() <= numbers.max() < len(self._table):
            raise ValueError(f"an action is an integer from 0 to {len(self._table) - 1}, got {actions!r}")
        chosen: NDArray[np.float64] = self._table[numbers]
        return chosen


class Pictures:
    """What a face shows of its worlds in a render mode: one canvas a world, and for "human" a window on the first.

    Raises:
        ImportError: a render mode, but pygame-ce is not installed.
    """

    def __init__(self, simulation: Simulation, render_mode: str | None) -> None:
        self.render_mode = render_mode
        self._fps = 1.0 / simulation.scenario.time.step
        self._canvases: list[Canvas] = []
        self._window: Window | None = None
        if render_mode is not None:
            from bug_gym.drawing.canvas import Canvas

            self._canvases = [Canvas(simulation, row=row) for row in range(simulation.count)]

    def record(self) -> None:
        """Take down where the robots are now, after each step and reset; show it in the window."""
        for canvas in self._canvases:
            canvas.record()
        if self.render_mode != "human":
            return
        if self._window is None:
            from bug_gym.drawing.canvas import Window

            self._window = Window(self._canvases[0], self._fps)
        self._window.update()

    def frames(self) -> tuple[Frame, ...]:
        """A picture (H, W, 3) of each world, RGB uint8; none in a mode that returns none."""
        if self.render_mode is None:
            gym.logger.warn("render() shows nothing: make the env with render_mode='rgb_array' or 'human'")
        return tuple(canvas.draw() for canvas in self._canvases) if self.render_mode == "rgb_array" else ()

    def close(self) -> None:
        """Close the window."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def __getstate__(self) -> dict[str, Any]:
        """The window stays with the original."""
        return {**self.__dict__, "_window": None}


class NavigationEnv(gym.Env[Any, Any]):
    """One robot among unknown obstacles, on its way to a goal.

    ## Description
    A robot drives through a bounded plane world among circles and polygons, some of which may move. It senses ranges
    with a LIDAR and knows where its goal is; it has no map. The scan is the exact distance along each ray, and contact
    is tested along the whole way of each step, so that nothing fast or thin is missed.

    ## Action Space
    `Box(-1, 1, (2,), float32)`, cut to these bounds:

    | Num | `differential` | `holonomic` |
    |---|---|---|
    | 0 | speed, scaled to [-max_reverse, max_speed] [m/s] | velocity ahead, over max_speed |
    | 1 | turn rate, scaled to +-max_turn_rate [rad/s] | velocity to the left, over max_speed |

    A holonomic robot doesn't turn; its velocity is scaled back to max_speed where it would be faster. With
    `action="discrete"`: `Discrete(128)`, action i steers for one step toward heading i // 4 of 32 at (i % 4 + 1) / 4 of
    max_speed.

    ## Observation Space
    A `Dict` of float32 boxes, or with `observation="flat"` one box with the same fields in this order:

    | Field | Shape | Low | High | Meaning |
    |---|---|---|---|---|
    | ranges | (B,) | min_range | range | distance along each beam [m], counter-clockwise from the heading |
    | goal | (2,) | -span | span | the goal in the robot's frame [m] |
    | pose | (3,) | -2 span, -pi | 2 span, pi | odometry: x, y [m], heading [rad] in the frame of the start |
    | velocity | (2,) | -max_reverse, -max_turn_rate | max_speed, max_turn_rate | body velocity [m/s, rad/s] |
    | terrain | (32, 16) | 1 | largest factor | cost of the ground, only in scenarios with `regions` |

    B is the number of beams; span is the diagonal of the bounds. A beam without return reads `range`; over a narrower
    field of view the beams go from -fov/2 to fov/2. The velocity of a holonomic robot is ahead and to the left [m/s],
    within +-max_speed. `terrain` has a row for each of 32 bearings, counter-clockwise from the heading, with the cost factor
    every 0.25 m up to 4 m: ground of factor 2.5 divides the speed of a robot whose centre is on it by 2.5.

    ## Rewards
    The sum of weighted terms: `progress` [m toward the goal], `goal` and `collision` (once), `step` (each step),
    `clearance` (nearness to obstacles) and `smoothness` (change of the action). The weights are the scenario's.

    ## Starting State
    What the scenario says, drawn from (seed, episode): `reset(seed=s)` starts episode 0 of seed s, `reset()` the next.

    ## Episode End
    - Termination: the goal is reached, or the body touches something.
    - Truncation: the scenario's time limit is over.

    ## Information
    The same keys after each step and reset: `is_success`, `collision`, `outcome` ("running", "success", "collision",
    "timeout"), `path_length` [m], `time` [s], `min_clearance` [m], `goal_distance` [m], `reward_terms` (name -> value).
    `reset(options={"shortest_path": True})` adds `shortest_path_length` [m], which takes time; it is infinite where
    there is no way. Other options are ignored.

    ## Arguments
    | Argument | Default | Meaning |
    |---|---|---|
    | `scenario` | `"static"` | a name, the path of a YAML file, or a dict |
    | `overrides` | `None` | values by dotted key that replace the scenario's, such as `{"lidar.beams": 360}` |
    | `observation` | `"dict"` | or `"flat"` |
    | `action` | `"continuous"` | or `"discrete"` |
    | `render_mode` | `None` | or `"rgb_array"`, `"human"` |

    The attribute `simulation` is the core that the env stands on.

    ## Vectorized environment
    `gym.make_vec(id, num_envs=n)` gives a native vector env whose row k is this env with seed + k, bit for bit.

    ## Version History
    - v0: first version.

    Raises:
        ValueError: a scenario that can't be, or with several robots; another form or render mode than these.
    """

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 10}

    def __init__(
        self,
        scenario: ScenarioSource = "static",
        overrides: Mapping[str, Any] | None = None,
        observation: ObservationForm = "dict",
        action: ActionForm = "continuous",
        render_mode: str | None = None,
    ) -> None:
        require_one_of("render_mode", render_mode, (None, *self.metadata["render_modes"]))
        self.simulation = Simulation(scenario, overrides=overrides)
        require_one_robot(self.simulation)
        self.spaces = RobotSpaces(self.simulation, observation, action)
        self.observation_space = self.spaces.observation
        self.action_space = self.spaces.action
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": 1.0 / self.simulation.scenario.time.step}
        self._pictures = Pictures(self.simulation, render_mode)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start episode 0 of the seed, or without one the next episode."""
        super().reset(seed=seed)
        flat = self.simulation.reset(seeds=None if seed is None else [seed])
        info = self.simulation.robot_step().info
        if options and options.get("shortest_path"):
            info["shortest_path_length"] = self.simulation.shortest_path().length
        self._pictures.record()
        return self.spaces.present(flat[0, 0]), info

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for one step."""
        simulation = self.simulation
        simulation.advance(self.spaces.velocities(action).reshape(1, 1, 2))
        reward, terminated, truncated, info = simulation.robot_step()
        if self.render_mode is not None:
            self._pictures.record()
        return self.spaces.present(simulation.world.observation[0, 0].copy()), reward, terminated, truncated, info

    def render(self) -> Any:
        """The picture (H, W, 3) RGB uint8 with "rgb_array"; None with "human", whose window each step updates."""
        return next(iter(self._pictures.frames()), None)

    def close(self) -> None:
        """Close the window."""
        self._pictures.close()


def require_one_of(name: str, value: object, known: tuple[object, ...]) -> None:
    """Raise a ValueError where an argument has none of the values that it may have."""
    if value not in known:
        raise ValueError(f"{name} is one of {', '.join(map(repr, known))}, got {value!r}")


def require_one_robot(simulation: Simulation) -> None:
    """Raise a ValueError where a scenario has several robots."""
    if simulation.robots != 1:
        raise ValueError(
            f"scenario {simulation.scenario.name!r} has {simulation.robots} robots, expected 1: "
            "several robots are for bug_gym.parallel_env"
        )


def with_most_steps(scenario: Scenario, most: int | None) -> Scenario:
    """The scenario with a time limit of at most so many steps; None: as it is."""
    if most is None or scenario.time.steps <= most:
        return scenario
    return load(scenario, {"time.limit": most * scenario.time.step})
