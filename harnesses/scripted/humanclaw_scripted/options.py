"""How what stands after --option is read."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from humanclaw import HumanclawError

M = TypeVar("M", bound=BaseModel)


def read(model: type[M], given: Mapping[str, Any]) -> M:
    """Check options. Raises HumanclawError that says which is wrong."""
    try:
        return model(**given)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "options"
        raise HumanclawError(
            f"--option {where}: {first['msg']}.", f"The options are {', '.join(model.model_fields)}."
        ) from None
