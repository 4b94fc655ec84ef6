"""The GPU side: a render graph of small passes, and the denoisers written with it.

Read :mod:`gl.graph` to write passes and pipelines (no OpenGL needed), :mod:`gl.plan` for what a compiled frame looks
like, and :mod:`gl.executor` for how a plan becomes textures, programs and draw calls.
"""
