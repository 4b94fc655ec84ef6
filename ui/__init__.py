"""The window: the only place that knows of screen, keyboard and mouse.

Read :mod:`ui.keys` for what each key does, :mod:`ui.state` for what keys change, :mod:`ui.window` for the loop that
ties tracer, filters and screen together. Only :mod:`ui.glfw_window` calls glfw; :mod:`ui.camera_control` and
:mod:`ui.present` do not know what window they serve.
"""
