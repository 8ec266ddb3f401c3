"""Arrays as the library speaks of them: their types by dtype, and checked, read-only copies for frozen values."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Float64: TypeAlias = npt.NDArray[np.float64]
Float32: TypeAlias = npt.NDArray[np.float32]
Floats: TypeAlias = npt.NDArray[np.floating[Any]]  # single or double, as it came
UInt8: TypeAlias = npt.NDArray[np.uint8]
Bools: TypeAlias = npt.NDArray[np.bool_]
Ints: TypeAlias = npt.NDArray[np.integer[Any]]


def finite_array(value: Any, shape: tuple[int, ...], name: str) -> Float64:
    """Return a read-only float64 copy of an array that must be finite.

    Parameters
    ----------
    value : array_like
    shape : tuple of int
        The shape it must have.
    name : str
        What the message calls it.

    Returns
    -------
    array of that shape, float64, read-only

    Raises
    ------
    ValueError
        If the shape is another, or a value is not finite; the text shows what came.

    Examples
    --------
    >>> finite_array([1, 2, 3], (3,), "T")
    array([1., 2., 3.])
    """
    array = np.array(value, float)
    if array.shape != shape or not np.isfinite(array).all():
        raise ValueError(f"{name} must be {shape} finite numbers, got shape {array.shape}: {value!r}")
    array.setflags(write=False)
    return array


def set_frozen(obj: object, **values: object) -> None:
    """Set fields of a frozen dataclass while it is being made.

    Parameters
    ----------
    obj : object
        The dataclass, in its ``__post_init__``.
    **values
        Its fields' new values.
    """
    for name, value in values.items():
        object.__setattr__(obj, name, value)
