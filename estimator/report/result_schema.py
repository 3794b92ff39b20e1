"""The JSON Schema of ``result.json``, which says of every field what it means.

``docs/result.schema.json`` is what this module prints::

    python -m estimator.report.result_schema > docs/result.schema.json
"""

from __future__ import annotations

import json
import re
from typing import Any, Final

from estimator.report.result import Result

_DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"
_ATTRIBUTE: Final = re.compile(r"^ {4}(\w+): ((?:.+\n?)(?: {8}.+\n?)*)", re.MULTILINE)


def result_schema() -> dict[str, Any]:
    """What ``result.json`` holds, with the docstrings of its records as descriptions."""
    schema = Result.model_json_schema(mode="serialization")
    for record in (schema, *schema["$defs"].values()):
        _describe(record)
    return {"$schema": _DIALECT, **schema, "title": "result.json"}


def _describe(record: dict[str, Any]) -> None:
    """Gives what a docstring says of attributes to the fields themselves."""
    summary, _, attributes = record["description"].partition("\n\nAttributes:\n")
    record["description"] = summary
    for name, text in _ATTRIBUTE.findall(attributes):
        record["properties"][name]["description"] = " ".join(text.split())


if __name__ == "__main__":
    print(json.dumps(result_schema(), indent=2))
