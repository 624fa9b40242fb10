"""Back ends that do what no program survives that runs them in its own process."""

import ctypes
import os
import signal
import time

import numpy as np

from qpavoid.qp.solve import load_back_end


class Solver:
    """Exact, but for every third problem, or whichever is spoiled, and then not at all.

    Args:
        way: ``sleeps``, ``keeps the lock``, ``leaves``, ``dies``, ``raises``, ``NaN``,
            ``prints``, ``forks``, ``stops``, ``dawdles``.
        every: Which problems it spoils; 1: all.
    """

    def __init__(self, way, every=3):
        self.way, self.every, self.count = way, every, -1  # the first is a trial
        self.exact = load_back_end("exact")

    def __call__(self, problem):
        self.count += 1
        if self.count % self.every == 0 and self.count > 0:
            getattr(self, self.way.replace(" ", "_"))()
            if self.way == "NaN":
                return np.full(2, np.nan)
        return self.exact(problem)

    def sleeps(self):
        time.sleep(3600.0)

    def keeps_the_lock(self):
        ctypes.PyDLL(None).sleep(3600)

    def leaves(self):
        raise SystemExit("no licence")

    def dies(self):
        os.kill(os.getpid(), 11)

    def raises(self):
        raise RuntimeError("no licence")

    def NaN(self):
        pass

    def prints(self):
        os.write(1, b"solved! " * 100)

    def forks(self):
        os.fork()

    def stops(self):
        os.kill(os.getpid(), signal.SIGSTOP)

    def dawdles(self):
        time.sleep(0.2)
