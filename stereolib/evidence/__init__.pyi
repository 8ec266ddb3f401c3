from .matching import glare_times

__all__ = [
    "glare_times",
]
