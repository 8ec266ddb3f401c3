"""The virtual rig: Table I's two cameras and an XV-11 looking at scenes of boxes on a floor.

The paper's photographs and recordings were never published. What is made here is always called virtual.
"""
