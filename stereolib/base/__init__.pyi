from . import datasets
from .angles import direction, turn_2d, turn_about_z, wrap_rad
from .arrays import Bools, Float32, Float64, Floats, Ints, UInt8, as_rows, finite_array, set_frozen
from .datasets import ROOT, NotAvailable, available, data_path, figures_dir, real_recording, real_recordings, repository
from .files import check_name, check_target, read_bytes, read_text, write_atomic
from .numbers import counted, listed, plus_minus, rounded
from .statistics import clustered_covariance, median, quantile
from .text_formats import check_nesting, parse_yaml, read_json, read_toml, read_yaml
from .work_folder import work_folder

__all__ = [
    "ROOT",
    "Bools",
    "Float32",
    "Float64",
    "Floats",
    "Ints",
    "NotAvailable",
    "UInt8",
    "as_rows",
    "available",
    "check_name",
    "check_nesting",
    "check_target",
    "clustered_covariance",
    "counted",
    "data_path",
    "datasets",
    "direction",
    "figures_dir",
    "finite_array",
    "listed",
    "median",
    "parse_yaml",
    "plus_minus",
    "quantile",
    "read_bytes",
    "read_json",
    "read_text",
    "read_toml",
    "read_yaml",
    "real_recording",
    "real_recordings",
    "repository",
    "rounded",
    "set_frozen",
    "turn_2d",
    "turn_about_z",
    "work_folder",
    "wrap_rad",
    "write_atomic",
]
