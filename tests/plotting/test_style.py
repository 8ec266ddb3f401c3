"""Panels have their size, and neither the user's settings nor ours reach the other."""

from __future__ import annotations

import os
import subprocess
import sys

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from stereolib import plotting
from stereolib.base import ROOT


def drawing(noise=0.0):
    figure, (left, right) = plotting.panels(2, width_in=6)
    rng = np.random.default_rng(0)
    disparity = np.where(rng.random((40, 60)) < 0.1, np.nan, rng.uniform(0, 100, (40, 60)) + noise)
    plotting.plot_disparity(disparity, left, "a map", high=100)
    plotting.plot_curves({"ours": ([1, 2, 3], [1, 4, 9]), "paper": ([1, 3], [2, 2])}, right, xlabel="x", ylabel="y")
    return figure


def test_no_global_state_is_touched():
    """No figures that pile up in pyplot, and no default of the user's changed."""
    code = (
        "import matplotlib; before = dict(matplotlib.rcParams); import stereolib.plotting as p;"
        "figure = p.panels(2)[0]; p.save_figure('fig', figure, svg=True);"
        "after = dict(matplotlib.rcParams); assert after == before, set(after.items()) ^ set(before.items());"
        "from matplotlib._pylab_helpers import Gcf; assert not Gcf.figs"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def everything_drawn() -> list[bytes]:
    """One figure with a map, curves, a legend and a bar chart, as PNG and as a slider's image."""
    figure = drawing()
    bars, (ax,) = plotting.panels(1)
    plotting.plot_bars({"a": 1, "b": 2}, ax, xlabel="n", title="t")
    return [plotting.show_figure(None, figure).data, plotting.figure_to_image(bars).tobytes()]


def test_the_users_matplotlibrc_does_not_show():
    expected = everything_drawn()
    theirs = {"axes.facecolor": "red", "font.size": 20.0, "lines.linewidth": 9.0, "savefig.transparent": True}
    with matplotlib.rc_context(theirs):
        assert everything_drawn() == expected
        assert {name: matplotlib.rcParams[name] for name in theirs} == theirs


def test_panels_have_the_size_asked_for():
    figure, axes = plotting.panels(3, 2, width_in=9.0, aspect=0.5)
    assert isinstance(figure, Figure)
    assert axes.shape == (6,)
    np.testing.assert_allclose(figure.get_size_inches(), [9, 3])
