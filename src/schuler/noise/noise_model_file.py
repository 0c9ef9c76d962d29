"""Noise models as YAML that a person can read and edit."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Any, Literal

from schuler.data.imu import CHANNELS
from schuler.data.yaml_file import read_yaml
from schuler.errors import InputError, SchulerError
from schuler.noise.base import Process, ProcessSum
from schuler.noise.effects import TERMS, Effect
from schuler.noise.parameter_names import class_and_number, parameter_kind
from schuler.noise.registry import GROUP, check_answers, kinds, process_class
from schuler.units import format_value, kind_of, parse

_HEADER = """\
# Noise model of an inertial measurement unit: independent processes that add up, per channel.
# Every number has its unit and may be edited; "+-" is one standard error. A number without a
# unit is taken as SI (rad, m, s, Hz).
"""
_PLUS_MINUS = re.compile(r"^\s*(?P<value>\S+)\s*(?:\+-|\+/-|±)\s*(?P<error>\S+)(?P<unit>.*)$")
_PLAIN = re.compile(r"\s*[-+]?(?:[0-9.]+(?:[eE][-+]?[0-9]+)?|inf|nan)\s*$", re.IGNORECASE)


@dataclass(frozen=True, slots=True, eq=False)
class Content:
    """What a noise model file holds; the fields of `NoiseModel`."""

    processes: Mapping[str, Process]
    standard_errors: Mapping[str, Mapping[str, float]]
    rate: float | None
    source: str
    limits: Mapping[str, Mapping[str, float]]
    effects: Mapping[str, Sequence[Effect]]


def noise_model_text(model: Content, units: Literal["datasheet", "si"]) -> str:
    """Write a noise model as YAML."""
    import yaml

    def quoted(text: str) -> str:
        return yaml.safe_dump(text, default_style='"', width=10**6, allow_unicode=True).strip()

    lines = [_HEADER, f"source: {quoted(model.source)}"]
    if model.rate is not None:
        lines.append(f"rate: {format_value(model.rate, 'frequency', digits=9)}")
    lines.append("channels:")
    for channel, process in model.processes.items():
        errors = model.standard_errors.get(channel, {})
        lines.append(f"  {channel}:")
        assert isinstance(process, ProcessSum)
        for name, part in zip(process.names, process.parts, strict=True):
            lines.append(f"    - {part.kind}:" + (f"  # {part.meaning}" if part.meaning else ""))
            lines += _part_text(part, channel, name, errors, units)
    if any(model.limits.values()):
        lines += ["# Looked for and not found: more than this is excluded at 95 %.", "excluded:"]
        for channel, limits in model.limits.items():
            if limits:
                lines.append(f"  {channel}:")
                lines += [
                    f"    {key}: {_text(channel, key, v, {}, units)}" for key, v in limits.items()
                ]
    lines += _effects_text(model.effects)
    return "\n".join(lines) + "\n"


def _effects_text(effects: Mapping[str, Sequence[Effect]]) -> list[str]:
    if not any(effects.values()):
        return []
    lines = ["# What follows a quantity beside the channel, SI a kelvin (its square, its rate).",
             "effects:"]  # fmt: skip
    for channel, own in effects.items():
        lines.append(f"  {channel}:")
        lines += [
            f"    - {{of: {e.column}, term: {e.term}, coefficient: "
            f"{e.coefficient:.9g} +- {e.standard_error:.3g}, reference: {e.reference:.9g}}}"
            for e in own
        ]
    return lines


def _read_effects(content: Any, where: str) -> dict[str, tuple[Effect, ...]]:
    found: dict[str, tuple[Effect, ...]] = {}
    for channel, entries in _mapping(content or {}, where).items():
        place = f"{where}.{channel}"
        _channel(channel, place)
        if not isinstance(entries, list):
            raise InputError("no list of effects", expected="- {of: temperature, ...}", where=place)
        own = []
        for entry in entries:
            values = _mapping(entry, place)
            _only(values, {"of", "term", "coefficient", "reference"}, place)
            term = str(values.get("term", "linear"))
            if term not in TERMS:
                raise InputError(f"term '{term}'", expected=f"of {', '.join(TERMS)}", where=place)
            size, error = _number(values.get("coefficient"), None, f"{place}: coefficient")
            reference, _ = _number(values.get("reference", 0.0), None, f"{place}: reference")
            own.append(Effect(str(values.get("of")), term, size, error or 0.0, reference))
        found[channel] = tuple(own)
    return found


def _part_text(
    part: Process, channel: str, name: str, errors: Mapping[str, float], units: str
) -> list[str]:
    """Lines of one process; what is at its default is left out.

    Rounded coefficients are another process (E-004-10): where there are any, all numbers are
    written with all digits, and in SI.
    """
    values = {f.name: getattr(part, f.name) for f in fields(part)}  # type: ignore[arg-type]
    series = any(isinstance(v, tuple) for v in values.values())
    defaults = {f.name: f.default for f in fields(part)}  # type: ignore[arg-type]
    lines = []
    for key, value in values.items():
        if isinstance(value, tuple):
            text = f"[{', '.join(repr(float(v)) for v in value)}]"
        elif value is None or value == defaults[key]:
            continue
        elif series:
            unit = " s" if part.described(key).unit == "time" else ""
            text = f"{float(value)!r}{unit}"
        else:
            text = _text(channel, f"{name}.{key}", float(value), errors, units)
        lines.append(f"        {key}: {text}")
    return lines


def _text(channel: str, key: str, value: float, errors: Mapping[str, float], units: str) -> str:
    kind = parameter_kind(channel, key)
    if kind is None:
        text = f"{value:g}" if value == round(value) else f"{value:.9g}"
        return f"{text} +- {errors[key]:.3g}" if key in errors else text
    text = format_value(value, kind, units, digits=9)
    if key in errors:
        number, _, unit = text.partition(" ")
        error = format_value(errors[key], kind, units, digits=3).partition(" ")[0]
        text = f"{number} +- {error} {unit}"
    return text


def read_noise_model(path: str | Path) -> Content:
    """Read a noise model from YAML."""
    where = str(path)
    content = _mapping(read_yaml(path, "a noise model"), where)
    _only(content, {"source", "rate", "channels", "excluded", "effects"}, where)
    if "channels" not in content:
        raise InputError("key 'channels' is missing", expected="channels: gyro_x: ...", where=where)
    rate = content.get("rate")
    processes: dict[str, Process] = {}
    errors: dict[str, dict[str, float]] = {}
    for channel, entries in _mapping(content["channels"], f"{where}: channels").items():
        place = f"{where}: channels.{channel}"
        _channel(channel, place)
        processes[channel], errors[channel] = _read_channel(channel, entries, place)
    limits = {
        channel: {
            str(key): _number(value, _limit_kind(channel, str(key), where), f"{where}: {key}")[0]
            for key, value in _mapping(values, f"{where}: excluded.{channel}").items()
        }
        for channel, values in _mapping(content.get("excluded") or {}, f"{where}: excluded").items()
        if _channel(channel, f"{where}: excluded.{channel}")
    }
    return Content(
        processes=processes,
        standard_errors={c: e for c, e in errors.items() if e},
        rate=None if rate is None else _number(rate, "frequency", f"{where}: rate")[0],
        source=str(content.get("source") or ""),
        limits=limits,
        effects=_read_effects(content.get("effects"), f"{where}: effects"),
    )


def _mapping(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        found = "nothing" if value is None else f"'{str(value)[:40]}'"
        raise InputError(f"{found} stands here", expected="keys with values", where=where)
    return value


def _only(content: Mapping[str, Any], known: set[str], where: str) -> None:
    for key in content:
        if key not in known:
            raise InputError(
                f"key '{key}' is not known", expected=f"of {', '.join(sorted(known))}", where=where
            )


def _channel(channel: Any, where: str) -> bool:
    if channel not in CHANNELS:
        raise InputError(
            f"'{channel}' is not a channel", expected=f"of {', '.join(CHANNELS)}", where=where
        )
    return True


def _read_channel(channel: str, entries: Any, where: str) -> tuple[ProcessSum, dict[str, float]]:
    if not isinstance(entries, list) or not entries:
        raise InputError("no list of processes", expected="- white_noise: ...", where=where)
    parts: list[Process] = []
    errors: list[dict[str, float]] = []
    for entry in entries:
        content = _mapping(entry, where)
        if len(content) != 1:
            raise InputError(
                f"{len(content)} processes in one entry ({', '.join(map(str, content))})",
                expected="one '- name:' for each process",
                where=where,
            )
        ((kind, values),) = content.items()
        part, its = _read_process(channel, str(kind), values, f"{where}.{kind}")
        parts.append(part)
        errors.append(its)
    total = ProcessSum(tuple(parts))
    named = {
        f"{name}.{key}": value
        for name, its in zip(total.names, errors, strict=True)
        for key, value in its.items()
    }
    return total, named


def _read_process(
    channel: str, kind: str, values: Any, where: str
) -> tuple[Process, dict[str, float]]:
    cls = process_class(kind)
    if cls is None:
        raise InputError(
            f"process '{kind}' is not known",
            expected=f"of {', '.join(kinds())}",
            cure="import the module that defines it first, or install it with an entry point of "
            f"the group '{GROUP}'",
            where=where,
        )
    content = _mapping(values, where)
    known = {f.name: f for f in fields(cls)}  # type: ignore[arg-type]
    _only(content, set(known), where)
    for name, wanted in known.items():
        if wanted.default is MISSING and name not in content:
            raise InputError(f"key '{name}' is missing", where=where)
    numbers: dict[str, Any] = {}
    errors: dict[str, float] = {}
    for name, value in content.items():
        if "tuple" in str(known[name].type):
            numbers[name] = _coefficients(value, f"{where}.{name}")
            continue
        unit_kind = parameter_kind(channel, f"{kind}.{name}")
        numbers[name], error = _number(value, unit_kind, f"{where}.{name}")
        if error is not None:
            errors[name] = error
    try:
        part = cls(**numbers)
        check_answers(part)
    except SchulerError as error:
        raise InputError(error.found, expected=error.expected, where=where) from None
    return part, errors


def _coefficients(value: Any, where: str) -> tuple[float, ...]:
    if not isinstance(value, list):
        raise InputError("no list stands here", expected="coefficients in [ ]", where=where)
    return tuple(_number(v, None, where)[0] for v in value)


def _limit_kind(channel: str, key: str, where: str) -> str | None:
    name, _, field = key.partition(".")
    cls, _ = class_and_number(name)
    if cls is None or field not in {f.name for f in fields(cls)}:  # type: ignore[arg-type]
        raise InputError(f"'{key}' is not a parameter", where=f"{where}: excluded.{channel}")
    return parameter_kind(channel, key)


def _number(value: Any, kind: str | None, where: str) -> tuple[float, float | None]:
    """Return value and standard error in SI."""
    if value is None or isinstance(value, (bool, list, dict)):
        unit = "" if kind is None else f" such as '1.5 {kind_of(kind).datasheet}'"
        raise InputError("no number stands here", expected=f"a number{unit}", where=where)
    try:
        split = _PLUS_MINUS.match(value) if isinstance(value, str) else None
        if split is None:
            return _one(value, kind), None
        first = _one(split["value"] + split["unit"], kind)
        error = _one(split["error"] + split["unit"], kind)
    except SchulerError as error_found:
        raise error_found.at(where) from None
    if error < 0.0:
        raise InputError(f"standard error {split['error']} is negative", where=where)
    return first, error


def _one(value: Any, kind: str | None) -> float:
    # YAML takes 1e-4 (no point) for text; a bare number is SI
    plain = None
    if not isinstance(value, str) or _PLAIN.match(value):
        try:
            plain = float(value)
        except OverflowError:
            plain = float("inf")
    if plain is None:
        if kind is None:
            raise InputError(f"'{value}' is not a number", expected="a plain number")
        return parse(value, kind)
    if plain - plain != 0.0:
        raise InputError(f"'{value}' is not finite", expected="a finite number")
    return plain
