"""Measures how long a Blender window stops during a bake, by stage.

    blender scene.blend --python tools/stalls.py

starts a bake once the window is there and prints a table when it has ended. A timer that is due every 5 ms
writes down when it comes: what lies between two of its calls is a stall, of the stage that was shown before.
A stall is what Hemibake does in one event, and what Blender does besides, such as drawing the window. The
former is measured as processor time of the main thread, which other programs do not prolong.
"""

from __future__ import annotations

import importlib
import statistics
import sys
import time
from collections.abc import Callable

import bpy

#: Interval of the timer, s.
_INTERVAL = 0.005

#: Name of the extension while it is enabled.
_MODULE = "bl_ext.user_default.hemibake"


class Stalls:
    """The gaps between calls of a timer, s, by the stage of the bake that is running.

    total:  how long the bake took, s
    """

    def __init__(self, ended: Callable[[], None] = lambda: None) -> None:
        self._owner = importlib.import_module(f"{_MODULE}.operators.worker_manager").owner
        self._ended = ended
        self._gaps: list[tuple[float, str]] = []
        self._events: list[tuple[float, str]] = []
        self._seen: list[tuple[float, float, str]] = []
        self.total = 0.0

    def start(self) -> None:
        """Start a bake as the button does, and watch it."""
        self._start = self._last = time.perf_counter()
        self._stage = "Click"
        self._watch_events()
        bpy.app.timers.register(self._tick, first_interval=0.0)
        bpy.ops.hemibake.bake("INVOKE_DEFAULT")

    def _watch_events(self) -> None:
        """Measure the processor time that Hemibake takes at each event, s."""
        operator = importlib.import_module(f"{_MODULE}.operators.bake").HEMIBAKE_OT_bake
        modal = operator.modal

        def measured(self_, context, event):
            before, stage = time.thread_time(), self._stage
            try:
                return modal(self_, context, event)
            finally:
                self._events.append((time.thread_time() - before, stage))
                if self._owner.running is None:
                    operator.modal = modal
                else:
                    self._stage = self._owner.running.progress.stage

        operator.modal = measured

    def _tick(self) -> float | None:
        now = time.perf_counter()
        self._gaps.append((now - self._last, self._stage))
        running = self._owner.running
        if running is None:
            self.total = now - self._start
            self._ended()
            return None
        self._stage, self._last = running.progress.stage, now
        self._seen.append((now - self._start, running.progress.overall, self._stage))
        return _INTERVAL

    def table(self) -> str:
        """Return the median and the longest stall, of all and of each stage, and how even progress was."""
        gaps = [gap for gap, _ in self._gaps]
        events = [spent for spent, _ in self._events]
        lines = [
            f"{self.total:.1f} s; stalls: median {_ms(statistics.median(gaps))}, longest {_ms(max(gaps))}; "
            f"by Hemibake: median {_ms(statistics.median(events))}, longest {_ms(max(events))}"
        ]
        for stage in dict.fromkeys(stage for _, stage in self._gaps):
            own = [gap for gap, of in self._gaps if of == stage]
            lines.append(
                f"  {stage:44} {sum(own):6.2f} s   longest {_longest(own)}   "
                f"by Hemibake {_longest([spent for spent, of in self._events if of == stage])}"
            )
        lines.append("  " + ", ".join(self._evenness()))
        return "\n".join(lines)

    def _evenness(self) -> list[str]:
        """Return the displayed progress at each quarter of the time."""
        shown = []
        for quarter in (0.1, 0.25, 0.5, 0.75, 0.9):
            past = [overall for at, overall, _ in self._seen if at <= quarter * self.total]
            shown.append(f"{past[-1] if past else 0:.0%} at {quarter:.0%} of the time")
        return shown


def _longest(times: list[float]) -> str:
    """Return the three longest times."""
    return ", ".join(_ms(seconds) for seconds in sorted(times)[:-4:-1])


def _ms(seconds: float) -> str:
    return f"{1000 * seconds:.0f} ms"


def main() -> None:
    """Bake once the window is there, print the table, and leave Blender."""

    def leave() -> None:
        sys.stdout.write(stalls.table() + "\n")
        bpy.context.preferences.view.use_save_prompt = False
        bpy.app.timers.register(lambda: bpy.ops.wm.quit_blender() and None)

    def begin() -> None:
        area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
        with bpy.context.temp_override(window=window, area=area):
            stalls.start()

    stalls, window = Stalls(leave), bpy.context.window_manager.windows[0]
    bpy.app.timers.register(begin, first_interval=2.0)


if __name__ == "__main__":
    main()
