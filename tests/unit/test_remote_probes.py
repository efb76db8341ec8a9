"""Probes by workers: blocks that a checkpoint holds are not gathered again."""

from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from engine.cluster.blocks import cut
from engine.cluster.cluster_devices import _FEWEST_PROBES, ClusterDevices
from engine.progress import finished


class Tasks:
    """Tasks that run at once, the last one first; `spans` are those that were begun."""

    spans: ClassVar = []

    def sent(self, value, _name):
        return value

    def begin(self, _function, tasks):
        self.spans = [task[-1] for task in tasks]
        return list(range(len(tasks)))

    def take(self, tasks, put):
        for span in reversed(tasks.values()):
            put(span, block(*span))
            yield 0.5


def block(first, end):
    """Return the values of probes: their numbers."""
    numbers = np.arange(first, end)
    return numbers, numbers, numbers, numbers[:0]


COUNT = 10 * _FEWEST_PROBES + 7
SPANS = cut(COUNT, _FEWEST_PROBES)


@pytest.mark.parametrize("known", [SPANS[1::3], SPANS])
def test_only_missing_blocks_are_gathered_and_all_are_in_order(known):
    devices, tasks, added = object.__new__(ClusterDevices), Tasks(), {}
    devices._tasks, devices._probe_light = tasks, None
    devices._shipped, devices._patches = SimpleNamespace(shipment=None), SimpleNamespace(table=None)

    def find(*span):
        return block(*span) if span in known else None

    def add(first, end, part):
        added[first, end] = part

    parts = finished(devices.probes(object(), 0, COUNT, object(), find, add))
    assert np.array_equal(np.concatenate([part[0] for part in parts]), np.arange(COUNT))
    assert len(known) > 1 and sorted([*known, *tasks.spans]) == sorted(SPANS)
    assert sorted(added) == tasks.spans
