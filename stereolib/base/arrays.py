"""Arrays as the library speaks of them: their types by dtype, and checked, read-only copies for frozen values."""

from __future__ import annotations

import reprlib
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Float64: TypeAlias = npt.NDArray[np.float64]
Float32: TypeAlias = npt.NDArray[np.float32]
Floats: TypeAlias = npt.NDArray[np.floating[Any]]  # single or double, as it came
UInt8: TypeAlias = npt.NDArray[np.uint8]
Bools: TypeAlias = npt.NDArray[np.bool_]
Ints: TypeAlias = npt.NDArray[np.integer[Any]]


def finite_array(value: Any, shape: tuple[int, ...] | None, name: str, *, most: float = np.inf) -> Float64:
    """Return a read-only float64 copy of an array that must be finite.

    Parameters
    ----------
    value : array_like
    shape : tuple of int or None
        The shape it must have; None: any.
    name : str
        What the message calls it.
    most : float
        The largest magnitude that makes sense; beyond it products overflow, or a file is damaged.

    Returns
    -------
    array of that shape, float64, read-only

    Raises
    ------
    ValueError
        If it is not made of numbers, the shape is another, or a value is not finite or beyond `most`; the text shows
        what came.

    Examples
    --------
    >>> finite_array([1, 2, 3], (3,), "T")
    array([1., 2., 3.])
    """
    wanted = "finite numbers" if shape is None else f"{shape} finite numbers"
    try:
        array = np.array(value, float)
    except (TypeError, ValueError, OverflowError):  # words, rows of different length, integers of 400 digits
        raise ValueError(f"{name} must be {wanted}, got {reprlib.repr(value)}") from None
    if (shape is not None and array.shape != shape) or not np.isfinite(array).all():
        raise ValueError(f"{name} must be {wanted}, got shape {array.shape}: {reprlib.repr(value)}")
    if (np.abs(array) > most).any():
        raise ValueError(f"{name} must be numbers up to {most:g}, got {reprlib.repr(value)}")
    array.setflags(write=False)
    return array


def as_rows(value: npt.ArrayLike, width: int, name: str) -> Float64:
    """Return points as rows: an array whose last axis has `width` numbers, its other axes made one.

    Parameters
    ----------
    value : (..., width) array_like
        A single row, rows, or a picture of them; one without any number has no rows.
    width : int
    name : str
        What the message calls it.

    Returns
    -------
    (N, width) float64

    Raises
    ------
    ValueError
        If the last axis is of another length; the text says so where it is the first one that fits.

    Examples
    --------
    >>> as_rows([1, 2], 2, "pixels")
    array([[1., 2.]])
    >>> as_rows(np.ones((2, 5)), 2, "pixels")
    Traceback (most recent call last):
    ...
    ValueError: pixels must be (N, 2), a row each, got shape (2, 5): transpose it
    """
    array = np.asarray(value, float)
    if array.size and array.shape[-1:] != (width,):
        remedy = "transpose it" if array.ndim == 2 and len(array) == width else f"give {width} numbers a row"
        raise ValueError(f"{name} must be (N, {width}), a row each, got shape {array.shape}: {remedy}")
    return array.reshape(-1, width)


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
