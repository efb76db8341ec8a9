"""Validator of the part of JSON Schema (draft 2020-12) that docs/reference/manifest.schema.json uses."""

import json
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

#: Schema of the manifest.
MANIFEST = json.loads((ROOT / "docs" / "reference" / "manifest.schema.json").read_text(encoding="utf-8"))

_TYPES = {"object": dict, "array": list, "string": str, "number": (int, float), "integer": int}

#: Keywords without a check of their own.
_NOTES = {"$schema", "$defs", "title", "description"}


def faults(value, schema=MANIFEST, root=MANIFEST, at="$") -> list[str]:
    """Return what differs from a schema, with the path of each difference; empty if valid.

    Raises KeyError for a keyword that is not supported.
    """
    found = []
    for keyword, wanted in schema.items():
        if keyword not in _NOTES:
            found += _CHECKS[keyword](value, wanted, schema, root, at)
    return found


def _type(value, wanted, schema, root, at):
    ok = isinstance(value, _TYPES[wanted]) and not isinstance(value, bool)
    return [] if ok else [f"{at}: {value!r} is no {wanted}"]


def _ref(value, wanted, schema, root, at):
    target = root
    for key in wanted.removeprefix("#/").split("/"):
        target = target[key]
    return faults(value, target, root, at)


def _any_of(value, wanted, schema, root, at):
    each = [faults(value, option, root, at) for option in wanted]
    return [] if not all(each) else min(each, key=len)


def _required(value, wanted, schema, root, at):
    known = value if isinstance(value, dict) else {}
    return [f"{at}: '{key}' is missing" for key in wanted if key not in known]


def _properties(value, wanted, schema, root, at):
    known = value if isinstance(value, dict) else {}
    return [
        fault
        for key in known.keys() & wanted.keys()
        for fault in faults(known[key], wanted[key], root, f"{at}.{key}")
    ]


def _additional(value, wanted, schema, root, at):
    others = {key: part for key, part in _dict(value).items() if key not in schema.get("properties", {})}
    if wanted is False:
        return [f"{at}: unknown key '{key}'" for key in others]
    return [fault for key, part in others.items() for fault in faults(part, wanted, root, f"{at}.{key}")]


def _items(value, wanted, schema, root, at):
    parts = value if isinstance(value, list) else []
    return [
        fault for index, part in enumerate(parts) for fault in faults(part, wanted, root, f"{at}[{index}]")
    ]


def _dict(value):
    return value if isinstance(value, dict) else {}


def _limit(is_ok, kind, text):
    """Return a check of values of a kind; values of other kinds fail at "type"."""

    def check(value, wanted, schema, root, at):
        ok = not isinstance(value, kind) or is_ok(value, wanted)
        return [] if ok else [f"{at}: {value!r} {text} {wanted!r}"]

    return check


_CHECKS = {
    "type": _type,
    "$ref": _ref,
    "anyOf": _any_of,
    "required": _required,
    "properties": _properties,
    "additionalProperties": _additional,
    "items": _items,
    "const": _limit(lambda value, wanted: value == wanted, object, "is not"),
    "minimum": _limit(lambda value, wanted: value >= wanted, (int, float), "is below"),
    "minItems": _limit(lambda value, wanted: len(value) >= wanted, list, "has fewer items than"),
    "maxItems": _limit(lambda value, wanted: len(value) <= wanted, list, "has more items than"),
    "minLength": _limit(lambda value, wanted: len(value) >= wanted, str, "is shorter than"),
    "pattern": _limit(lambda value, wanted: re.search(wanted, value) is not None, str, "does not match"),
}
