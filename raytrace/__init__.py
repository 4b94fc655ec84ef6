"""The CPU side: scenes, Embree, one path per pixel. Knows nothing of OpenGL."""
