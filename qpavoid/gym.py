"""Learning: environments over scenarios, with the filter as a shield.

    env = ShieldedEnv(ScenarioEnv("demo/strangers"))

Requires the extra ``gym``. Gymnasium knows them as ``qpavoid/Scenario-v0``.
"""

from qpavoid.errors import MissingExtraError

try:
    import gymnasium
    import pettingzoo  # noqa: F401
except ImportError:
    raise MissingExtraError("Gymnasium or PettingZoo", "gym") from None

from qpavoid.lab.gym.env import ScenarioEnv, ScenarioVectorEnv, ShieldedEnv
from qpavoid.lab.gym.fleet import FleetEnv

__all__ = ["FleetEnv", "ScenarioEnv", "ScenarioVectorEnv", "ShieldedEnv"]

gymnasium.register(
    id="qpavoid/Scenario-v0",
    entry_point="qpavoid.gym:ScenarioEnv",
    vector_entry_point="qpavoid.gym:ScenarioVectorEnv",
)
