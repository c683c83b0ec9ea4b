"""The world on the page of a run: poses over time, shapes, the floor plan, searches for base poses."""
