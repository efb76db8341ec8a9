"""Solver with checkpoints: resumes from the state of an interrupted bake, and writes its own state."""

from __future__ import annotations

from collections.abc import Callable, Generator

import numpy as np

from ..resume.checkpoint import Arrays, Checkpoint
from ..settings import Settings
from .radiosity_state import IterationStep, Radiosity, StartLight
from .solver import ChooseSubstitutes, Solver


class ResumedSolver(Solver):
    """`Solver` that resumes from a checkpoint and writes its state between iterations.

    The last iteration is always run, because its result on the device is read afterwards.

    key:  returns the key of the light in the checkpoint
    """

    def __init__(
        self,
        radiosity: Radiosity,
        start: StartLight,
        settings: Settings,
        choose_substitutes: ChooseSubstitutes | None,
        validity: np.ndarray | None,
        checkpoint: Checkpoint,
        key: Callable[[], str],
    ) -> None:
        super().__init__(radiosity, start, settings, choose_substitutes, validity)
        self._checkpoint, self._key = checkpoint, key
        state = checkpoint.light(key)
        if state is not None and len(state["steps"]) < self._limit:
            self._restore(state)
            checkpoint.note(f"Light was restored from bounce {self.iterations} of an interrupted bake.")

    def iteration(self) -> Generator[float, None, None]:
        """Run one iteration; yield progress 0..1."""
        yield from super().iteration()
        if self._checkpoint.due and not self.done:
            self._checkpoint.write_light(self._key, self._state())

    def _state(self) -> Arrays:
        """Return all arrays on which later iterations depend, by name."""
        state = self._radiosity.state()
        state["ring"] = np.array([self._newest])
        state["total"] = np.array([self._total])
        state["direct"] = self.direct
        if self.substitute is not None:
            state["substitute"] = self.substitute
        state["steps"] = np.array([(step.change, step.relative, step.flux) for step in self._steps])
        state["factors"] = np.array(self._factors)
        state["refined"] = np.array([self._sparse, self._refined])
        if self._anderson is not None:
            state["mixed"], state["size"] = self._anderson.state()
        return state

    def _restore(self, state: Arrays) -> None:
        """Restore the solver from the arrays that `_state` returned."""
        self._radiosity.restore(state)
        self._set_substitutes(state.get("substitute"))
        self._newest, self._total = int(state["ring"][0]), float(state["total"][0])
        self._direct = state["direct"]
        self._steps = [IterationStep(*step) for step in state["steps"].tolist()]
        self._factors = state["factors"].tolist()
        self._sparse, self._refined = bool(state["refined"][0]), int(state["refined"][1])
        if self._anderson is not None:
            self._anderson.restore(state["mixed"], state["size"])
