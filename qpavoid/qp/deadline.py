"""A foreign back end in a process of its own: an answer by the deadline, or the exact.

Only a process can be stopped whatever it does: a solver may hang with the interpreter's
lock, leave by SystemExit, or take its process with it.
"""

import os
import pickle
import signal
import subprocess
import sys
import threading
import weakref
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue
from struct import Struct
from struct import error as StructError
from time import monotonic

import numpy as np

from qpavoid.errors import QPAvoidError
from qpavoid.qp.exact import WIDTH
from qpavoid.qp.problem import ScaledProblem
from qpavoid.qp.solve import BackEnd, find_back_end, load_back_end
from qpavoid.settings import want
from qpavoid.types import Array

CODE = """
from qpavoid.qp.deadline import serve
from qpavoid.qp.solve import load_back_end
serve(lambda: load_back_end({name!r}))
"""
"""What the process runs."""

SIZE, ANSWER = Struct("<q"), Struct("<qdd")
"""What goes before a question; what comes back, its number and z, and once before any,
with 0: it is there."""

START = 60.0
"""s that the process may take to be there when a filter is made."""

ALONE = 60.0
"""s of one answer after which a process ends by itself, if nobody has stopped it."""

TRIES = 3
"""Processes in a row that may end without an answer; then the exact solve stays."""


class DeadlineBackEnd:
    """A back end that answers in time: its own answer, or the exact one.

    Where it is late, dead, or its answer not finite, the exact solve stands in, in the
    caller's thread. A process that is late is killed and started anew beside the loop.

    Args:
        name: Of the back end.
        deadline: s for each answer, or from :meth:`begin` on for all; positive.

    Attributes:
        stand_ins: How often the exact solve stood in.

    Raises:
        UnknownNameError: No back end of that name.
        MissingExtraError: Its package is absent.
        InvalidInputError: The deadline is not positive and finite.
        QPAvoidError: The process does not start.
    """

    def __init__(self, name: str, deadline: float) -> None:
        want(0.0 < deadline < np.inf, "the deadline must be positive and finite, in s")
        find_back_end(name)
        self.name, self.deadline, self.stand_ins = name, deadline, 0
        self._exact, self._ended = load_back_end("exact"), 0
        self._until = np.inf
        self._talk = self._begin()
        if not self._talk.there.wait(START) or self._talk.gone.is_set():
            self._talk.end()
            raise QPAvoidError(f"the process of back end {name!r} does not start")

    def _begin(self) -> "_Talk":
        talk = _Talk(self.name)
        weakref.finalize(self, talk.end)
        talk.start()
        return talk

    @property
    def has_given_up(self) -> bool:
        """Whether so many processes ended that none is started any more."""
        return self._ended >= TRIES

    def begin(self) -> None:
        """Let the deadline count from now on, for all answers until the next call."""
        self._until = monotonic() + self.deadline

    def __call__(self, problem: ScaledProblem) -> Array:
        """Return z; see :class:`qpavoid.qp.solve.BackEnd`."""
        talk, left = self._talk, min(self.deadline, self._until - monotonic())
        if talk.pid != os.getpid():  # forked: the process is the parent's
            self._talk = self._begin()
        elif talk.gone.is_set():
            self._ended += 1
            if not self.has_given_up:
                self._talk = self._begin()
        elif talk.there.is_set() and left > 0.0:
            found = talk.ask(problem, left)
            if np.isfinite(found).all():
                self._ended = 0
                return found
        self.stand_ins += 1
        return self._exact(problem)


class _Talk(threading.Thread):
    """The process, and who talks to it: no pipe then holds the loop up."""

    def __init__(self, name: str) -> None:
        super().__init__(name=f"qpavoid {name}", daemon=True)
        self.there, self.gone = threading.Event(), threading.Event()
        self._code = CODE.format(name=name)
        self._questions: SimpleQueue[bytes] = SimpleQueue()
        self._answers: SimpleQueue[bytes] = SimpleQueue()
        self._process: subprocess.Popen[bytes] | None = None
        self.pid, self._asked = os.getpid(), 0

    def ask(self, problem: ScaledProblem, timeout: float) -> Array:
        """Return its answer; NaN where none comes in so many s: then it is ended."""
        self._asked, until = self._asked + 1, monotonic() + timeout
        self._questions.put(pickle.dumps((self._asked, problem)))
        with suppress(Empty, StructError):
            while (left := until - monotonic()) > 0.0:
                number, *z = ANSWER.unpack(self._answers.get(timeout=left))
                if number == self._asked:  # else of one that somebody did not await
                    return np.array(z)
        self.end()
        return np.full(2, np.nan)

    def end(self) -> None:
        """Stop the process, whatever it does; that of a parent is not touched."""
        if self.pid != os.getpid():
            return
        self.gone.set()
        self._questions.put(b"")
        if self._process is not None:
            self._process.kill()

    def run(self) -> None:
        """Hand questions and answers on until one is missing."""
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        with suppress(OSError):
            self._process = subprocess.Popen(
                [sys.executable, "-c", self._code],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=environment,
            )
            self._hand_on(self._process)
        self.gone.set()
        self.there.set()
        self._answers.put(b"")
        if self._process is not None:
            self._process.kill()
            with suppress(OSError):
                self._process.communicate()

    def _hand_on(self, process: subprocess.Popen[bytes]) -> None:
        asked, answered = process.stdin, process.stdout
        assert asked is not None and answered is not None
        if len(answered.read(ANSWER.size)) < ANSWER.size:
            return
        self.there.set()
        while (question := self._questions.get()) and not self.gone.is_set():
            asked.write(SIZE.pack(len(question)) + question)
            asked.flush()
            answer = answered.read(ANSWER.size)
            if len(answer) < ANSWER.size:
                return
            self._answers.put(answer)


def serve(load: Callable[[], BackEnd]) -> None:
    """Answer what comes on standard input until that ends: what the process does."""
    asked, answered = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a solver prints, and be it when it is loaded, is no answer
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    back_end = load()
    _answer_alone(back_end, _trial())  # the first one loads what it needs
    answered.write(ANSWER.pack(0, 0.0, 0.0))
    answered.flush()
    while head := asked.read(SIZE.size):
        number, problem = pickle.loads(asked.read(*SIZE.unpack(head)))
        z = _answer_alone(back_end, problem)
        answered.write(ANSWER.pack(number, *z))
        answered.flush()


def _trial() -> ScaledProblem:
    unit, zero = np.ones(2), np.zeros(2)
    rows, scale, table = np.array([[1.0, 0.0]]), unit, np.zeros((5, WIDTH))
    return ScaledProblem(zero, rows, zero[:1], -unit, unit, scale, table)


def _answer_alone(back_end: BackEnd, problem: ScaledProblem) -> list[float]:
    """Return z; NaN where the back end fails. One that hangs ends the process."""
    timed, pid = getattr(signal, "setitimer", None), os.getpid()
    try:
        if timed is not None:
            timed(signal.ITIMER_REAL, ALONE)
        found = np.asarray(back_end(problem), dtype=np.float64)
        return [float(x) for x in found.reshape(2)]
    except Exception:
        return [np.nan, np.nan]
    finally:
        if timed is not None:
            timed(signal.ITIMER_REAL, 0.0)
        if os.getpid() != pid:  # a copy that the solver made: one of them answers
            os._exit(0)
