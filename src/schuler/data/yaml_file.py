"""YAML files of users: read with limits, so that no file can hang or exhaust the program."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

from schuler.errors import InputError

_MAX_BYTES = 1 << 20
_MAX_DEPTH = 40
_MAX_NODES = 200_000  # aliases count as what they stand for
_MAX_NUMBER = 64  # characters
_INTEGER = re.compile(r"[-+]?[0-9]+$")
_FLOAT = re.compile(
    r"(?:[-+]?[0-9]+\.[0-9]*(?:[eE][-+][0-9]+)?|[-+]?\.[0-9]+(?:[eE][-+][0-9]+)?"
    r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))$"
)


def read_yaml(path: str | Path, expected: str) -> Any:
    """Read a YAML file of plain keys, lists, texts and numbers.

    Refused are files over 1 MiB, deep nesting, aliases that multiply, endless numbers, tags and
    keys given twice. Dates and numbers such as 1_000 or 12:30 stay text.

    Raises
    ------
    InputError
        With file and line; `expected` says what the file should have been.
    """
    import yaml

    try:
        with Path(path).open("rb") as stream:
            data = stream.read(_MAX_BYTES + 1)
    except OSError as error:
        raise InputError(
            f"cannot be read ({error.strerror})", expected=expected, where=str(path)
        ) from None
    if len(data) > _MAX_BYTES:
        raise InputError("is larger than 1 MiB", expected=f"{expected} (YAML)", where=str(path))
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("is not text", expected=f"{expected} (YAML)", where=str(path)) from None
    try:
        return _loader()(text).get_single_data()
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"{path}: line {mark.line + 1}" if mark else str(path)
        problem = str(
            getattr(error, "problem", None) or getattr(error, "reason", "cannot be parsed")
        )
        if not isinstance(error, yaml.composer.ComposerError):
            problem = f"not YAML: {problem}"
        raise InputError(problem, expected=expected, where=place) from None


@cache
def _loader() -> type[Any]:
    """Return PyYAML's safe loader with limits; PyYAML is imported only when it is needed."""
    import yaml

    class Limited(yaml.SafeLoader):
        def __init__(self, text: str) -> None:
            super().__init__(text)
            self.depth = 0
            self.total = 0
            self.weights: dict[int, int] = {}

        def compose_node(self, parent: Any, index: Any) -> Any:
            event: Any = self.peek_event()  # type: ignore[no-untyped-call]
            if isinstance(event, yaml.AliasEvent):
                node = super().compose_node(parent, index)
                # An anchor inside itself has no weight yet.
                self._add(self.weights.get(id(node), _MAX_NODES + 1), event)
                return node
            if getattr(event, "tag", None):
                raise _refused(f"a tag ({event.tag})", event)
            if self.depth >= _MAX_DEPTH:
                raise _refused(f"nested more than {_MAX_DEPTH} deep", event)
            self.depth += 1
            before = self.total
            self._add(1, event)
            node = super().compose_node(parent, index)
            self.depth -= 1
            self.weights[id(node)] = self.total - before
            _check_node(node, event)
            return node

        def _add(self, weight: int, event: Any) -> None:
            self.total += weight
            if self.total > _MAX_NODES:
                raise _refused(f"more than {_MAX_NODES} entries, aliases counted", event)

    def _refused(what: str, event: Any) -> yaml.YAMLError:
        return yaml.composer.ComposerError(None, None, what, event.start_mark)

    def _check_node(node: Any, event: Any) -> None:
        if isinstance(node, yaml.MappingNode):
            keys = [k.value for k, _ in node.value if isinstance(k, yaml.ScalarNode)]
            if len(keys) < len(node.value):
                raise _refused("a key that is no single word", event)
            seen: set[str] = set()
            for key, (entry, _) in zip(keys, node.value, strict=True):
                if key in seen:
                    raise _refused(f"key '{key[:40]}' stands twice", entry)
                seen.add(key)
        elif node.tag.endswith((":int", ":float")) and len(node.value) > _MAX_NUMBER:
            raise _refused(f"a number of {len(node.value)} characters", event)

    tag = "tag:yaml.org,2002:"
    unwanted = {f"{tag}{kind}" for kind in ("int", "float", "timestamp", "merge", "value")}
    Limited.yaml_implicit_resolvers = {
        first: [(kind, pattern) for kind, pattern in known if kind not in unwanted]
        for first, known in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }
    Limited.add_implicit_resolver(f"{tag}float", _FLOAT, list("-+0123456789."))
    Limited.add_implicit_resolver(f"{tag}int", _INTEGER, list("-+0123456789"))
    # a zero in front does not make a number octal, as in YAML 1.1
    Limited.add_constructor(f"{tag}int", lambda _, node: int(node.value))
    return Limited
