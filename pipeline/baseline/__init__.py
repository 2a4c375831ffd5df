"""The rasterised baseline: pyrender draws the scene without shadows, a point in place of each area light.

It is the cheap end of every chart of error against time.

    surfaces.py   SceneDescription -> triangles in camera space
    lights.py     lights -> lights without size, and a constant
    scene.py      both together, and the camera
    worker.py     the only import of pyrender, in a process of its own
    process.py    starts it and takes the image and the depth

Nothing here imports the renderer: the depth buffer is a check of its primary visibility.
"""
