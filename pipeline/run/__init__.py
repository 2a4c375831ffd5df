"""A sweep computed: grid, jobs, workers, executors."""
