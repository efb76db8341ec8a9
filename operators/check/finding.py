"""What a check finds."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass

from ...engine.object_message import object_message
from ...engine.plan.estimate import Estimate

ERROR, WARNING, INFO = "ERROR", "WARNING", "INFO"


@dataclass(frozen=True)
class Finding:
    """One thing that a check has found.

    severity  ERROR: objects get no light, or there is none; WARNING: it may look wrong; INFO: good to know
    text      a sentence that names objects and remedy
    objects   their names
    fix       name of what mends it, see `fixes`; empty if nothing does by itself
    value     a number for the fix
    """

    severity: str
    text: str
    objects: tuple[str, ...] = ()
    fix: str = ""
    value: int = 0


def found(severity: str, sentence: str, names: Sequence[str], fix: str = "", value: int = 0) -> list[Finding]:
    """Return a finding about objects, whose names go where {} is; none without objects."""
    if not names:
        return []
    ordered = tuple(sorted(set(names)))
    return [Finding(severity, object_message(sentence, ordered), ordered, fix, value)]


@dataclass(frozen=True)
class Checked:
    """What a check of a scene has found, the worst first, and what a bake is expected to take.

    estimate: None if nothing would be baked
    """

    findings: tuple[Finding, ...]
    estimate: Estimate | None

    def to_json(self) -> str:
        """Return it as text, to be kept with the scene."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> Checked | None:
        """Return what a text holds, None for an empty one."""
        if not text:
            return None
        kept = json.loads(text)
        findings = (Finding(**{**entry, "objects": tuple(entry["objects"])}) for entry in kept["findings"])
        return cls(tuple(findings), Estimate(**kept["estimate"]) if kept["estimate"] else None)
