"""Frames on disk, in the layout of the BMFR data set: recorded from the tracer, replayed through the filters."""
