"""PPO of RLlib on two robots whose ways cross: one policy drives both.

python rllib_two_robots.py --minutes 1
"""

import argparse
import time
from typing import Any

from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.multi_rl_module import MultiRLModuleSpec
from ray.rllib.core.rl_module.rl_module import RLModuleSpec
from ray.rllib.env.multi_agent_env import MultiAgentEnv

import bug_gym


class Robots(MultiAgentEnv):
    """A `parallel_env` as RLlib takes it.

    Args:
        config: what `parallel_env` takes: `scenario`, `robots`, `overrides` ...
    """

    def __init__(self, config: dict[str, Any]) -> None:
        super().__init__()
        self.env = bug_gym.parallel_env(**{"observation": "flat", **config})
        self.possible_agents = list(self.env.possible_agents)
        self.agents = list(self.possible_agents)
        self.observation_spaces = {agent: self.env.observation_space(agent) for agent in self.possible_agents}
        self.action_spaces = {agent: self.env.action_space(agent) for agent in self.possible_agents}

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        """Start an episode."""
        observations, infos = self.env.reset(seed=seed, options=options)
        self.agents = list(self.env.agents)
        return observations, infos

    def step(self, action_dict: dict[str, Any]) -> tuple[Any, Any, Any, Any, Any]:
        """Drive the robots in play; the episode is over when none is left, however each one ended."""
        observations, rewards, terminated, truncated, infos = self.env.step(action_dict)
        self.agents = list(self.env.agents)
        is_over, is_late = not self.agents, any(truncated.values())
        terminated = {**terminated, "__all__": is_over and not is_late}
        truncated = {**truncated, "__all__": is_over and is_late}
        return observations, rewards, terminated, truncated, infos


def main() -> None:
    """Train for some minutes, and say how it goes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=1.0, help="how long to train")
    minutes = parser.parse_args().minutes
    config = (
        PPOConfig()
        .environment(Robots, env_config={"scenario": "crossing_robots", "robots": 2})
        .multi_agent(policies={"robot"}, policy_mapping_fn=lambda agent, episode, **_: "robot")
        .rl_module(rl_module_spec=MultiRLModuleSpec(rl_module_specs={"robot": RLModuleSpec()}))
        .env_runners(num_env_runners=0)
        .training(train_batch_size_per_learner=4000, minibatch_size=500, num_epochs=5, lr=3e-4, gamma=0.995)
    )
    trainer = config.build_algo()
    begin = time.monotonic()
    while time.monotonic() - begin < 60.0 * minutes:
        told = trainer.train()["env_runners"]
        ended = f"return {told['episode_return_mean']:.2f}" if "episode_return_mean" in told else "no episode has ended"
        steps = told["num_env_steps_sampled_lifetime"]
        print(f"{time.monotonic() - begin:4.0f} s, {steps:.0f} steps: {ended}", flush=True)
    trainer.stop()


if __name__ == "__main__":
    main()
