"""Where a body can go in a scene: occupancy, stairs, the shortest ways, and where to stand at a target (paper, section
4.1).

An OccupancyGrid is one floor; a MultiFloorMap holds all floors of a scene with the stairs between them; a DistanceField
tells how far it is to the nearest of some goals from everywhere; Routes lead from one start to everywhere; a Viewpoint
is a place to stand.
"""
