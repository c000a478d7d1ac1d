"""PPO of RLlib in `Dynamic`: 64 worlds in one process, stepped by our own vector env.

python rllib_dynamic.py --minutes 1
"""

import argparse
import time

from ray.rllib.algorithms.ppo import PPOConfig

WORLDS = 64


def main() -> None:
    """Train for some minutes, and say how it goes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=1.0, help="how long to train")
    minutes = parser.parse_args().minutes
    config = (
        PPOConfig()
        # The module before the colon is imported wherever RLlib makes the env: in its workers, too.
        .environment("bug_gym:BugGym/Dynamic-v0", env_config={"observation": "flat"})
        # Not one env after the other (RLlib's "sync"), but the vector env that is registered with the id.
        .env_runners(num_env_runners=0, num_envs_per_env_runner=WORLDS, gym_env_vectorize_mode="vector_entry_point")
        .training(train_batch_size_per_learner=8192, minibatch_size=1024, num_epochs=4, lr=1e-3, gamma=0.99)
    )
    trainer = config.build_algo()
    runner = trainer.env_runner
    print(f"{runner.num_envs} worlds in {type(runner.env.unwrapped).__name__}", flush=True)
    begin = time.monotonic()
    while time.monotonic() - begin < 60.0 * minutes:
        told = trainer.train()["env_runners"]
        ended = f"return {told['episode_return_mean']:.2f}" if "episode_return_mean" in told else "no episode has ended"
        steps = told["num_env_steps_sampled_lifetime"]
        print(f"{time.monotonic() - begin:4.0f} s, {steps:.0f} steps: {ended}", flush=True)
    trainer.stop()


if __name__ == "__main__":
    main()
