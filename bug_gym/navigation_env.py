"""One world with one robot as a `gymnasium.Env`; also what the other faces share: a robot's spaces, and pictures."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from types import FrameType
from typing import Any

import gymnasium as gym
from gymnasium.envs.registration import EnvSpec

from bug_gym.by_hand import keys_to_action
from bug_gym.checks import checked_options
from bug_gym.config import load
from bug_gym.drawing.pictures import Pictures
from bug_gym.log import warn_once
from bug_gym.simulation import Simulation
from bug_gym.spaces import (
    OPTIONS,
    ActionForm,
    InfoForm,
    Observation,
    ObservationForm,
    OwnArguments,
    OwnFields,
    OwnTerms,
    RobotSpaces,
    ScenarioSource,
    asked_info,
    is_numeric,
    numeric_info,
    require_one_of,
    require_one_robot,
    with_most_steps,
)
from bug_gym.view import Sensors


class NavigationEnv(gym.Env[Any, Any]):
    """One robot among unknown obstacles, on its way to a goal.

    ## Description
    A robot drives through a bounded plane world among circles and polygons, some of which may move. It senses ranges
    with a LIDAR and knows where its goal is; it has no map. The scan is the exact distance along each ray, and contact
    is tested along the whole way of each step, so that nothing fast or thin is missed: the robot's chord, or its arc where
    that may lie more than 3 mm beside it, and the movers' chords. A mover that turns within a step is off its chord by at
    most half of its speed times the step.

    ## Action Space
    `Box(-1, 1, (2,), float32)`, cut to these bounds:

    | Num | `differential` | `ackermann` | `holonomic` |
    |---|---|---|---|
    | 0 | speed, -max_reverse to max_speed [m/s] | likewise | velocity ahead, over max_speed |
    | 1 | turn rate, to +-max_turn_rate [rad/s] | steering angle, to +-max_steering [rad] | to the left, likewise |

    The steering angle is that of the front wheels, above 0 to the left, and no rate: wheels turn at once. The robot drives an
    exact arc about its rear axle, where its origin lies: its heading changes by speed tan(angle) / wheelbase [rad/s], and a
    limited acceleration changes the speed only. It never turns on the spot.

    A holonomic robot doesn't turn; its velocity is scaled back to max_speed where it would be faster. With
    `action="discrete"`: `Discrete(128)`, action i steers for one step toward heading i // 4 of 32 at (i % 4 + 1) / 4 of
    max_speed; an ackermann robot goes ahead for the 17 headings ahead, its wheels turned in proportion, and back for the others
    (`bug_gym.kinematics.steered_table`).

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
    within +-max_speed, that of an ackermann one speed and turn rate. `terrain` has a row for each of 32 bearings,
    counter-clockwise from the heading, with the cost factor every 0.25 m up to 4 m: ground of factor 2.5 divides the speed
    of a robot whose centre is on it by 2.5.

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
    there is no way, NaN where the body does not fit at the goal. `reset(options={"drawn": True})` adds what a scenario with
    ranges has drawn for the episode, as `drawn.robot.max_speed` and the like. Other options are refused. With
    `info="numeric"` there are numbers alone: `outcome` is its code (0 running, 1 success, 2 collision, 3 timeout), and each
    reward term has a key, `reward_terms.progress` and so on.

    ## Arguments
    | Argument | Default | Meaning |
    |---|---|---|
    | `scenario` | `"static"` | a name, the path of a YAML file, or a dict |
    | `overrides` | `None` | values by dotted key that replace the scenario's, such as `{"lidar.beams": 360}` |
    | `observation` | `"dict"` | or `"flat"` |
    | `action` | `"continuous"` | or `"discrete"` |
    | `render_mode` | `None` | or `"rgb_array"`, `"human"` |
    | `info` | `"named"` | or `"numeric"` |
    | `reward_terms` | `None` | further terms of the reward, name -> function over named arrays: see `bug_gym.own_parts` |
    | `observation_fields` | `None` | further fields, name -> `bug_gym.ObservationField` or a dict that says the same |
    | `trust` | `False` | whether code that the scenario only names may be imported, which runs their modules' code |

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
        info: InfoForm = "named",
        reward_terms: OwnTerms | None = None,
        observation_fields: OwnFields | None = None,
        trust: bool = False,
    ) -> None:
        require_one_of("render_mode", render_mode, (None, *self.metadata["render_modes"]))
        own: OwnArguments = {"reward_terms": reward_terms, "observation_fields": observation_fields, "trust": trust}
        self.simulation = Simulation(load(scenario, overrides, **own))
        require_one_robot(self.simulation)
        self.spaces = RobotSpaces(self.simulation, observation, action)
        self.observation_space = self.spaces.observation
        self.action_space = self.spaces.action
        self.render_mode = render_mode
        fps = 1.0 / self.simulation.scenario.time.step
        # Gymnasium's `play` takes a whole number only.
        self.metadata = {**self.metadata, "render_fps": int(fps) if fps.is_integer() else fps}
        self._pictures = Pictures(self.simulation, render_mode)
        self._is_numeric = is_numeric(info)
        self._is_over = False
        self._spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """What `gymnasium.make` made it from; its `max_episode_steps` cuts episodes off as the scenario's time limit does."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = spec
        most = steps_asked_of_make(inspect.currentframe())
        if most is not None:
            self.simulation = Simulation(with_most_steps(self.simulation.scenario, most))
            self._pictures = Pictures(self.simulation, self.render_mode)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start episode 0 of the seed, or without one the next episode.

        Raises:
            ValueError: a seed that is no integer from 0 on, options that are no dict, or of another name; or a world that found
                no place for its obstacles; a further `reset()` passes over a next episode that did not. The world is then as it
                was.
        """
        wanted = checked_options(options, OPTIONS)
        # A seed is there before the first world where someone has asked for it: Gymnasium drew it, and no world comes from
        # it. That of a generator which was set by hand is -1.
        is_none_of_ours = not self.simulation.has_episode(0) and self._np_random_seed != -1
        flat = self.simulation.reset(seeds=None if seed is None else [seed])
        self._is_over = False
        if seed is not None or is_none_of_ours or self._np_random is None:
            # Then `np_random_seed` is what drew the world.
            super().reset(seed=int(self.simulation.world.seed[0]))
        info = self.simulation.robot_step().info | asked_info(self.simulation, wanted)
        self._pictures.record()
        return self.spaces.present(flat[0, 0]), numeric_info(info) if self._is_numeric else info

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for one step; after the end of an episode the robot stands until the next reset, which the log says once."""
        first, second = self.spaces.velocity(action)
        flat, reward, terminated, truncated, info = self.simulation.step_one(first, second)
        if self._is_over and (terminated or truncated):
            warn_once("step() after the end of an episode: call reset(), until then the robot stands with reward 0")
        self._is_over = terminated or truncated
        if self.render_mode is not None:
            self._pictures.record()
        if self._is_numeric:
            info = numeric_info(info)
        return self.spaces.present(flat), reward, terminated, truncated, info

    def render(self) -> Any:
        """The picture (H, W, 3) RGB uint8 with "rgb_array"; None with "human", whose window each step updates."""
        return next(iter(self._pictures.frames()), None)

    def get_keys_to_action(self) -> dict[tuple[str, ...], Any]:
        """Keys -> action for `gymnasium.utils.play.play(env)`: w, a, s, d, as `bug_gym.by_hand.keys_to_action` says."""
        return keys_to_action(Sensors.of(self.simulation.scenario).drive, discrete=self.spaces.is_discrete)

    def close(self) -> None:
        """Close the window."""
        self._pictures.close()


def steps_asked_of_make(frame: FrameType | None) -> int | None:
    """The `max_episode_steps` of the `gymnasium.make` that is giving an env its spec; None: there is no such.

    Gymnasium does not hand it to the env, but puts a TimeLimit round it, and what that cuts off the env's info could not
    tell. So it is read where `make` keeps it; where that is not found, the wrapper cuts off and the outcome stays "running".

    Args:
        frame: of the setter of the env's spec.
    """
    maker = None if frame is None else frame.f_back
    if maker is None or maker.f_globals.get("__name__") != EnvSpec.__module__:
        return None
    asked = maker.f_locals.get("max_episode_steps")
    if asked is None:
        asked = getattr(maker.f_locals.get("env_spec"), "max_episode_steps", None)
    return asked if isinstance(asked, int) and asked > 0 else None  # -1: no limit; of others TimeLimit complains
