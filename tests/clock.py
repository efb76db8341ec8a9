"""Clock for tests of times, which takes the place of the module time."""


class Clock:
    """A time that tests set, s."""

    now = 100.0

    def perf_counter(self):
        return self.now
