"""The clock of a session: its own thread, at the control rate, come what may."""

import json
import threading
import time
from typing import Any

from qpavoid.lab.play.actions import act, description
from qpavoid.lab.play.messages import Message
from qpavoid.lab.play.session import Session

FRAME_TIME = 1 / 60
"""s; frames are published no more often."""

PATIENCE = 0.25
"""s; by so much the loop may catch up; a longer delay is time that is lost."""


class Loop:
    """Drives a session in real time; clients look at what it published last.

    Nothing here waits for a client: a frame replaces the one before it, read or not.

    Args:
        session: What to drive; only to be touched through this loop from now on.

    Attributes:
        frame: Number and JSON text of the latest frame.
        world: Number and JSON text of the latest description.
    """

    def __init__(self, session: Session) -> None:
        self.frame: tuple[int, str] = (0, "")
        self.world: tuple[int, str] = (0, "")
        self._session = session
        self._lock = threading.Lock()
        self._over, self._trouble = threading.Event(), ""
        self._thread = threading.Thread(target=self._run, name="loop", daemon=True)
        self._describe()

    def start(self) -> None:
        """Let the clock run, unless it does."""
        if self._thread.ident is None:
            self._thread.start()

    def stop(self) -> None:
        """End the loop and wait for its last step, if it ever began."""
        self._over.set()
        if self._thread.ident is not None:
            self._thread.join()

    def do(self, message: Message) -> None:
        """Do what a client's message says, between two steps.

        Raises:
            QPAvoidError: It cannot be done.
        """
        with self._lock:
            if act(self._session, message):
                self._trouble = ""
                self._describe()

    def let_go(self, discs: set[int]) -> None:
        """Let go of discs whose client is gone."""
        with self._lock:
            for disc in self._session.discs:
                if disc.number in discs:
                    disc.let_go()

    def recording(self) -> str:
        """Return the recording as a scenario file; empty if there is none."""
        with self._lock:
            return self._session.recording_toml()

    def _describe(self) -> None:
        content = description(self._session) | {"trouble": self._trouble}
        self.world = self.world[0] + 1, json.dumps(content)

    def _run(self) -> None:
        """Step at the control rate until the loop is stopped."""
        dt = self._session.scenario.dt
        due = shown = time.perf_counter()
        while not self._over.is_set():
            with self._lock:
                frame = self._step()
            now = time.perf_counter()
            if now - shown >= FRAME_TIME - dt / 2:
                shown = now
                self._publish(frame)
            # What is late is caught up with by steps without a pause, up to a limit:
            # after a laptop's sleep nobody wants to see an hour in fast motion.
            due = max(due + dt, now - PATIENCE)
            self._over.wait(max(0.0, due - time.perf_counter()))

    def _step(self) -> dict[str, Any]:
        """Return the next frame; a step that fails pauses the session and is told."""
        session = self._session
        before = session.running, session.recording
        try:
            frame = session.step() if session.running else session.glance()
        except Exception as error:
            session.running, frame = False, session.glance()
            self._trouble = f"Paused: {error}"
        if before != (session.running, session.recording):
            self._describe()
        return frame

    def _publish(self, frame: dict[str, Any]) -> None:
        # One tuple, put in place at once: readers in other threads need no lock.
        text = json.dumps({"kind": "frame", **frame})
        self.frame = self.frame[0] + 1, text
