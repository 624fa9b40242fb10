"""A policy that drives at random, with and without the filter as its shield.

Run: python comparisons/examples/random_policy.py [episodes]
"""

import sys

from qpavoid.errors import MissingExtraError

try:
    import qpavoid.gym as qgym
except MissingExtraError as error:
    sys.exit(str(error))


def contacts(env, episodes):
    """Return how many of these episodes end by touching something, and their cost."""
    touched, cost = 0, 0.0
    env.action_space.seed(0)
    for scene in range(episodes):
        env.reset(seed=scene, options={"scene": scene})
        over = late = False
        step = 0
        while not (over or late):
            if step % 20 == 0:  # every second
                action = env.action_space.sample()
            _, _, over, late, info = env.step(action)
            step, cost = step + 1, cost + info.get("cost", 0.0)
        touched += info["touched"]
    return touched, cost


if __name__ == "__main__":
    episodes = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    env = qgym.ScenarioEnv("demo/strangers", seeds=range(episodes))
    for which in (env, qgym.ShieldedEnv(env)):
        touched, cost = contacts(which, episodes)
        print(f"{which}: contact in {touched} of {episodes} episodes, cost {cost:.1f}")
