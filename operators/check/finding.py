"""Findings of a check."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass

from ...engine.object_message import object_message
from ...engine.plan.estimate import Estimate

ERROR, WARNING, INFO = "ERROR", "WARNING", "INFO"


@dataclass(frozen=True)
class Finding:
    """One finding of a check.

    severity:  ERROR: objects get no light, or there is no light; WARNING: may look wrong; INFO: for
               information
    text:      a sentence with the objects and a remedy
    objects:   names of the objects
    fix:       name of the fix, see `fixes`; empty without one
    value:     a number for the fix
    """

    severity: str
    text: str
    objects: tuple[str, ...] = ()
    fix: str = ""
    value: int = 0


def found(severity: str, sentence: str, names: Sequence[str], fix: str = "", value: int = 0) -> list[Finding]:
    """Return a list with a finding on objects, whose names replace {}; an empty list without objects."""
    if not names:
        return []
    ordered = tuple(sorted(set(names)))
    return [Finding(severity, object_message(sentence, ordered), ordered, fix, value)]


@dataclass(frozen=True)
class Checked:
    """Result of a check of a scene.

    findings:  the findings, worst first
    estimate:  estimate of the bake; None if nothing would be baked
    """

    findings: tuple[Finding, ...]
    estimate: Estimate | None

    def to_json(self) -> str:
        """Return the result as JSON, to be stored with the scene."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> Checked | None:
        """Return the result stored as JSON; None for an empty text."""
        if not text:
            return None
        kept = json.loads(text)
        findings = (Finding(**{**entry, "objects": tuple(entry["objects"])}) for entry in kept["findings"])
        return cls(tuple(findings), Estimate(**kept["estimate"]) if kept["estimate"] else None)
