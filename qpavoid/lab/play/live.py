"""A robot under way whose controller, settings and reference can change."""

from qpavoid.lab.simulation.methods import make_controller
from qpavoid.lab.simulation.scenario import Scenario
from qpavoid.lab.simulation.simulation import Simulation


class Live(Simulation):
    """A :class:`Simulation` that can go on from where another one is.

    Attributes:
        controller: Name of the controller.

    Args:
        scenario: What to run.
        controller: Name of the controller.

    Raises:
        UnknownNameError: No controller of that name.
    """

    def __init__(self, scenario: Scenario, controller: str) -> None:
        super().__init__(scenario, controller, explain=True)
        self.controller = controller

    def take_over(
        self, other: "Live", clock: "Live | None" = None, remember: bool = True
    ) -> None:
        """Stand where another robot stands, and drive what it drives.

        Args:
            other: The robot that has driven so far.
            clock: One whose reference is followed on from where it was left; None:
                the reference begins.
            remember: Whether what was estimated of the discs still holds.
        """
        self.pose, self.driven = other.pose, other.driven
        self._believed, self._locate = other._believed, other._locate
        self._drive = other._drive
        if clock is not None:
            self._path.take_over(clock._path)
        if remember:
            self._see = other._see
        robot, settings = self.scenario.robot, self.scenario.settings
        method = make_controller(self.controller, robot, settings)
        self._step = method.start(*self.driven)
        assert self._recorder is not None
        self._recorder.reset(*self.driven)
