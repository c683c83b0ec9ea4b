"""Pictures, videos and recordings of runs, and drawings of graphs, floor plans and reachability maps."""
