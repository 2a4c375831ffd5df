"""The cheap end of every chart of error against time: the scene rasterised by pyrender, a point in place of
each area light, no shadows.

    surfaces.py   SceneDescription -> triangles in camera space
    lights.py     lights -> lights without size, and a constant
    scene.py      both together, and the camera
    worker.py     the only import of pyrender, in a process of its own
    process.py    starts it and takes the image and the depth

Nothing here imports the renderer: the depth buffer is a check of its primary visibility.
"""
