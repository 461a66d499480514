"""YAML files checked against a pydantic model; every complaint names file, line and column."""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING, Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from bench.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pydantic_core import ErrorDetails

Model = TypeVar("Model", bound=BaseModel)
Location = tuple[int | str, ...]


class FileModel(BaseModel):
    """Base of everything that stands in a file: unknown keys are errors, loaded values final."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


def load_model(path: Path, model: type[Model]) -> Model:
    """Return the model that a YAML file holds.

    Raises
    ------
    ConfigError
        One sentence with ``file:line:column`` if the file cannot be read, is no YAML, has a
        key twice, an unknown key (with a suggestion), a missing key or a wrong value.
    """
    node = _compose(path)
    if not isinstance(node, yaml.MappingNode):
        message = f"{path}: file must hold a mapping of keys to values; it holds something else"
        raise ConfigError(message)
    try:
        _require_unique_keys(node, path)
        data = _data_of(node, path)
    except RecursionError as error:
        message = f"{path}: file must not hold itself by an alias"
        raise ConfigError(message) from error
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise ConfigError(_sentence(path, node, model, error)) from error


def _compose(path: Path) -> yaml.Node | None:
    try:
        text = path.read_text(encoding="utf-8")
        return yaml.compose(text, Loader=yaml.SafeLoader)
    except (OSError, UnicodeDecodeError) as error:
        message = f"{path}: file cannot be read ({error})"
        raise ConfigError(message) from error
    except yaml.YAMLError as error:
        raise _no_yaml(path, error) from error


def _no_yaml(path: Path, error: yaml.YAMLError | ValueError) -> ConfigError:
    where, what = str(path), " ".join(str(error).split())
    if isinstance(error, yaml.MarkedYAMLError):
        mark = error.problem_mark or error.context_mark
        where = f"{path}:{mark.line + 1}:{mark.column + 1}" if mark else where
        what = str(error.problem or error.context)
    return ConfigError(f"{where}: file is not valid YAML: {what}")


def _data_of(node: yaml.Node, path: Path) -> Any:  # noqa: ANN401  (YAML holds anything)
    loader = yaml.SafeLoader("")
    try:
        return loader.construct_document(node)
    except (yaml.YAMLError, ValueError) as error:
        raise _no_yaml(path, error) from error
    finally:
        loader.dispose()


def _require_unique_keys(node: yaml.Node, path: Path) -> None:
    if isinstance(node, yaml.SequenceNode):
        for item in node.value:
            _require_unique_keys(item, path)
    elif isinstance(node, yaml.MappingNode):
        seen: set[str] = set()
        for key, value in node.value:
            if str(key.value) in seen:
                message = f"{_place(path, key)}: key {key.value!r} stands here twice"
                raise ConfigError(message)
            seen.add(str(key.value))
            _require_unique_keys(value, path)


def _sentence(path: Path, root: yaml.Node, model: type[BaseModel], error: ValidationError) -> str:
    details = error.errors(include_url=False)
    first = min(details, key=lambda detail: detail["type"] != "extra_forbidden")
    node, names = _find(root, first["loc"])
    others = len(details) - 1
    more = f" (and {others} more)" if others else ""
    return f"{_place(path, node)}: {_complaint(first, names, model)}{more}"


def _complaint(detail: ErrorDetails, names: list[str], model: type[BaseModel]) -> str:
    where = ".".join(names) or "file"
    match detail["type"]:
        case "extra_forbidden":
            key = str(detail["loc"][-1])
            known = known_keys(model.model_json_schema(), detail["loc"][:-1])
            return f"unknown key {key!r}{_suggestion(key, known)}"
        case "missing" if isinstance(detail["loc"][-1], int):
            return f"{where}: value is missing"
        case "missing":
            return f"key {str(detail['loc'][-1])!r} is missing"
        case "union_tag_invalid":
            tag = str(detail["ctx"]["tag"])
            tags = [name.strip("' ") for name in str(detail["ctx"]["expected_tags"]).split(",")]
            return f"unknown kind {tag!r}{_suggestion(tag, tags)}"
        case "union_tag_not_found":
            return "key 'kind' is missing"
        case "value_error":
            return f"{where}: {detail['msg'].removeprefix('Value error, ')}"
        case _:
            shown = (
                ""
                if isinstance(detail["input"], dict | list)
                else f"; instead received {detail['input']!r}"
            )
            return f"{where}: {detail['msg'][:1].lower()}{detail['msg'][1:]}{shown}"


def _suggestion(name: str, known: list[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    return f"; did you mean {close[0]!r}?" if close else f"; known are {', '.join(sorted(known))}"


def known_keys(schema: Mapping[str, Any], location: Location) -> list[str]:
    """Return the keys that a JSON schema knows at a location of pydantic's errors."""
    definitions = schema.get("$defs", {})
    node: Mapping[str, Any] = schema
    for part in location:
        node = _resolve(_step_into(_resolve(node, definitions), part), definitions)
    return [str(name) for name in _resolve(node, definitions).get("properties", {})]


def _resolve(node: Mapping[str, Any], definitions: Mapping[str, Any]) -> Mapping[str, Any]:
    while "$ref" in node:
        node = definitions[str(node["$ref"]).rsplit("/", 1)[-1]]
    optional = [option for option in node.get("anyOf", ()) if option.get("type") != "null"]
    return _resolve(optional[0], definitions) if len(optional) == 1 else node


def _step_into(node: Mapping[str, Any], part: int | str) -> Mapping[str, Any]:
    if isinstance(part, int):
        child = node.get("items", node)
    elif part in node.get("properties", {}):
        child = node["properties"][part]
    elif part in node.get("discriminator", {}).get("mapping", {}):
        child = {"$ref": node["discriminator"]["mapping"][part]}
    elif isinstance(node.get("additionalProperties"), dict):
        child = node["additionalProperties"]
    else:
        child = next((option for option in node.get("anyOf", ()) if "$ref" in option), node)
    return dict(child)


def _find(root: yaml.Node, location: Location) -> tuple[yaml.Node, list[str]]:
    """Return the deepest node that a location reaches, and the names on the way."""
    node, names = _descend(root, location)
    if location and isinstance(location[-1], str):
        node = _key_node(root, location) or node
    return node, names


def _descend(root: yaml.Node, location: Location) -> tuple[yaml.Node, list[str]]:
    node, names = root, []
    for part in location:
        child = _child(node, part)
        if child is not None:
            node = child
            names.append(str(part))
    return node, names


def _child(node: yaml.Node, part: int | str) -> yaml.Node | None:
    if isinstance(node, yaml.SequenceNode) and isinstance(part, int):
        items: list[yaml.Node] = node.value
        return items[part] if part < len(items) else None
    if isinstance(node, yaml.MappingNode):
        return next((value for key, value in node.value if key.value == str(part)), None)
    return None


def _key_node(root: yaml.Node, location: Location) -> yaml.Node | None:
    parent, _ = _descend(root, location[:-1])
    if not isinstance(parent, yaml.MappingNode):
        return None
    return next((key for key, _ in parent.value if key.value == location[-1]), None)


def _place(path: Path, node: yaml.Node) -> str:
    mark = node.start_mark
    return f"{path}:{mark.line + 1}:{mark.column + 1}"
