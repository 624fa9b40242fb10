"""Learning: environments over scenarios, with the filter as a shield.

    env = ShieldedEnv(ScenarioEnv("demo/strangers"))

Requires the extra ``gym``. Gymnasium knows them as ``qpavoid/Scenario-v0``.
"""

from qpavoid.errors import MissingExtraError

try:
    import gymnasium
except ImportError:
    raise MissingExtraError("Gymnasium", "gym") from None

from qpavoid.lab.gym.env import ScenarioEnv, ShieldedEnv

__all__ = ["ScenarioEnv", "ShieldedEnv"]

gymnasium.register(id="qpavoid/Scenario-v0", entry_point="qpavoid.gym:ScenarioEnv")
